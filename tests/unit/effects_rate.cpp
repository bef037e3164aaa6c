#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

std::unique_ptr<RateProcess> make(std::string_view name, const Values& values, std::uint64_t gyro = 0) {
    return find(name)->rate_process(values, {.seed = 20070301, .gyro = gyro});
}

/// Covariance of the angles gained in two consecutive intervals of unequal length, and how well it is known.
struct Moments {
    double first = 0.0;   ///< variance of the first angle
    double second = 0.0;  ///< variance of the second
    double cross = 0.0;   ///< covariance
};

constexpr double interval_a = 0.7;
constexpr double interval_b = 2.3;

Moments measure(std::string_view name, const Values& values, int pieces) {
    constexpr int gyros = 40000;
    Moments m;
    for (int g = 0; g < gyros; ++g) {
        const auto process = make(name, values, g);
        double a = 0.0;
        double b = 0.0;
        // A piece's length differs from its neighbour's, so that the transition is never the cached one.
        double t = 0.0;
        for (int i = 0; i < pieces; ++i) {
            const double dt = interval_a * 2.0 * (i + 1) / (pieces * (pieces + 1.0));
            a += process->angle_arcsec(t, dt);
            t += dt;
        }
        for (int i = 0; i < pieces; ++i) {
            const double dt = interval_b * 2.0 * (i + 1) / (pieces * (pieces + 1.0));
            b += process->angle_arcsec(t, dt);
            t += dt;
        }
        m.first += a * a / gyros;
        m.second += b * b / gyros;
        m.cross += a * b / gyros;
    }
    return m;
}

/// The variance of a variance from 40 000 gyros is 0.7 %; 4 standard deviations are allowed.
void expect_moments(const Moments& measured, const Moments& expected) {
    constexpr double tolerance = 4.0 * 0.00707;
    EXPECT_NEAR(measured.first / expected.first, 1.0, tolerance);
    EXPECT_NEAR(measured.second / expected.second, 1.0, tolerance);
    EXPECT_NEAR(measured.cross, expected.cross, tolerance * std::sqrt(expected.first * expected.second));
}

TEST(QuantumNoise, IncrementsAreWhiteWithTheStatedRandomWalk) {
    // 1 deg/sqrt(h) is 60 arcsec/sqrt(s).
    for (const int pieces : {1, 3}) {
        expect_moments(measure("quantum_noise", {{"deg_rt_h", 1.0}}, pieces),
                       {3600.0 * interval_a, 3600.0 * interval_b, 0.0});
    }
}

TEST(RateRandomWalk, AngleIsExactForConsecutiveUnequalIntervals) {
    // K = 60 (deg/h)/sqrt(h) is 1 (arcsec/s)/sqrt(s). The rate starts at zero; with a before b:
    // var a = a^3/3, cov = a^2 b/2, var b = a b^2 + b^3/3.
    const double a = interval_a;
    const double b = interval_b;
    for (const int pieces : {1, 3}) {
        expect_moments(measure("rate_random_walk", {{"deg_h_rt_h", 60.0}}, pieces),
                       {a * a * a / 3.0, a * b * b + b * b * b / 3.0, a * a * b / 2.0});
    }
}

/// The terms that the effect's equation names.
struct Flicker {
    double variance;
    std::vector<double> times_s;
    explicit Flicker(double b) : variance(b * b * std::numbers::ln10 / std::numbers::pi) {
        for (int decade = -2; decade <= 7; ++decade) times_s.push_back(std::pow(10.0, decade));
    }
    /// Variance of the angle gained in dt by the stationary sum.
    double angle_variance(double dt) const {
        double sum = 0.0;
        for (const double time : times_s) {
            const double x = dt / time;
            const double bracket = x < 1e-3 ? x * x / 2.0 - x * x * x / 6.0 : x + std::expm1(-x);
            sum += 2.0 * variance * time * time * bracket;
        }
        return sum;
    }
    /// Allan deviation from the sum's two-sided density S(f): sigma^2 = 4 int S sin^4(pi f tau)/(pi f tau)^2 df.
    double allan_from_density(double tau) const {
        constexpr double step = 1e-4;  // in ln f
        double sum = 0.0;
        for (double u = std::log(1e-9 / tau); u < std::log(200.0 / tau); u += step) {
            const double f = std::exp(u);
            double density = 0.0;
            for (const double time : times_s) {
                const double wt = 2.0 * std::numbers::pi * f * time;
                density += 2.0 * variance * time / (1.0 + wt * wt);
            }
            const double x = std::numbers::pi * f * tau;
            sum += 4.0 * density * std::pow(std::sin(x), 4) / (x * x) * f * step;
        }
        return std::sqrt(sum);
    }
};

TEST(BiasInstability, AngleIsExactForConsecutiveUnequalIntervals) {
    const Flicker flicker(1.0);
    const double a = flicker.angle_variance(interval_a);
    const double b = flicker.angle_variance(interval_b);
    const double both = flicker.angle_variance(interval_a + interval_b);
    for (const int pieces : {1, 3}) {
        expect_moments(measure("bias_instability", {{"deg_h", 1.0}}, pieces), {a, b, 0.5 * (both - a - b)});
    }
}

