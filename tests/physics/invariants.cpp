// What is known in closed form about a dithered gyro, held against both propagators.
#include <algorithm>
#include <vector>

#include "engine/propagate/circle_map.hpp"
#include "engine/propagate/half_turn.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/drive.hpp"

namespace ringlock::test {
namespace invariants_test {
namespace {

class Invariants : public ::testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(Both, Invariants, ::testing::Values(Method::turn_map, Method::direct), [](const auto& each) {
    return each.param == Method::direct ? std::string("Direct") : std::string("TurnMap");
});

gyro::Setup at_rate(double rate_deg_h) {
    gyro::Setup setup = paper_device();
    setup.input_rate_deg_h = rate_deg_h;
    return setup;
}

/// Edge [deg/h] between a locked rate and one that is not, by bisection.
double edge_deg_h(Method method, gyro::Setup setup, double locked, double free) {
    for (int i = 0; i < 12; ++i) {
        setup.input_rate_deg_h = 0.5 * (locked + free);
        (cycle_map(method, setup).locked() ? locked : free) = setup.input_rate_deg_h;
    }
    return 0.5 * (locked + free);
}

TEST_P(Invariants, WithoutDitherTheMeanRateIsAdlers) {
    const double b = 3769.9;
    for (const double ratio : {0.2, 0.99, 1.01, 1.5, 4.0, -2.0}) {
        const double rate = ratio * b;
        const gyro::HalfCycle half{1.0, 0.0, 0.05, rate};
        std::unique_ptr<Propagator> propagator;
        if (GetParam() == Method::direct) {
            propagator = std::make_unique<DirectIntegrator>(gyro::Coupling{b, 0.4}, 1e-12);
        } else {
            gyro::Device device(paper_device());
            device.coupling = {b, 0.4};
            propagator = std::make_unique<TurnMap>(device, ranges(device, 0.0), 1e-10);
        }
        Phase phase(0.3);
        const int intervals = 40;
        double total = 0.0;
        for (int i = 0; i < intervals; ++i) {
            const double gain = rate * half.duration_s + propagator->lockin_gain_rad(phase.remainder_rad, half);
            phase.add(gain);
            total += gain;
        }
        const double mean = total / (intervals * half.duration_s);
        // A finite time leaves less than a fringe.
        EXPECT_NEAR(mean, gyro::adler_rate_deg_h(rate, b), units::two_pi / (intervals * half.duration_s)) << ratio;
        if (std::abs(ratio) < 1.0) {
            EXPECT_LT(std::abs(total), units::two_pi);
        }
    }
}

TEST_P(Invariants, BandsHaveBesselHalfWidths) {
    const gyro::Setup setup = paper_device();
    EXPECT_NEAR(gyro::band_half_width_deg_h(setup, 0), 2.632, 5e-4);
    EXPECT_NEAR(gyro::band_half_width_deg_h(setup, 1), 1.472, 5e-4);
    EXPECT_NEAR(gyro::band_centre_deg_h(setup, 1), 62.34, 5e-3);
    // To first order in Omega_L these are the bands; to second order each half cycle is shorter by two half turns'
    // delay, which moves M by 0.0105 rad and the edges by 0.5 % and 2 %. Third order, kappa^2/16 = 0.14 %, is left out.
    gyro::Setup shortened = setup;
    shortened.dither_peak_rate_deg_s *= 1.0 - gyro::half_turn_delay_rad(setup) / gyro::modulation_depth_rad(setup);
    const double dead_band = edge_deg_h(GetParam(), setup, 0.0, 5.0);
    EXPECT_NEAR(dead_band, 2.632, 0.006 * 2.632);
    EXPECT_NEAR(dead_band, gyro::band_half_width_deg_h(shortened, 0), 0.004);
    const double centre = gyro::band_centre_deg_h(setup, 1);
    const double upper = edge_deg_h(GetParam(), setup, centre + 0.1, centre + 4.0);
    const double lower = edge_deg_h(GetParam(), setup, centre + 0.1, centre - 4.0);
    EXPECT_NEAR(0.5 * (upper - lower), 1.472, 0.02 * 1.472);
    EXPECT_NEAR(0.5 * (upper - lower), gyro::band_half_width_deg_h(shortened, 1), 0.004);
    EXPECT_NEAR(0.5 * (upper + lower), centre, 0.1);
}

TEST_P(Invariants, TheDeadBandSwingsWithTheAmplitudeUpToItsEnvelope) {
    // 1e-4 of the amplitude moves M by 0.63 rad: M = 2005.3 pi; J_0 vanishes and peaks a few steps away.
    gyro::Setup setup = paper_device();
    const double depth = gyro::modulation_depth_rad(setup);
    EXPECT_NEAR(1e-4 * depth, 0.63, 0.001);
    const double at_peak = units::pi * (std::floor(depth / units::pi) + 0.25);
    for (const double wanted : {at_peak, at_peak + 0.5 * units::pi}) {
        setup.dither_peak_rate_deg_s = 109.1 * wanted / depth;
        const double theory = gyro::band_half_width_deg_h(setup, 0);
        EXPECT_NEAR(theory, wanted == at_peak ? gyro::band_envelope_deg_h(setup) : 0.0, 2e-3);
        // Where J_0 vanishes a second-order band of some 0.01 deg/h stays.
        EXPECT_NEAR(edge_deg_h(GetParam(), setup, 0.0, 5.0), theory, 0.03);
    }
    EXPECT_NEAR(gyro::band_envelope_deg_h(paper_device()), 3.016, 5e-4);
}

TEST_P(Invariants, BetweenBandsABiasStays) {
    const gyro::Setup setup = at_rate(15.0);
    const CircleMap map = cycle_map(GetParam(), setup);
    const gyro::Device device(setup);
    // The rotation number is known modulo a fringe a cycle; the input's 1.51 rad a cycle is less than that.
    const double out_deg_h = map.rotation_rad() / device.period_s() / device.phase_per_arcsec;
    EXPECT_NEAR(out_deg_h - 15.0, -0.21, 0.005);
}

TEST_P(Invariants, AHalfCycleCarriesAConstantThatAWholeOneDoesNot) {
    const gyro::Device device(paper_device());
    const auto propagator = make_propagator(GetParam(), device, 4.0);
    const auto up = device.half_cycle(1.0, device.dither_amplitude_rad);
    // Averaged over the phase at the first turn and over a fringe of the swing in between.
    double mean = 0.0;
    const int n = 8;
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
            auto half = up;
            half.amplitude_rad += units::pi * j / n;
            mean += propagator->lockin_gain_rad(units::two_pi * i / n, half) / (n * n);
        }
    }
    EXPECT_NEAR(mean, -2.0 * gyro::half_turn_delay_rad(paper_device()), 0.003 * std::abs(mean));
    const CircleMap cycle = cycle_map(GetParam(), paper_device());
    EXPECT_LT(std::abs(cycle.shift_rad), 0.1 * std::abs(mean));
}

TEST(Invariants, AWholeTurnHasTheLandauZenerModulus) {
    const gyro::Device device(paper_device());
    const auto half = device.half_cycle(1.0, device.dither_amplitude_rad);
    const double theory = gyro::turn_map_modulus(device.coupling.b_rad_s, half.end_acceleration_rad_s2());
    EXPECT_NEAR(theory, 1.00289107, 5e-9);
    const auto turn = propagate::exact_half_turn(half, device.coupling.b_rad_s);
    // From the middle of the half cycle before (negative, seen upright) to the middle of the one after.
    const CircleMap map = circle_map([&](double u) {
        // Before a minimum the half cycle runs downwards: upright psi -> -psi, so the last phase is -(u' - ...).
        const double x = -u;
        const double psi = -(x - propagate::twice_arg(turn.z, x));
        return psi - u + propagate::twice_arg(turn.z, -psi);
    });
    EXPECT_NEAR(1.0 / std::sqrt(1.0 - std::norm(map.z)), theory, 1e-9);
    // Twice |z| is the kick to first order, kappa, and kappa (1 - kappa^2/16) to second.
    const double kappa = gyro::turn_kick_rad(paper_device());
    EXPECT_NEAR(2.0 * std::abs(map.z), kappa * (1.0 - kappa * kappa / 16.0), 1e-5 * kappa);
}

/// Distance [rad] of two gyros that differ in their initial phase only, after some turns of the same noisy dither.
double distance_after(Method method, int turns) {
    const gyro::Device device(paper_device());
    const auto propagator = make_propagator(method, device, 20.0);
    std::array<double, 2> lockin{0.0, 0.0};
    const std::array<double, 2> start{0.0, 2.0};
    Drive drive(device, 3.0, {5, 0});
    for (int turn = 0; turn < turns; ++turn) {
        const auto half = drive.after();
        for (std::size_t i = 0; i < 2; ++i) {
            Phase phase(start[i] + lockin[i]);
            phase.add(drive.turn_phase_rad());
            lockin[i] += propagator->lockin_gain_rad(phase.remainder_rad, half);
        }
        drive.advance();
    }
    return std::abs(std::remainder(start[0] + lockin[0] - start[1] - lockin[1], units::two_pi));
}

TEST(Invariants, GyrosUnderTheSameNoiseSynchronise) { EXPECT_LT(distance_after(Method::turn_map, 6000), 1e-9); }
TEST(LongInvariants, GyrosUnderTheSameNoiseSynchroniseDirect) { EXPECT_LT(distance_after(Method::direct, 6000), 1e-9); }

/// Distances between the two propagators on the way through the same noisy drive.
struct Apart {
    double median_rad;
    double largest_rad;
};

Apart propagators_apart(int turns) {
    gyro::Setup setup = at_rate(15.0);
    setup.dither_asymmetry_ratio = 0.01;
    const gyro::Device device(setup);
    const auto map = make_propagator(Method::turn_map, device, 20.0);
    const auto direct = make_propagator(Method::direct, device, 0.0, 1e-12);
    Drive drive(device, 3.0, {6, 1});
    Phase input;
    double a = 0.0;
    double b = 0.0;
    std::vector<double> distances;
    for (int turn = 0; turn < turns; ++turn) {
        const auto half = drive.after();
        Phase phase = input + drive.turn_phase_rad();
        a += map->lockin_gain_rad((phase + a).remainder_rad, half);
        b += direct->lockin_gain_rad((phase + b).remainder_rad, half);
        distances.push_back(std::abs(a - b));
        input.add(half.rate_rad_s * half.duration_s);
        drive.advance();
    }
    std::sort(distances.begin(), distances.end());
    return {distances[distances.size() / 2], distances.back()};
}

// What needs millions of turns (random walk, synchronisation, randomisation) is measured on the turn map. It holds for
// the direct integrator, too, since both follow the same noisy drive for any time without drifting apart.
//
// A turn multiplies a distance by 1 + kappa cos(phase): it shrinks by kappa^2/4 on average, but the spread of the
// factor, kappa^2/2, gives it a tail that falls like 1/distance. The median stays at some turns' errors of 1e-11 rad;
// the largest grows with the number of independent stretches, n kappa^2/4.
void expect_together(int turns) {
    const Apart apart = propagators_apart(turns);
    const double kappa = gyro::turn_kick_rad(paper_device());
    constexpr double typical_rad = 1e-9;
    EXPECT_LT(apart.median_rad, typical_rad);
    EXPECT_LT(apart.largest_rad, typical_rad * std::max(1.0, turns * kappa * kappa / 4.0));
}

TEST(Invariants, PropagatorsStayTogetherThroughANoisyDrive) { expect_together(600); }
TEST(LongInvariants, PropagatorsStayTogetherThroughALongNoisyDrive) { expect_together(20000); }

}  // namespace
}  // namespace invariants_test
}  // namespace ringlock::test
