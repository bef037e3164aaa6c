// The bound of the phase at a zero-rate point against closed forms and against a matrix from finite differences.
#include "engine/readout/phase_bound.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "engine/ensemble/draw.hpp"
#include "engine/gyro/device.hpp"
#include "engine/gyro/theory.hpp"

namespace ringlock::test {
namespace phase_bound_test {
namespace {

constexpr double quarter_rad = 0.5 * std::numbers::pi;
constexpr double acceleration_rad_s2 = 3.867e9;

readout::Electronics noisy(double rms) {
    readout::Electronics electronics;
    electronics.detector_noise_relative = electronics.comparator_noise_relative = rms;
    return electronics;
}

// Sums of 512 terms are rounded to some 1e-14 of themselves, 1e-15 rad is more.
TEST(PhaseBound, ASampleAloneHasItsOwnNoise) {
    readout::Electronics electronics = noisy(0.005);
    const readout::BoundedTurn turn{acceleration_rad_s2, 0.0, false};
    EXPECT_NEAR(readout::phase_bound_rad(electronics, turn), 0.005, 1e-15);
    electronics.adc_bits = 8;
    EXPECT_NEAR(readout::phase_bound_rad(electronics, turn), std::sqrt(0.005 * 0.005 + std::pow(2.5 / 256.0, 2) / 12.0),
                1e-15);
}

TEST(PhaseBound, EightPulsesAsGoodAsTheSampleMakeAThirdOfIt) {
    // Without hysteresis the two sides mirror each other: what says t_0 says nothing of psi_0.
    const readout::BoundedTurn turn{acceleration_rad_s2};
    EXPECT_NEAR(readout::phase_bound_rad(noisy(0.005), turn), 0.005 / 3.0, 1e-15);
    readout::Electronics unlike = noisy(0.005);
    unlike.detector_noise_relative = 0.02;
    EXPECT_NEAR(readout::phase_bound_rad(unlike, turn), 1.0 / std::sqrt(1.0 / (0.02 * 0.02) + 8.0 / (0.005 * 0.005)),
                1e-15);
    // Only where the nearest comparator does not switch are six left, and these are not quite symmetric.
    readout::Electronics hysteresis = noisy(0.005);
    hysteresis.comparator_hysteresis_relative = 0.03;
    EXPECT_NEAR(readout::phase_variance_bound_rad2(hysteresis, turn, 0.01), 0.005 * 0.005 / 7.0, 1e-4 * 0.005 * 0.005);
    EXPECT_NEAR(readout::phase_variance_bound_rad2(hysteresis, turn, 0.4), 0.005 * 0.005 / 9.0, 1e-4 * 0.005 * 0.005);
}

TEST(PhaseBound, AClockAddsASharePerTick) {
    readout::Electronics electronics = noisy(0.005);
    electronics.clock_hz = 3e6;
    const readout::BoundedTurn turn{acceleration_rad_s2};
    const double distance = 0.7;
    double information = 1.0 / (0.005 * 0.005);
    for (int pulse = 0; pulse < 4; ++pulse) {
        const double speed = std::sqrt(2.0 * acceleration_rad_s2 * (distance + quarter_rad * pulse));
        information += 2.0 / (0.005 * 0.005 + std::pow(speed / 3e6, 2) / 12.0);
    }
    EXPECT_NEAR(readout::phase_variance_bound_rad2(electronics, turn, distance) * information, 1.0, 1e-12);
}

/// The same from the times of the pulses: derivatives by differences, t_0 and psi'' as unknowns of one matrix.
double bound_from_times(const readout::Electronics& electronics, double acceleration, double rms_relative,
                        double distance) {
    constexpr std::size_t unknowns = 3;
    std::array<std::array<double, unknowns + 1>, unknowns> matrix{};
    const auto add = [&](const std::array<double, unknowns>& row, double variance) {
        for (std::size_t i = 0; i < unknowns; ++i) {
            for (std::size_t k = 0; k < unknowns; ++k) matrix[i][k] += row[i] * row[k] / variance;
        }
    };
    add({1.0, 0.0, 0.0}, std::pow(electronics.detector_noise_relative, 2));
    add({0.0, 0.0, 1.0}, rms_relative * rms_relative);
    const double h = electronics.comparator_hysteresis_relative;
    for (int side = -1; side <= 1; side += 2) {
        for (int pulse = 0; pulse < 4; ++pulse) {
            const double level = distance + quarter_rad * pulse + side * h;
            // Time of the level for psi_0, t_0 in ns and the share by which psi'' is off after the turn.
            const auto time = [&](double psi, double t0_ns, double share) {
                const double a = acceleration * (side > 0 ? 1.0 + share : 1.0);
                return 1e-9 * t0_ns + side * std::sqrt(2.0 * (level - psi) / a);
            };
            constexpr double d = 1e-4;
            const double variance_s2 =
                std::pow((time(d, 0, 0) - time(-d, 0, 0)) / (2 * d) * electronics.comparator_noise_relative, 2) +
                1.0 / (12.0 * electronics.clock_hz * electronics.clock_hz);
            add({(time(d, 0, 0) - time(-d, 0, 0)) / (2 * d), (time(0, d, 0) - time(0, -d, 0)) / (2 * d),
                 (time(0, 0, d) - time(0, 0, -d)) / (2 * d)},
                variance_s2);
        }
    }
    // Gauss and Jordan for the first column of the inverse.
    matrix[0][unknowns] = 1.0;
    for (std::size_t p = 0; p < unknowns; ++p) {
        for (std::size_t i = 0; i < unknowns; ++i) {
            if (i == p) continue;
            const double factor = matrix[i][p] / matrix[p][p];
            for (std::size_t k = 0; k <= unknowns; ++k) matrix[i][k] -= factor * matrix[p][k];
        }
    }
    return matrix[0][unknowns] / matrix[0][0];
}

TEST(PhaseBound, AnAccelerationThatIsNotKnownIsOneMoreUnknown) {
    readout::Electronics electronics = noisy(0.002);
    electronics.clock_hz = 5e6;
    electronics.comparator_hysteresis_relative = 0.03;
    for (const double rms : {1e-4, 3e-4, 1e-2, 1.0}) {
        for (const double distance : {0.2, 0.9, 1.5}) {
            const double bound = readout::phase_variance_bound_rad2(electronics, {acceleration_rad_s2, rms}, distance);
            // Differences over 1e-4 of distances of 0.17 rad and more: 1e-7.
            EXPECT_NEAR(bound / bound_from_times(electronics, acceleration_rad_s2, rms, distance), 1.0, 1e-6);
            EXPECT_GT(bound, readout::phase_variance_bound_rad2(electronics, {acceleration_rad_s2}, distance));
        }
    }
}

TEST(PhaseBound, IsNothingWithoutErrors) {
    EXPECT_EQ(readout::phase_bound_rad({}, {acceleration_rad_s2}), 0.0);
    EXPECT_EQ(readout::phase_bound_rad(noisy(0.0), {acceleration_rad_s2}), 0.0);
    readout::Electronics pulses_only = noisy(0.0);
    pulses_only.detector_noise_relative = 0.01;
    EXPECT_EQ(readout::phase_bound_rad(pulses_only, {acceleration_rad_s2}), 0.0);
}

TEST(PhaseBound, OfThePapersDevice) {
    const scenario::Scenario scenario;
    const gyro::Setup setup = ensemble::nominal_setup(scenario);
    const gyro::Device device(setup);
    readout::Electronics electronics = noisy(0.005);
    electronics.adc_bits = 12;
    electronics.clock_hz = 100e6;
    electronics.comparator_hysteresis_relative = 0.03;
    const double a = device.half_cycle(1.0, device.dither_amplitude_rad).end_acceleration_rad_s2();
    const readout::BoundedTurn turn{a};
    const double phase_rad = readout::phase_bound_rad(electronics, turn);
    std::printf("bound %.6g rad, %.6g deg/sqrt(h)\n", phase_rad, readout::walk_left_deg_rt_h(setup, phase_rad));
    EXPECT_NEAR(phase_rad, 0.00167, 1e-5);
    EXPECT_NEAR(readout::walk_left_deg_rt_h(setup, phase_rad), 3.76e-6, 0.02e-6);

    // The walk from its definition: variance of a turn's error in angle, each at its own phase, 2 f_D turns a second.
    const double kappa = gyro::turn_kick_rad(setup);
    double sum = 0.0;
    constexpr int points = 4096;
    for (int i = 0; i < points; ++i) {
        const double psi = 4.0 * quarter_rad * (i + 0.5) / points;
        const double distance = (std::floor(psi / quarter_rad) + 1.0) * quarter_rad - psi;
        sum += std::pow(kappa * std::cos(psi + 0.5 * quarter_rad), 2) *
               readout::phase_variance_bound_rad2(electronics, turn, distance) / points;
    }
    const double arcsec_rt_s =
        setup.scale_factor_arcsec / (4.0 * quarter_rad) * std::sqrt(2.0 * setup.dither_frequency_hz * sum);
    EXPECT_NEAR(readout::walk_left_deg_rt_h(setup, phase_rad), arcsec_rt_s / 60.0, 1e-4 * arcsec_rt_s / 60.0);
}

}  // namespace
}  // namespace phase_bound_test
}  // namespace ringlock::test