TEST(BiasInstability, DensityOfTheSumIsFlatInAllanDeviationOverTheStatedBand) {
    const double floor = std::sqrt(2.0 * std::numbers::ln2 / std::numbers::pi);
    const Flicker flicker(1.0);
    for (const double tau : {0.1, 0.3, 1.0, 5.0, 20.0, 1e2, 1e3, 3e3, 1e4, 1e5, 5e5, 1e6}) {
        EXPECT_NEAR(flicker.allan_from_density(tau) / floor, 1.0, 0.03) << "tau " << tau;
    }
}

TEST(BiasInstability, SimulatedAllanDeviationIsThatOfTheDensity) {
    constexpr int gyros = 400;
    constexpr int samples = 2000;
    constexpr std::array factors = {1, 10, 100};
    std::array<double, 3> variance{};
    for (int g = 0; g < gyros; ++g) {
        const auto process = make("bias_instability", {{"deg_h", 0.01}}, g);
        std::vector<double> angle(samples + 1, 0.0);
        for (int i = 0; i < samples; ++i) angle[i + 1] = angle[i] + process->angle_arcsec(i, 1.0);
        for (std::size_t k = 0; k < factors.size(); ++k) {
            const int m = factors[k];
            const int terms = samples - 2 * m + 1;
            for (int i = 0; i < terms; ++i) {
                const double d = angle[i + 2 * m] - 2.0 * angle[i + m] + angle[i];
                variance[k] += d * d / (2.0 * m * m) / terms / gyros;
            }
        }
    }
    const double floor = 0.01 * std::sqrt(2.0 * std::numbers::ln2 / std::numbers::pi);
    for (std::size_t k = 0; k < factors.size(); ++k) {
        const double measured = std::sqrt(variance[k]);
        EXPECT_NEAR(measured / Flicker(0.01).allan_from_density(factors[k]), 1.0, 0.02) << "tau " << factors[k];
        EXPECT_NEAR(measured / floor, 1.0, 0.04) << "tau " << factors[k];
    }
}

TEST(BiasInstability, SmallStepsAddUpWithoutLossOfDigits) {
    // Thousands of half cycles of 4 ms, against one interval of the same length.
    const Flicker flicker(1.0);
    constexpr int gyros = 4000;
    constexpr int steps = 250;
    double variance = 0.0;
    for (int g = 0; g < gyros; ++g) {
        const auto process = make("bias_instability", {{"deg_h", 1.0}}, g);
        double angle = 0.0;
        for (int i = 0; i < steps; ++i) angle += process->angle_arcsec(i * 0.004, 0.004);
        variance += angle * angle / gyros;
    }
    EXPECT_NEAR(variance / flicker.angle_variance(steps * 0.004), 1.0, 4.0 * std::sqrt(2.0 / gyros));
}

TEST(RateProcesses, RepeatForOneIdentityAndDifferBetweenGyros) {
    const std::vector<std::pair<std::string, Values>> random_effects = {
        {"quantum_noise", {{"deg_rt_h", 1.0}}},
        {"rate_random_walk", {{"deg_h_rt_h", 1.0}}},
        {"bias_instability", {{"deg_h", 1.0}}},
    };
    for (const auto& [name, values] : random_effects) {
        const double once = make(name, values, 3)->angle_arcsec(0.0, 1.0);
        EXPECT_EQ(once, make(name, values, 3)->angle_arcsec(0.0, 1.0)) << name;
        EXPECT_NE(once, make(name, values, 4)->angle_arcsec(0.0, 1.0)) << name;
    }
}

TEST(BiasStep, ActsFromItsTimeOnAndInPartOfTheIntervalItFallsInto) {
    const auto process = make("bias_step", {{"step_deg_h", 2.0}, {"time_s", 10.0}});
    EXPECT_EQ(process->angle_arcsec(0.0, 9.0), 0.0);
    EXPECT_DOUBLE_EQ(process->angle_arcsec(9.0, 4.0), 6.0);
    EXPECT_DOUBLE_EQ(process->angle_arcsec(13.0, 1.0), 2.0);
}

TEST(BiasRamp, GrowsWithTheSquareOfTime) {
    const auto process = make("bias_ramp", {{"deg_h_per_h", 3600.0}});  // 1 arcsec/s^2
    EXPECT_DOUBLE_EQ(process->angle_arcsec(0.0, 2.0), 2.0);
    EXPECT_DOUBLE_EQ(process->angle_arcsec(2.0, 2.0), 6.0);
}

TEST(BaseVibration, IsTheIntegralOfTheLine) {
    const double f = 37.0;
    const double phase = 0.4;
    const auto process = make("base_vibration", {{"frequency_hz", f}, {"rate_deg_h", 5.0}, {"phase_rad", phase}});
    const double w = 2.0 * std::numbers::pi * f;
    for (const auto& [start, duration] : {std::pair{0.0, 0.004}, {0.004, 0.011}, {0.015, 1.0}}) {
        const double expected = 5.0 / w * (std::cos(w * start + phase) - std::cos(w * (start + duration) + phase));
        EXPECT_NEAR(process->angle_arcsec(start, duration), expected, 1e-14);
    }
}

TEST(BaseVibration, AddsUpToTheSameAngleLateInALongRun) {
    const Values values = {{"frequency_hz", 10.0}, {"rate_deg_h", 1.0}, {"phase_rad", 0.0}};
    const auto process = make("base_vibration", values);
    // A quarter of a period: the integral is A/(2 pi f).
    EXPECT_NEAR(process->angle_arcsec(1e7, 0.025), 1.0 / (20.0 * std::numbers::pi), 1e-9);
}

}  // namespace
}  // namespace ringlock::effects
