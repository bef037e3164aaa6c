// The straight line through a sweep: closed forms, and whether the intervals hold what they say.
#include "analysis/study/figures/scale_factor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "engine/random/stream.hpp"

namespace ringlock::study {
namespace scale_factor_test {
namespace {

random::NormalStream normals(std::uint64_t trial) {
    return random::NormalStream({91, trial}, random::Purpose::initial_phase);
}

TEST(ScaleFactor, OfExactLinesIsTheirMeanAndSpread) {
    // Slopes 1 ... 5 ppm: mean 3, sd sqrt(2.5). Biases 0.1 (m - 2): mean 0. What all share, (1, -2, 1) deg/h, has
    // neither mean nor slope over these rates.
    const std::vector<double> rates = {100.0, 200.0, 300.0};
    const std::vector<double> shared = {0.5, -1.0, 0.5};
    std::vector<double> errors;
    for (std::size_t j = 0; j < 3; ++j) {
        for (int m = 0; m < 5; ++m) errors.push_back(1e-6 * (m + 1) * rates[j] + 0.1 * (m - 2) + shared[j]);
    }
    const auto line = scale_factor(rates, errors);
    ASSERT_TRUE(line);
    const double sd = std::sqrt(2.5);
    ASSERT_TRUE(line->scale_factor_ppm.mean);
    EXPECT_NEAR(*line->scale_factor_ppm.mean, 3.0, 1e-9);
    // Tables: t of 4 degrees of freedom at 97.5 % is 2.776, chi-squared 0.4844 and 11.143.
    EXPECT_NEAR(line->scale_factor_ppm.lo, 3.0 - 2.776 * sd / std::sqrt(5.0), 1e-3);
    EXPECT_NEAR(line->scale_factor_ppm.hi, 3.0 + 2.776 * sd / std::sqrt(5.0), 1e-3);
    ASSERT_TRUE(line->repeatability_ppm.value);
    EXPECT_NEAR(*line->repeatability_ppm.value, sd, 1e-9);
    EXPECT_NEAR(line->repeatability_ppm.lo, sd * std::sqrt(4.0 / 11.143), 1e-4);
    EXPECT_NEAR(line->repeatability_ppm.hi, sd * std::sqrt(4.0 / 0.4844), 1e-3);
    EXPECT_FALSE(line->bias_deg_h.mean) << "the interval holds zero";
    EXPECT_NEAR(line->bias_deg_h.lo, -line->bias_deg_h.hi, 1e-9);
    EXPECT_NEAR(line->bias_spread_deg_h, 0.1 * sd, 1e-9);
    // No scatter: all of the spread is the gyros' own, and the deviation is known as it is.
    EXPECT_NEAR(line->noise_ppm, 0.0, 1e-9);
    ASSERT_TRUE(line->beyond_noise_ppm.value);
    EXPECT_NEAR(*line->beyond_noise_ppm.value, sd, 1e-6);
    ASSERT_TRUE(line->largest_deviation_deg_h.value);
    EXPECT_NEAR(*line->largest_deviation_deg_h.value, 1.0, 1e-9);
    EXPECT_NEAR(line->largest_deviation_deg_h.lo, 1.0, 1e-9);
    EXPECT_NEAR(line->largest_deviation_deg_h.hi, 1.0, 1e-9);
    EXPECT_EQ(line->largest_deviation_at_deg_h, 200.0);
    EXPECT_EQ(line->full_scale_deg_h, 300.0);
    EXPECT_NEAR(*line->nonlinearity_ppm.value, 1e6 / 300.0, 1e-5);
    EXPECT_NEAR(line->gyro_deviation_deg_h, 1.0, 1e-9);
    EXPECT_NEAR(line->scatter_deg_h, 0.0, 1e-9);
}

TEST(ScaleFactor, EachGyroHasASlopeOfItsOwn) {
    // 2 and -3 ppm beside biases and a deviation that has no slope.
    const std::vector<double> rates = {-100.0, 0.0, 100.0};
    std::vector<double> errors;
    for (const double x : rates) {
        errors.push_back(0.5 + 2e-6 * x);
        errors.push_back(-3e-6 * x + (x == 0.0 ? 0.1 : 0.0));
    }
    const std::vector<double> slopes = scale_factor_errors_ppm(rates, errors);
    ASSERT_EQ(slopes.size(), 2U);
    EXPECT_NEAR(slopes[0], 2.0, 1e-9);
    EXPECT_NEAR(slopes[1], -3.0, 1e-9);
    EXPECT_EQ(scale_factor_errors_ppm(rates, std::vector<double>(3, 0.0)), std::vector<double>{0.0});
    EXPECT_TRUE(scale_factor_errors_ppm(std::vector{1.0, 2.0}, errors).empty());
    EXPECT_TRUE(scale_factor_errors_ppm(std::vector{1.0, 1.0, 1.0}, errors).empty());
}

TEST(ScaleFactor, ScatterIsWhatALineAndTheOthersDoNotExplain) {
    // Two gyros that deviate by +-(1, -2, 1) d: nothing is shared, and there is one degree of freedom,
    // so that scatter^2 = 2 * 6 d^2. Both lines are flat.
    const double d = 0.01;
    const std::vector<double> rates = {-1.0, 0.0, 1.0};
    const std::vector<double> errors = {d, -d, -2.0 * d, 2.0 * d, d, -d};
    const auto line = scale_factor(rates, errors);
    ASSERT_TRUE(line);
    EXPECT_NEAR(line->scatter_deg_h, d * std::sqrt(12.0), 1e-15);
    EXPECT_NEAR(line->noise_ppm, 1e6 * d * std::sqrt(12.0 / 2.0), 1e-8);
    EXPECT_FALSE(line->largest_deviation_deg_h.value);
    EXPECT_FALSE(line->nonlinearity_ppm.value);
    EXPECT_NEAR(line->gyro_deviation_deg_h, 2.0 * d, 1e-15);
    EXPECT_FALSE(line->beyond_noise_ppm.value);
}

TEST(ScaleFactor, NeedsThreeRatesAndTwoGyros) {
    const std::vector<double> errors(8, 0.1);
    const std::vector<double> two = {0.0, 1.0};
    const std::vector<double> four = {0.0, 1.0, 2.0, 3.0};
    const std::vector<double> same = {1.0, 1.0, 1.0, 1.0};
    EXPECT_FALSE(scale_factor(two, errors));
    EXPECT_FALSE(scale_factor({}, {}));
    EXPECT_FALSE(scale_factor(four, std::span(errors).first(4)));
    EXPECT_FALSE(scale_factor(same, errors));
    EXPECT_TRUE(scale_factor(four, errors));
}

TEST(ScaleFactor, WhatAGyroHasAtAllRatesIsBiasAndNothingElse) {
    auto normal = normals(7);
    const std::vector<double> rates = {0.0, 10.0, 20.0, 30.0, 40.0};
    std::vector<double> errors(rates.size() * 6);
    for (double& e : errors) e = normal();
    std::vector<double> moved = errors;
    for (std::size_t m = 0; m < 6; ++m) {
        const double offset = 100.0 * normal();
        for (std::size_t j = 0; j < rates.size(); ++j) moved[j * 6 + m] += offset;
    }
    const auto one = scale_factor(rates, errors);
    const auto other = scale_factor(rates, moved);
    EXPECT_NEAR(one->scale_factor_ppm.lo, other->scale_factor_ppm.lo, 1e-6);
    EXPECT_NEAR(one->noise_ppm, other->noise_ppm, 1e-6);
    EXPECT_NEAR(one->largest_deviation_deg_h.hi, other->largest_deviation_deg_h.hi, 1e-9);
    EXPECT_GT(other->bias_spread_deg_h, 10.0 * one->bias_spread_deg_h);
}

TEST(ScaleFactor, IntervalsHoldWhatTheySay) {
    // Gyros of normal slopes and biases, a shared curve, normal scatter: 3000 trials, so that 95 % is known to 0.4 %
    // (one standard error); 4 of them are allowed. The interval of the largest deviation is simultaneous over the
    // rates, hence wider than it says: no upper bound for it.
    constexpr int trials = 3000;
    constexpr std::size_t gyros = 8;
    constexpr double slope_ppm = 2.0, slope_sd_ppm = 1.0, bias = -0.3, scatter = 5e-5, largest = 2e-4;
    const std::vector<double> rates = {0.0, 20.0, 40.0, 60.0, 80.0, 100.0};
    // Orthogonal to a line over six equidistant points, largest value 5/5.
    const std::vector<double> curve = {1.0, -0.2, -0.8, -0.8, -0.2, 1.0};
    int slope_held = 0, sd_held = 0, beyond_held = 0, bias_held = 0, largest_held = 0;
    double squares = 0.0;
    for (const double x : rates) squares += (x - 50.0) * (x - 50.0);
    const double total_sd_ppm = std::hypot(slope_sd_ppm, 1e6 * scatter / std::sqrt(squares));
    for (int trial = 0; trial < trials; ++trial) {
        auto normal = normals(static_cast<std::uint64_t>(trial));
        std::vector<double> errors(rates.size() * gyros);
        for (std::size_t m = 0; m < gyros; ++m) {
            const double slope = 1e-6 * (slope_ppm + slope_sd_ppm * normal());
            const double offset = bias + 0.2 * normal();
            for (std::size_t j = 0; j < rates.size(); ++j) {
                errors[j * gyros + m] = offset + slope * rates[j] + largest * curve[j] + scatter * normal();
            }
        }
        const auto line = scale_factor(rates, errors);
        const auto held = [](const auto& figure, double truth) { return figure.lo <= truth && truth <= figure.hi; };
        slope_held += held(line->scale_factor_ppm, slope_ppm) ? 1 : 0;
        bias_held += held(line->bias_deg_h, bias) ? 1 : 0;
        sd_held += held(line->repeatability_ppm, total_sd_ppm) ? 1 : 0;
        beyond_held += held(line->beyond_noise_ppm, slope_sd_ppm) ? 1 : 0;
        largest_held += held(line->largest_deviation_deg_h, largest) ? 1 : 0;
    }
    std::printf("held: slope %d, bias %d, sd %d, beyond noise %d, largest deviation %d of %d\n", slope_held, bias_held,
                sd_held, beyond_held, largest_held, trials);
    const double error = 4.0 * std::sqrt(0.95 * 0.05 * trials);
    for (const int held : {slope_held, bias_held, sd_held}) EXPECT_NEAR(held, 0.95 * trials, error);
    // One-sided where the spread is not told from noise, and the noise is itself estimated: a per cent either way.
    EXPECT_NEAR(beyond_held, 0.95 * trials, error + 0.01 * trials);
    EXPECT_GT(largest_held, 0.95 * trials - error);
}

TEST(ScaleFactor, NothingIsSeenWhereThereIsNothing) {
    // Scatter alone: one trial in twenty may claim each figure, 4 standard errors allowed. The deviation is tested at
    // all rates together, its mean over the gyros with a variance of its own at each: never more often than that.
    constexpr int trials = 2000;
    constexpr std::size_t gyros = 6;
    const std::vector<double> rates = {-30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0};
    int slope = 0, bias = 0, beyond = 0, deviation = 0;
    for (int trial = 0; trial < trials; ++trial) {
        auto normal = normals(100000 + static_cast<std::uint64_t>(trial));
        std::vector<double> errors(rates.size() * gyros);
        for (double& e : errors) e = normal();
        const auto line = scale_factor(rates, errors);
        slope += line->scale_factor_ppm.mean ? 1 : 0;
        bias += line->bias_deg_h.mean ? 1 : 0;
        beyond += line->beyond_noise_ppm.value ? 1 : 0;
        deviation += line->nonlinearity_ppm.value ? 1 : 0;
    }
    std::printf("claimed of %d: slope %d, bias %d, spread %d, deviation %d\n", trials, slope, bias, beyond, deviation);
    const double error = 4.0 * std::sqrt(0.95 * 0.05 * trials);
    for (const int claimed : {slope, bias, beyond}) EXPECT_NEAR(claimed, 0.05 * trials, error);
    EXPECT_LT(deviation, 0.05 * trials + error);
}

}  // namespace
}  // namespace scale_factor_test
}  // namespace ringlock::study
