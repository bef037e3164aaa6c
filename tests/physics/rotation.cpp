// Mean rates from the map of one cycle, against simulation, theory and the map found by sampling.
#include "engine/propagate/rotation.hpp"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "engine/core/error.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace rotation_test {
namespace {

gyro::Setup at_rate(double rate_deg_h, double threshold_deg_h = 300.0) {
    gyro::Setup setup = paper_device();
    setup.lockin_threshold_deg_h = threshold_deg_h;
    setup.input_rate_deg_h = rate_deg_h;
    return setup;
}

/// Any gyro near the paper's, at up to +-`rate_deg_h`.
gyro::Setup random_setup(Uniform& uniform, double rate_deg_h) {
    gyro::Setup setup = at_rate(uniform(-rate_deg_h, rate_deg_h), uniform(50.0, 1500.0));
    setup.dither_peak_rate_deg_s *= uniform(0.95, 1.05);
    setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
    setup.coupling_phase_rad = uniform(-3.0, 3.0);
    return setup;
}

double error_deg_h(const gyro::Setup& setup) {
    const gyro::Device device(setup);
    return propagate::mean_rate_error_deg_h(propagate::exact_cycle(device), device);
}

double output_deg_h(const gyro::Setup& setup) { return setup.input_rate_deg_h + error_deg_h(setup); }

bool locked(const gyro::Setup& setup) { return propagate::exact_cycle(gyro::Device(setup)).locked(); }

/// Edge [deg/h] between a locked rate and one that is not, to the last bit.
double edge_deg_h(gyro::Setup setup, double locked_deg_h, double free_deg_h) {
    for (int i = 0; i < 60; ++i) {
        setup.input_rate_deg_h = 0.5 * (locked_deg_h + free_deg_h);
        (locked(setup) ? locked_deg_h : free_deg_h) = setup.input_rate_deg_h;
    }
    return free_deg_h;
}

/// Lock-in phase [rad] that a simulation gains in so many cycles.
double simulated_gain_rad(Method method, const gyro::Setup& setup, int cycles, double phase_rad) {
    const gyro::Device device(setup);
    const auto propagator = make_propagator(method, device);
    Phase phase(phase_rad);
    double gain = 0.0;
    for (int turn = 0; turn < 2 * cycles; ++turn) {
        const auto half = device.half_cycle(turn % 2 == 0 ? 1.0 : -1.0, device.dither_amplitude_rad);
        const double step = propagator->lockin_gain_rad(phase.remainder_rad, half);
        gain += step;
        phase.add(half.plain_phase_total_rad());
        phase.add(step);
    }
    return gain;
}

TEST(Rotation, TheMatrixIsInSU11AndItsProductIsThatOfTheMaps) {
    Uniform uniform(31);
    for (int i = 0; i < 30; ++i) {
        const gyro::Device device(random_setup(uniform, 50000.0));
        const auto up =
            propagate::exact_half_cycle(device.half_cycle(1.0, device.dither_amplitude_rad), device.coupling);
        const auto down =
            propagate::exact_half_cycle(device.half_cycle(-1.0, device.dither_amplitude_rad), device.coupling);
        const auto cycle = propagate::exact_cycle(device);
        for (const auto& map : {up, down, cycle}) {
            EXPECT_NEAR(std::norm(map.alpha()) - std::norm(map.beta()), 1.0, 1e-13 * std::norm(map.alpha()));
        }
        // Signs included; 12 600 rad of swing round to 2e-12.
        const auto alpha = down.alpha() * up.alpha() + down.beta() * std::conj(up.beta());
        const auto beta = down.alpha() * up.beta() + down.beta() * std::conj(up.alpha());
        EXPECT_LT(std::abs(alpha - cycle.alpha()), 1e-11) << i;
        EXPECT_LT(std::abs(beta - cycle.beta()), 1e-11) << i;
        EXPECT_NEAR(cycle.trace(), 2.0 * alpha.real(), 2e-11);
        EXPECT_EQ(cycle.locked(), std::abs(cycle.trace()) >= 2.0) << "none of these is at an edge";
    }
}

TEST(Rotation, TheMapIsTheOneFoundBySampling) {
    Uniform uniform(32);
    for (const Method method : {Method::turn_map, Method::direct}) {
        for (int i = 0; i < (method == Method::direct ? 3 : 30); ++i) {
            gyro::Setup setup = random_setup(uniform, 200.0);
            setup.lockin_threshold_deg_h *= 0.3;  // sampling at 16 phases leaves |z|^16
            const gyro::Device device(setup);
            const auto exact = propagate::exact_cycle(device);
            const CircleMap sampled = cycle_map(method, setup);
            EXPECT_NEAR(exact.plain_rad + exact.shift_rad, sampled.shift_rad, 1e-9);
            EXPECT_LT(std::abs(exact.z - sampled.z), 1e-9);
            EXPECT_EQ(exact.locked(), sampled.locked());
            const double rotation = exact.plain_rad + exact.rotation_beyond_plain_rad();
            EXPECT_NEAR(std::remainder(rotation - sampled.rotation_rad(), units::two_pi), 0.0, 1e-7) << i;
        }
    }
}

TEST(Rotation, TheLiftIsThatOfTheUnwrappedPhase) {
    // One application, at rates of hundreds of fringes a cycle and with coupling that delays by whole fringes: the
    // gain beyond the plain phase is the integrator's, not merely modulo a fringe.
    Uniform uniform(33);
    for (int i = 0; i < 12; ++i) {
        gyro::Setup setup = random_setup(uniform, 50000.0);
        if (i % 2 == 0) setup.lockin_threshold_deg_h = uniform(1000.0, 12000.0);
        const auto cycle = propagate::exact_cycle(gyro::Device(setup));
        const double phase = uniform(-3.0, 3.0);
        EXPECT_NEAR(cycle.gain_rad(phase), simulated_gain_rad(Method::direct, setup, 1, phase), 1e-7)
            << setup.lockin_threshold_deg_h << " at " << setup.input_rate_deg_h;
        EXPECT_LT(std::abs(cycle.gain_rad(phase) - cycle.shift_rad), units::pi);
        EXPECT_LT(std::abs(cycle.rotation_beyond_plain_rad() - cycle.shift_rad), units::pi);
    }
}

TEST(LongRotation, ALongSimulationStaysWithinAFringe) {
    // |F^N(psi) - psi - N rho| < 2 pi for any map of the circle that keeps order, N as large as one likes.
    constexpr int cycles = 15'000;
    std::vector<double> rates = {0.0, 1.0, 2.6, 2.64, 2.65, 2.7, 15.0, 40.0, 59.0, 200.0, 5000.0, 50000.0};
    for (const int n : {1, 2}) {
        const double centre = gyro::band_centre_deg_h(paper_device(), n);
        for (const double off : {-2.8, -1.6, -1.3, 0.0, 1.3, 1.6, 2.8}) rates.push_back(centre + off);
    }
    double worst = 0.0;
    for (const double rate : rates) {
        for (const double sign : {1.0, -1.0}) {
            for (const double asymmetry : {0.0, 0.03}) {
                gyro::Setup setup = at_rate(sign * rate);
                setup.dither_asymmetry_ratio = asymmetry;
                setup.coupling_phase_rad = 0.4;
                const auto cycle = propagate::exact_cycle(gyro::Device(setup));
                const double gain = simulated_gain_rad(Method::turn_map, setup, cycles, 0.3);
                const double apart = std::abs(gain - cycles * cycle.rotation_beyond_plain_rad());
                // The map's own error, 1e-12 rad a turn, adds some 1e-7 rad.
                EXPECT_LT(apart, units::two_pi) << sign * rate << " deg/h, asymmetry " << asymmetry;
                worst = std::max(worst, apart);
            }
        }
    }
    std::printf("worst of %zu rates: %.2f rad after %d cycles, %.1e deg/h\n", 4 * rates.size(), worst, cycles,
                worst / units::two_pi * gyro::band_centre_deg_h(paper_device(), 1) / cycles);
}

TEST(Rotation, TheDirectIntegratorAgrees) {
    // Few cycles are enough to see a fringe a cycle.
    for (const double rate : {1.0, 15.0, 62.0, 125.0, -50000.0}) {
        const auto cycle = propagate::exact_cycle(gyro::Device(at_rate(rate)));
        const double gain = simulated_gain_rad(Method::direct, at_rate(rate), 10, 0.3);
        EXPECT_LT(std::abs(gain - 10 * cycle.rotation_beyond_plain_rad()), units::two_pi) << rate;
    }
}

TEST(Rotation, BandsHaveBesselHalfWidthsAndWholeFringesInside) {
    gyro::Setup shortened = paper_device();
    shortened.dither_peak_rate_deg_s *=
        1.0 - gyro::half_turn_delay_rad(paper_device()) / gyro::modulation_depth_rad(paper_device());
    for (const int n : {0, 1, 2, -1, -2}) {
        const double centre = gyro::band_centre_deg_h(paper_device(), n);
        const double upper = edge_deg_h(paper_device(), centre, centre + 4.0);
        const double lower = edge_deg_h(paper_device(), centre, centre - 4.0);
        // Second order in both; third order, kappa^2/16 = 0.14 %, is left out.
        EXPECT_NEAR(0.5 * (upper - lower), gyro::band_half_width_deg_h(shortened, n), 0.004) << n;
        EXPECT_NEAR(0.5 * (upper + lower), centre, 0.1) << n;
        for (const double part : {0.01, 0.5, 0.99}) {
            const gyro::Setup setup = at_rate(lower + part * (upper - lower));
            EXPECT_TRUE(locked(setup));
            EXPECT_EQ(propagate::exact_cycle(gyro::Device(setup)).fringes(), n);
            EXPECT_NEAR(output_deg_h(setup), centre, 1e-9) << n;
        }
        EXPECT_GT(output_deg_h(at_rate(upper + 0.01)), centre);
        EXPECT_LT(output_deg_h(at_rate(lower - 0.01)), centre);
    }
}

TEST(Rotation, ANarrowBandIsAdlers) {
    // At a tenth of the paper's threshold bands are too narrow for others to pull at them: what is left out is of the
    // order of the square of the distance over the 62 deg/h between bands, 1e-3 of the distance.
    const gyro::Setup device = at_rate(0.0, 30.0);
    for (const int n : {0, 1, 2}) {
        const double half_width = gyro::band_half_width_deg_h(device, n);
        const double step = gyro::band_centre_deg_h(device, n);
        const double above = edge_deg_h(device, step, step + 2.0);
        const double centre = 0.5 * (above + edge_deg_h(device, step, step - 2.0));
        for (const double times : {-5.0, -2.0, -1.1, -0.9, 0.0, 0.9, 1.1, 2.0, 5.0}) {
            const double off = times * half_width;
            const double adler = gyro::adler_rate_deg_h(off, half_width);
            EXPECT_NEAR(output_deg_h(at_rate(centre + off, 30.0)) - step, adler,
                        2e-3 * half_width + 1e-3 * std::abs(off))
                << n << " at " << times << " half-widths";
        }
    }
}

TEST(Rotation, AtABandsEdgeTheRateGoesWithTheRootOfTheDistance) {
    // Down to 1e-9 of a band, which a difference of traces would not resolve.
    for (const double centre : {0.0, gyro::band_centre_deg_h(paper_device(), 1)}) {
        const double edge = edge_deg_h(paper_device(), centre, centre + 4.0);
        const auto slope = [&](double distance_deg_h) {
            return std::pow(output_deg_h(at_rate(edge + distance_deg_h)) - centre, 2) / distance_deg_h;
        };
        const double expected = slope(1e-5);
        for (const double distance : {1e-4, 1e-6, 1e-7, 1e-8}) {
            // Steps of a rate of 62 deg/h are 7e-15: the distance itself is known to 1e-6.
            EXPECT_NEAR(slope(distance) / expected, 1.0, distance > 5e-5 ? 1e-3 : 1e-4) << distance;
        }
    }
}

TEST(Rotation, TheOppositeRateGivesTheOppositeError) {
    Uniform uniform(34);
    for (int i = 0; i < 60; ++i) {
        const gyro::Setup setup = random_setup(uniform, i < 30 ? 150.0 : 50000.0);
        gyro::Setup mirror = setup;  // psi -> -psi exchanges the half cycles
        mirror.input_rate_deg_h *= -1.0;
        mirror.dither_asymmetry_ratio *= -1.0;
        mirror.coupling_phase_rad = uniform(-3.0, 3.0);  // means nothing for a mean rate
        EXPECT_NEAR(error_deg_h(mirror), -error_deg_h(setup), 1e-8) << i;
    }
}

TEST(Rotation, TheOutputNeverFallsAsTheInputRises) {
    Uniform uniform(35);
    for (int i = 0; i < 12; ++i) {
        gyro::Setup setup = random_setup(uniform, 0.0);
        if (i % 4 == 0) setup.lockin_threshold_deg_h = uniform(2000.0, 20000.0);
        const double middle = i % 3 == 0 ? uniform(-50000.0, 50000.0) : 0.0;
        std::vector<double> rates;
        for (int k = 0; k < 200; ++k) rates.push_back(middle + uniform(-150.0, 150.0));
        std::sort(rates.begin(), rates.end());
        double before = -1e300;
        for (const double rate : rates) {
            setup.input_rate_deg_h = rate;
            const double out = output_deg_h(setup);
            EXPECT_GE(out, before - 1e-8) << i << " at " << rate;  // on a step it stays where it is, to rounding
            before = out;
        }
    }
}

TEST(Rotation, LockedGyrosDrawTogetherByTheContraction) {
    for (const double rate : {0.0, 2.0, 62.0}) {
        const auto cycle = propagate::exact_cycle(gyro::Device(at_rate(rate)));
        ASSERT_TRUE(cycle.locked());
        EXPECT_LT(cycle.contraction(), 1.0);
        // From the attracting point and 1e-5 rad beside it; the slope varies by as much in between.
        const double rest =
            simulated_gain_rad(Method::turn_map, at_rate(rate), 2000, 0.3) + 0.3 + 2000 * cycle.plain_rad;
        constexpr double beside = 1e-5;
        constexpr int cycles = 8;
        const double here = simulated_gain_rad(Method::turn_map, at_rate(rate), cycles, rest);
        const double there = simulated_gain_rad(Method::turn_map, at_rate(rate), cycles, rest + beside);
        EXPECT_NEAR((there + beside - here) / beside / std::pow(cycle.contraction(), cycles), 1.0, 1e-3) << rate;
    }
    EXPECT_EQ(propagate::exact_cycle(gyro::Device(at_rate(15.0))).contraction(), 1.0);
}

TEST(Rotation, WithoutLockInTheOutputIsTheInput) {
    for (const double rate : {0.0, 15.0, gyro::band_centre_deg_h(paper_device(), 1), -50000.0}) {
        EXPECT_NEAR(error_deg_h(at_rate(rate, 0.0)), 0.0, 1e-10) << rate;
    }
}

TEST(Rotation, WhatHasNoFastMiddleIsRefused) {
    EXPECT_TRUE(propagate::has_exact_cycle(gyro::Device(paper_device())));
    for (const double peak_deg_s : {0.0, 0.1}) {
        gyro::Setup setup = paper_device();
        setup.dither_peak_rate_deg_s = peak_deg_s;
        EXPECT_FALSE(propagate::has_exact_cycle(gyro::Device(setup)));
        EXPECT_THROW(propagate::exact_cycle(gyro::Device(setup)), RunError);
    }
    // With a harmonic of the dither only one half of a half cycle may have none.
    for (const double phase_rad : {0.0, 0.8, 1.6, -0.8, -2.3, 3.0}) {
        for (const double peak_deg_s : {0.2, 0.3, 0.4, 0.6, 1.0, 2.0}) {
            gyro::Setup setup = at_rate(15.0);
            setup.dither_peak_rate_deg_s = peak_deg_s;
            setup.dither_harmonic_ratio = 0.3;
            setup.dither_harmonic_phase_rad = phase_rad;
            const gyro::Device device(setup);
            bool formed = true;
            try {
                propagate::exact_cycle(device);
            } catch (const RunError&) {
                formed = false;
            }
            EXPECT_EQ(propagate::has_exact_cycle(device), formed) << phase_rad << " rad, " << peak_deg_s << " deg/s";
        }
    }
    // The dither must reverse the input.
    EXPECT_FALSE(propagate::has_exact_cycle(gyro::Device(at_rate(-110.0 * units::deg_h_per_deg_s))));
}

}  // namespace
}  // namespace rotation_test
}  // namespace ringlock::test
