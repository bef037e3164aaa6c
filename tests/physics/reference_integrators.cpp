// The direct integrator, which everything else is held against, held against integrators that are not ours and against
// extended precision.
#include <algorithm>
#include <boost/numeric/odeint/integrate/integrate_adaptive.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cstdio>

#include "engine/core/error.hpp"
#include "engine/propagate/half_turn.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/cvode.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/extended_precision.hpp"
#include "tests/support/odeint.hpp"

/// odeint asks for the norm of a state that is a number of its own.
template <>
struct boost::numeric::odeint::vector_space_norm_inf<ringlock::test::Quad> {
    using result_type = ringlock::test::Quad;
    result_type operator()(const ringlock::test::Quad& x) const { return abs(x); }
};

namespace ringlock::test {
namespace reference_integrators_test {
namespace {

/// What double precision leaves, whatever the tolerance: at the second turn the plain phase is up to 16000 rad, a sum
/// of several numbers each known to half a unit in the last place, 0.9e-12 rad. Half a turn answers to a shift of the
/// phase with a tenth of it, kappa/2 at the strongest coupling here; four such roundings and as much from the sum over
/// 3000 steps are allowed.
constexpr double rounding_rad = 8e-13;

/// +-5 % of amplitude, +-5 % asymmetry, +-50000 deg/h, any phase and coupling phase; every other one with a second
/// harmonic of the dither and a coupling that differs from turn to turn.
struct Case {
    gyro::Device device;
    gyro::HalfCycle half;
    double phase_rad;
};

Case random_case(Uniform& uniform, int i) {
    gyro::Setup setup = paper_device();
    setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
    setup.input_rate_deg_h = uniform(-50000.0, 50000.0);
    setup.coupling_phase_rad = uniform(-3.0, 3.0);
    if (i % 4 >= 2) {
        setup.dither_harmonic_ratio = uniform(0.0, 0.02);
        setup.dither_harmonic_phase_rad = uniform(-3.0, 3.0);
        setup.lockin_turn_asymmetry = uniform(-0.2, 0.2);
    }
    const gyro::Device device(setup);
    const auto half = device.half_cycle(i % 2 == 0 ? 1.0 : -1.0, device.dither_amplitude_rad * uniform(0.95, 1.05));
    return {device, half, uniform(-3.0, 3.0)};
}

double gain_rad(Propagator& propagator, const Case& one) { return propagator.lockin_gain_rad(one.phase_rad, one.half); }

double direct_gain_rad(const Case& one, double tolerance_rad) {
    DirectIntegrator direct(one.device.coupling, tolerance_rad);
    return gain_rad(direct, one);
}

/// Each tolerance's worst error and the worst of the one before.
void expect_falling(const std::vector<double>& tolerances, const std::vector<double>& worst, const char* name) {
    for (std::size_t k = 0; k < worst.size(); ++k) {
        std::printf("%s at %.1e: worst %.2e rad\n", name, tolerances[k], worst[k]);
        if (k > 0) {
            EXPECT_LT(worst[k], worst[k - 1]) << name << " at " << tolerances[k];
        }
    }
}

/// CVODE nears the direct integrator as it is tightened: the difference is CVODE's own error. Its tolerance is that of
/// one of some 6e4 steps. Were their errors independent and as large as allowed, 250 tolerances would be left; step
/// control makes them alike from fringe to fringe, and 2000 are allowed.
void against_cvode(int half_cycles, std::uint64_t seed) {
    const std::vector<double> tolerances{1e-10, 1e-12, 1e-14};
    std::vector<double> worst(tolerances.size(), 0.0);
    Uniform uniform(seed);
    for (int i = 0; i < half_cycles; ++i) {
        Case one = random_case(uniform, i);
        if (i % 3 == 0) {  // what extended precision cannot do
            one.device.coupling.second_ratio = uniform(-0.2, 0.2);
            one.device.coupling.second_phase_rad = uniform(-3.0, 3.0);
        }
        const double direct = direct_gain_rad(one, 1e-13);
        for (std::size_t k = 0; k < tolerances.size(); ++k) {
            Cvode cvode(one.device.coupling, tolerances[k], 0.0);
            worst[k] = std::max(worst[k], std::abs(gain_rad(cvode, one) - direct));
        }
        // As far as it goes: some 2e4 steps of 1e-14. Left alone, step control is late to notice the short fringes of
        // a second harmonic of the coupling.
        Odeint odeint(one.device.coupling, 1e-14, 0.1);
        EXPECT_NEAR(gain_rad(odeint, one), direct, 1e-9);
    }
    expect_falling(tolerances, worst, "CVODE against the direct integrator");
    for (std::size_t k = 0; k < tolerances.size(); ++k) EXPECT_LT(worst[k], 2e3 * tolerances[k] + rounding_rad);
}

TEST(LongReferenceIntegrators, CvodeConvergesToTheDirectIntegrator) { against_cvode(6, 31); }
TEST(LongReferenceIntegrators, CvodeConvergesToTheDirectIntegratorOverHundredHalfCycles) { against_cvode(100, 32); }

/// Errors against extended precision, of all that the engine has.
void against_extended_precision(int half_cycles, std::uint64_t seed) {
    const std::vector<double> tolerances{1e-6, 1e-8, 1e-10};  // above rounding
    const std::vector<double> tight{1e-12, 1e-13};            // the reference's own
    std::vector<double> worst(tolerances.size(), 0.0);
    std::vector<double> worst_tight(tight.size(), 0.0);
    double worst_half_turns = 0.0;
    double worst_table = 0.0;
    Uniform uniform(seed);
    for (int i = 0; i < half_cycles; ++i) {
        const Case one = random_case(uniform, i);
        const ExtendedHalfCycle extended(one.device.coupling, one.half);
        ASSERT_LT(static_cast<double>(extended.group_error()), 1e-30);
        const Quad exact = extended.lockin_gain_rad(one.phase_rad);
        const auto error_rad = [&](double gain_rad) { return static_cast<double>(abs(Quad(gain_rad) - exact)); };
        for (std::size_t k = 0; k < tolerances.size(); ++k) {
            worst[k] = std::max(worst[k], error_rad(direct_gain_rad(one, tolerances[k])));
        }
        for (std::size_t k = 0; k < tight.size(); ++k) {
            worst_tight[k] = std::max(worst_tight[k], error_rad(direct_gain_rad(one, tight[k])));
        }
        // An empty table: two exact half turns.
        const auto half_turns = make_propagator(Method::turn_map, one.device, 0.0, 1e-10);
        worst_half_turns = std::max(worst_half_turns, error_rad(gain_rad(*half_turns, one)));
        // Wider than what injected noise of 3 rad asks for.
        const double a = one.half.amplitude_rad;
        const double b = one.device.coupling.b_rad_s;
        TurnMap map(one.device, {{0.998 * a, 1.001 * a}, {one.half.rate_rad_s, one.half.rate_rad_s}, {b, b}}, 1e-10);
        worst_table = std::max(worst_table, error_rad(gain_rad(map, one)));
    }
    expect_falling(tolerances, worst, "direct integrator");
    for (std::size_t k = 0; k < tolerances.size(); ++k) EXPECT_LT(worst[k], tolerances[k]);
    for (std::size_t k = 0; k < tight.size(); ++k) {
        std::printf("direct integrator at %.1e: worst %.2e rad\n", tight[k], worst_tight[k]);
        EXPECT_LT(worst_tight[k], tight[k] + rounding_rad);
    }
    std::printf("exact half turns: worst %.2e rad\n", worst_half_turns);
    std::printf("turn map with tables of 1e-10: worst %.2e rad\n", worst_table);
    // Rounding of a hundred Taylor steps and of plain phases of 600 rad and 6300 rad that are taken away in the first
    // half turn: units in the last place, 1e-13 rad and 9e-13 rad.
    EXPECT_LT(worst_half_turns, 1e-12);
    EXPECT_LT(worst_table, 1e-10);
}

TEST(LongReferenceIntegrators, ErrorsAgainstExtendedPrecision) { against_extended_precision(5, 41); }
TEST(LongReferenceIntegrators, ErrorsAgainstExtendedPrecisionOverSixtyHalfCycles) {
    against_extended_precision(60, 42);
}

TEST(ReferenceIntegrators, ExtendedPrecisionIsConverged) {
    // Two thirds of the stride leave (2/3)^41 = 6e-8 of the truncation: what the two share is rounding.
    Uniform uniform(43);
    const Case one = random_case(uniform, 2);
    const ExtendedHalfCycle coarse(one.device.coupling, one.half, 5.0);
    const ExtendedHalfCycle fine(one.device.coupling, one.half, 10.0 / 3.0);
    const double difference =
        static_cast<double>(abs(coarse.lockin_gain_rad(one.phase_rad) - fine.lockin_gain_rad(one.phase_rad)));
    std::printf("extended precision, strides of 5 and 3.3 rad: %.1e rad apart\n", difference);
    EXPECT_LT(difference, 1e-26);
    EXPECT_LT(static_cast<double>(fine.group_error()), 1e-30);
}

TEST(LongReferenceIntegrators, ExtendedPrecisionAgreesWithOdeintBeyondDouble) {
    // The same equation in the same arithmetic, written with the sine of the phase and solved by a method that is not
    // ours. Two tolerances tell odeint's own error.
    Uniform uniform(44);
    const Case one = random_case(uniform, 2);
    const ExtendedHalfCycle extended(one.device.coupling, one.half);
    const Quad exact = extended.lockin_gain_rad(one.phase_rad);
    const Quad duration_s = one.half.duration_s;
    const Quad w = boost::math::constants::pi<Quad>() / duration_s;
    double last = 1.0;
    for (const double tolerance : {1e-15, 1e-18, 1e-21}) {
        Quad deviation = 0;
        using Stepper = boost::numeric::odeint::runge_kutta_fehlberg78<Quad, Quad, Quad, Quad,
                                                                       boost::numeric::odeint::vector_space_algebra>;
        const auto rate = [&](const Quad& x, Quad& rate_of_x, const Quad& t_s) {
            const Quad angle = w * t_s;
            const Quad s = sin(angle / 2);
            const Quad swing = 2 * one.half.sign * s * s +
                               one.half.harmonic_ratio * sin(angle + one.half.harmonic_phase_rad) * sin(angle);
            const Quad plain = one.half.rate_rad_s * t_s + one.half.amplitude_rad * swing;
            const Quad b = one.device.coupling.b_rad_s *
                           (1 + one.half.sign * Quad(one.device.coupling.turn_asymmetry) * cos(angle));
            rate_of_x = b * sin(one.phase_rad + plain + x + one.device.coupling.phase_rad);
        };
        boost::numeric::odeint::integrate_adaptive(
            boost::numeric::odeint::make_controlled<Stepper>(Quad(tolerance), Quad(tolerance)), rate, deviation,
            Quad(0), duration_s, Quad(1e-8));
        const double difference = static_cast<double>(abs(deviation - exact));
        std::printf("extended precision against odeint at %.0e: %.1e rad apart\n", tolerance, difference);
        // Some 3e4 steps and more whose errors may all have one sign.
        EXPECT_LT(difference, 1e5 * tolerance);
        EXPECT_LT(difference, last);
        last = difference;
    }
}

TEST(ReferenceIntegrators, CvodeTellsWhyItGaveUp) {
    // A tolerance far below rounding.
    const gyro::Device device(paper_device());
    const auto half = device.half_cycle(1.0, device.dither_amplitude_rad);
    Cvode cvode(device.coupling, 1e-30, 0.0);
    EXPECT_THAT(message_of<RunError>([&] { cvode.lockin_gain_rad(1.0, half); }),
                ::testing::HasSubstr("too much accuracy"));
}

}  // namespace
}  // namespace reference_integrators_test
}  // namespace ringlock::test
