// The two ways to solve the equation of motion against each other and against an integrator that is not ours.
#include <boost/numeric/odeint/integrate/integrate_adaptive.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cstdio>

#include "engine/core/error.hpp"
#include "engine/propagate/half_turn.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/odeint.hpp"

namespace ringlock::test {
namespace propagators_test {
namespace {

/// Worst difference [rad] between turn map and direct integrator over random half cycles: +-5 % of amplitude,
/// +-`rate_deg_h`, +-5 % asymmetry, any coupling phase.
double worst_difference(int half_cycles, double rate_deg_h, std::uint64_t seed) {
    Uniform uniform(seed);
    double worst = 0.0;
    for (int i = 0; i < half_cycles; ++i) {
        gyro::Setup setup = paper_device();
        setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
        setup.input_rate_deg_h = uniform(-rate_deg_h, rate_deg_h);
        setup.coupling_phase_rad = uniform(-3.0, 3.0);
        const gyro::Device device(setup);
        const auto direct = make_propagator(Method::direct, device, 0.0, 1e-12);
        const auto map = make_propagator(Method::turn_map, device, 0.05 * device.dither_amplitude_rad, 1e-10);
        const auto half = device.half_cycle(i % 2 == 0 ? 1.0 : -1.0, device.dither_amplitude_rad * uniform(0.95, 1.05));
        const double phase = uniform(-3.14, 3.14);
        worst = std::max(worst, std::abs(direct->lockin_gain_rad(phase, half) - map->lockin_gain_rad(phase, half)));
    }
    std::printf("worst of %d half cycles, +-%.0f deg/h: %.1e rad\n", half_cycles, rate_deg_h, worst);
    return worst;
}

TEST(Propagators, TurnMapAgreesWithDirectIntegratorTo1e8RadATurn) {
    // A turn is two half turns, as a half cycle is.
    EXPECT_LT(worst_difference(60, 500.0, 11), 1e-8);
    EXPECT_LT(worst_difference(60, 50000.0, 12), 1e-8);
}

TEST(Propagators, StrongCouplingKeepsItsWholeFringes) {
    // From some 7000 deg/h on, half a turn is late by more than half a fringe.
    for (const double threshold_deg_h : {6000.0, 8000.0, 20000.0, 50000.0}) {
        for (const double rate_deg_h : {0.0, 15.0, -40000.0}) {
            gyro::Setup setup = paper_device();
            setup.lockin_threshold_deg_h = threshold_deg_h;
            setup.input_rate_deg_h = rate_deg_h;
            const gyro::Device device(setup);
            const auto direct = make_propagator(Method::direct, device, 0.0, 1e-12);
            const auto map = make_propagator(Method::turn_map, device);
            for (const double sign : {1.0, -1.0}) {
                const auto half = device.half_cycle(sign, device.dither_amplitude_rad);
                EXPECT_NEAR(map->lockin_gain_rad(0.7, half), direct->lockin_gain_rad(0.7, half), 1e-8)
                    << threshold_deg_h << " at " << rate_deg_h << " deg/h, sign " << sign;
            }
        }
    }
}

TEST(LongPropagators, TurnMapAgreesWithDirectIntegratorOverTenThousandTurns) {
    EXPECT_LT(worst_difference(10000, 50000.0, 13), 1e-9);
}

TEST(Propagators, DirectIntegratorAgreesWithAnIndependentIntegrator) {
    // Others, and one in extended precision, are in reference_integrators.cpp.
    Uniform uniform(21);
    for (int i = 0; i < 8; ++i) {
        gyro::Setup setup = paper_device();
        setup.input_rate_deg_h = uniform(-1000.0, 1000.0);
        setup.coupling_phase_rad = uniform(-3.0, 3.0);
        const gyro::Device device(setup);
        const auto half = device.half_cycle(i % 2 == 0 ? 1.0 : -1.0, device.dither_amplitude_rad);
        const double phase = uniform(-3.0, 3.0);
        // Its errors of 1e-14 in each of 1e4 steps and more add up to some 1e-10 rad, with little regularity.
        Odeint odeint(device.coupling, 1e-14);
        DirectIntegrator direct(device.coupling, 1e-13);
        EXPECT_NEAR(direct.lockin_gain_rad(phase, half), odeint.lockin_gain_rad(phase, half), 1e-9);
    }
}

TEST(Propagators, TheErrorIsTheIntegralOfTheSineOfTheMeasuredPhase) {
    // error(t) = b int sin(psi) dt: the phase itself is integrated, by Boost.odeint, and the integral kept beside it.
    Uniform uniform(22);
    for (int i = 0; i < 4; ++i) {
        gyro::Setup setup = paper_device();
        setup.input_rate_deg_h = uniform(-1000.0, 1000.0);
        const gyro::Device device(setup);
        const auto half = device.half_cycle(i % 2 == 0 ? 1.0 : -1.0, device.dither_amplitude_rad);
        using State = std::array<double, 2>;
        State state{uniform(-3.0, 3.0), 0.0};
        const double start = state[0];
        using Stepper = boost::numeric::odeint::runge_kutta_fehlberg78<State>;
        boost::numeric::odeint::integrate_adaptive(
            boost::numeric::odeint::make_controlled<Stepper>(1e-13, 1e-13),
            [&](const State& x, State& rate, double t) {
                rate[1] = device.coupling.b_rad_s * std::sin(x[0]);
                rate[0] = half.drive_rate_rad_s(t) + rate[1];
            },
            state, 0.0, half.duration_s, 1e-8);
        for (const Method method : {Method::turn_map, Method::direct}) {
            EXPECT_NEAR(make_propagator(method, device)->lockin_gain_rad(start, half), state[1], 1e-7);
        }
    }
}

TEST(Propagators, DirectIntegratorKeepsItsTolerance) {
    const gyro::Device device(paper_device());
    const auto half = device.half_cycle(1.0, device.dither_amplitude_rad);
    for (const double phase : {-2.0, 0.3, 2.5}) {
        DirectIntegrator fine(device.coupling, 1e-14);
        const double exact = fine.lockin_gain_rad(phase, half);
        for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10}) {
            DirectIntegrator coarse(device.coupling, tolerance);
            EXPECT_NEAR(coarse.lockin_gain_rad(phase, half), exact, tolerance);
            EXPECT_LT(coarse.steps(), fine.steps());
        }
    }
}

TEST(Propagators, TurnMapOutsideItsTableIsExactAndCounted) {
    const gyro::Device device(paper_device());
    const double a = device.dither_amplitude_rad;
    TurnMap map(device, ranges(device, 5.0), 1e-10);
    const auto half = device.half_cycle(1.0, 1.2 * a);
    DirectIntegrator direct(device.coupling, 1e-12);
    EXPECT_EQ(map.outside(), 0);
    EXPECT_NEAR(map.lockin_gain_rad(1.0, half), direct.lockin_gain_rad(1.0, half), 1e-9);
    EXPECT_EQ(map.outside(), 1);
}

TEST(Propagators, TurnMapMeasuresTheErrorOfItsTables) {
    const gyro::Device device(paper_device());
    const double a = device.dither_amplitude_rad;
    for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
        const TurnMap map(device, ranges(device, 0.05 * a), tolerance);
        EXPECT_LE(map.measured_error_rad(), tolerance);
        EXPECT_GT(map.measured_error_rad(), 0.0);
    }
}

TEST(Propagators, TurnMapRefusesADitherWithTooFewFringes) {
    gyro::Setup setup = paper_device();
    setup.dither_peak_rate_deg_s = 0.1;  // 1.8 fringes a half cycle
    const gyro::Device device(setup);
    EXPECT_THROW(make_propagator(Method::turn_map, device), RunError);
}

}  // namespace
}  // namespace propagators_test
}  // namespace ringlock::test
