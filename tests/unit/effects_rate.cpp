#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace effects_rate_test {
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

/// Angles of two consecutive intervals as the effect describes its rate: the variance of their sum gives the
/// covariance.
Moments described(std::string_view name, const Values& values) {
    const RateNoise noise = find(name)->rate_noise(values);
    const double first = angle_variance_arcsec2(noise, interval_a);
    const double both = angle_variance_arcsec2(noise, interval_a + interval_b);
    // A random walk has gone a W(a) on when the second begins; the others are stationary.
    const double walked = noise.walk_deg2_h2_per_s * interval_a * interval_b * interval_b;
    const double second = angle_variance_arcsec2(noise, interval_b) + walked;
    return {first, second, 0.5 * (both - first - second)};
}

TEST(RateNoise, DescribesTheRateThatTheProcessDraws) {
    const std::vector<std::pair<std::string, Values>> random_effects = {
        {"quantum_noise", {{"deg_rt_h", 0.7}}},
        {"rate_random_walk", {{"deg_h_rt_h", 42.0}}},
        {"bias_instability", {{"deg_h", 0.3}}},
    };
    for (const auto& [name, values] : random_effects) {
        SCOPED_TRACE(name);
        expect_moments(measure(name, values, 2), described(name, values));
    }
}

TEST(RateNoise, IsInTheUnitsOfTheCoefficients) {
    // 0.0022506 deg/sqrt(h) is 0.13504 arcsec/sqrt(s); a rate walk of 1 deg/h in an hour.
    EXPECT_NEAR(find("quantum_noise")->rate_noise({{"deg_rt_h", 0.13504 / 60.0}}).white_deg2_h2_s, 0.13504 * 0.13504,
                1e-16);
    EXPECT_NEAR(find("rate_random_walk")->rate_noise({{"deg_h_rt_h", 1.0}}).walk_deg2_h2_per_s * 3600.0, 1.0, 1e-15);
    const RateNoise flicker = find("bias_instability")->rate_noise({{"deg_h", 2.0}});
    const Flicker expected(2.0);
    ASSERT_EQ(flicker.terms.size(), expected.times_s.size());
    for (std::size_t i = 0; i < flicker.terms.size(); ++i) {
        EXPECT_DOUBLE_EQ(flicker.terms[i].time_s, expected.times_s[i]);
        EXPECT_DOUBLE_EQ(flicker.terms[i].variance_deg2_h2, expected.variance);
    }
}

TEST(RateNoise, VarianceOfTheAngleIsTwiceTheIntegralOfTheCovariance) {
    // Var = 2 int_0^t (t - s) r(s) ds of a stationary rate, by the midpoint rule (error of order 1e-8 of it); terms
    // with x = t/T on both sides of the change of formula at 0.01.
    RateNoise noise{.terms = {{0.3, 2.0}, {10.0, 5.0}, {100.5, 1.0}, {99.5, 1.0}, {1e6, 3.0}}};
    const double t = 1.0;
    constexpr int steps = 20000;
    double expected = 0.0;
    for (int i = 0; i < steps; ++i) {
        const double s = (i + 0.5) * t / steps;
        for (const GaussMarkov& term : noise.terms) {
            expected += 2.0 * (t - s) * term.variance_deg2_h2 * std::exp(-s / term.time_s) * t / steps;
        }
    }
    EXPECT_NEAR(angle_variance_arcsec2(noise, t) / expected, 1.0, 1e-8);
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

}  // namespace
}  // namespace effects_rate_test
}  // namespace ringlock::effects
