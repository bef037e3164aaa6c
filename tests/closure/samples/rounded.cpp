// Records whose values come in steps that are large beside their noise, which the closed loop reads.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/samples/fit/score.hpp"
#include "analysis/closure/samples/loop/loop.hpp"
#include "analysis/closure/samples/rounded/maximum.hpp"
#include "analysis/closure/samples/rounded/unrounding.hpp"
#include "tests/closure/generator/samples.hpp"
#include "tests/closure/heldout.hpp"

namespace ringlock::test::closure {
namespace samples_rounded_test {
namespace {

using ringlock::closure::close_samples;
using ringlock::closure::Closure;
using ringlock::closure::RoundedIncrements;
using ringlock::closure::Rows;
using ringlock::closure::SampleFit;
using ringlock::closure::SampleModel;
using ringlock::closure::SampleSeries;
using ringlock::closure::Verdict;

constexpr double step_arcsec = 0.5;

/// Quarter counts of half an arcsec, of a gyro whose readings have so much noise.
SampleTruth counted(double white_angle_arcsec, std::uint64_t seed = 1) {
    SampleTruth truth;
    truth.size = 15000;
    truth.seed = seed;
    truth.kind = record::SampleKind::quarter_count;
    truth.scale_factor_arcsec = 4.0 * step_arcsec;
    truth.white_angle_arcsec = white_angle_arcsec;
    truth.rates.quantum_noise_deg_rt_h = 0.01;
    truth.mean_rate_deg_h = 10.0;
    return truth;
}

/// The model that is true of them.
SampleFit true_fit(const SampleTruth& truth, const SampleSeries& series, const Rows& rows) {
    const SampleFit base(series, SampleModel{}, rows);
    SampleModel model = base.model();
    model.noise.angle_arcsec = truth.white_angle_arcsec;
    model.noise.rate_arcsec_rt_s = 60.0 * truth.rates.quantum_noise_deg_rt_h;
    return {series, std::move(model), rows, SampleFit::Noise::held};
}

TEST(RoundedReadings, AreDrawnWithinTheirStepsAsNormalAsTheirModel) {
    const SampleTruth truth = counted(0.1);
    SampleSeries series = ringlock::closure::prepare_samples(generate_samples(truth));
    const Rows rows(series.size(), 1);
    const std::vector<double> rounded = series.increment;
    const SampleFit fit = true_fit(truth, series, rows);
    series.increment = ringlock::closure::impute(fit, {rounded, step_arcsec, 128}, 1);
    double off = 0.0;
    double least = 0.0;
    double most = 0.0;
    for (std::size_t i = 0; i < rounded.size(); ++i) {
        off += series.increment[i] - rounded[i];
        least = std::min(least, off);
        most = std::max(most, off);
    }
    EXPECT_LT(most - least, step_arcsec * (1.0 + 1e-6));
    const SampleFit drawn = true_fit(truth, series, rows);
    double square = 0.0;
    double next = 0.0;
    for (std::size_t i = 1; i < series.size(); ++i) {
        square += drawn.innovations()[i] * drawn.innovations()[i];
        next += drawn.innovations()[i] * drawn.innovations()[i - 1];
    }
    const auto n = static_cast<double>(series.size());
    EXPECT_NEAR(square / n, 1.0, 4.0 * std::sqrt(2.0 / n));
    EXPECT_NEAR(next / n, 0.0, 4.0 / std::sqrt(n));
}

// What is foretold of each count has the spread that it says, and makes the counts more probable than the noise of
// rounding that does not follow the angle.
TEST(RoundedReadings, AreForetoldWithTheSpreadThatIsSaid) {
    const SampleTruth truth = counted(0.05);
    const SampleSeries series = ringlock::closure::prepare_samples(generate_samples(truth));
    const Rows rows(series.size(), 1);
    const SampleFit fit = true_fit(truth, series, rows);
    const auto predicted = ringlock::closure::predict_rounded(fit, {series.increment, step_arcsec, 128});
    double squares = 0.0;
    double variance = 0.0;
    double log_probability = 0.0;
    for (std::size_t i = 0; i < series.size(); ++i) {
        squares += std::pow(series.increment[i] - predicted.mean[i], 2);
        variance += predicted.variance[i];
        log_probability += predicted.log_probability[i] - std::log(step_arcsec);
    }
    const SampleFit linear(series, SampleModel{}, rows);
    EXPECT_NEAR(squares / variance, 1.0, 0.08);
    EXPECT_GT(log_probability, score_of(linear, rows, step_arcsec).log_score + 50.0);
}

// Filters are drawn anew by chance, but that says nearly the same of nearly the same model: a climb sees slopes.
TEST(LongRoundedReadings, NearlyTheSameModelsAreNearlyAsLikely) {
    for (const double noise : {0.25, 0.1, 0.02}) {
        SCOPED_TRACE(noise);
        const SampleTruth truth = counted(noise);
        const SampleSeries series = ringlock::closure::prepare_samples(generate_samples(truth));
        const Rows rows(series.size(), 1);
        const RoundedIncrements rounded{series.increment, step_arcsec, 128};
        std::vector<double> likelihood;
        for (int k = 0; k < 12; ++k) {
            SampleModel model = true_fit(truth, series, rows).model();
            model.noise.angle_arcsec *= 1.0 + 1e-3 * k;
            const SampleFit fit(series, std::move(model), rows, SampleFit::Noise::all_held);
            likelihood.push_back(log_likelihood_of_rounded(fit, rounded, series.size()));
        }
        double squares = 0.0;
        for (std::size_t k = 2; k < likelihood.size(); ++k) {
            squares += std::pow(likelihood[k] - 2.0 * likelihood[k - 1] + likelihood[k - 2], 2) / 10.0;
        }
        EXPECT_LT(std::sqrt(squares), 0.5);
    }
}

// Where the measured increments are likeliest, and how sharp that is: the truth, within its errors.
TEST(LongRoundedReadings, AreLikeliestWhereTheNoiseIs) {
    constexpr int records = 8;
    double angle = 0.0;
    double rate = 0.0;
    for (int k = 1; k <= records; ++k) {
        const SampleTruth truth = counted(0.1, static_cast<std::uint64_t>(k));
        const SampleSeries series = ringlock::closure::prepare_samples(generate_samples(truth));
        const Rows rows(series.size(), 1);
        SampleModel model = true_fit(truth, series, rows).model();
        const ringlock::closure::SampleNoise exact = model.noise;
        model.noise.angle_arcsec *= 1.6;
        model.noise.rate_arcsec_rt_s *= 2.0;
        const SampleFit off(series, std::move(model), rows, SampleFit::Noise::all_held);
        const auto maximum = towards_maximum(off, {series.increment, step_arcsec, 64}, series.size(), 8);
        ASSERT_EQ(maximum.noise_log_sd.size(), 2U);
        EXPECT_NEAR(maximum.noise_log_sd[0], 0.0165, 0.004);  // second differences of the log-likelihood
        const auto& noise = maximum.model.noise;
        angle += std::pow(std::log(noise.angle_arcsec / exact.angle_arcsec) / maximum.noise_log_sd[0], 2);
        rate += std::pow(std::log(noise.rate_arcsec_rt_s / exact.rate_arcsec_rt_s) / maximum.noise_log_sd[1], 2);
    }
    // Chi squared of eight degrees of freedom, one in ten thousand
    EXPECT_LT(angle, 31.8);
    EXPECT_LT(rate, 31.8);
}

TEST(LongRoundedRecords, CountsBesideLittleNoiseAreNoStructure) {
    for (const double noise : {0.1, 0.05, 0.0}) {
        SCOPED_TRACE(noise);
        const Closure found = close_samples(generate_samples(counted(noise)));
        EXPECT_EQ(found.verdict, Verdict::nothing_missing);
        EXPECT_NEAR(found.base[0].value, 10.0, 4.0 * found.base[0].sd);
        EXPECT_NEAR(found.base[2].value, 0.01, 4.0 * found.base[2].sd);
        if (noise > 0.0) {
            EXPECT_NEAR(found.base[1].value, noise, 4.0 * found.base[1].sd);
        }
        expect_errors_of_the_noise(found);
    }
}

TEST(LongRoundedRecords, EffectsShowThroughTheSteps) {
    SampleTruth truth = counted(0.1, 3);
    truth.rates.bias_step = {6.0, 70.0};
    const Closure found = close_samples(generate_samples(truth));
    EXPECT_EQ(found.verdict, Verdict::closed);
    ASSERT_EQ(found.steps.size(), 1U);
    EXPECT_EQ(found.steps[0].name(), "bias_step");
    EXPECT_NEAR(found.steps[0].parameters[0].value, 6.0, 4.0 * found.steps[0].parameters[0].sd);
    EXPECT_LT(found.heldout_after, found.heldout_before);
}

// Steps that nobody declared are an effect, which takes its rounding with it.
TEST(LongRoundedRecords, LargeStepsAreNamedAndLeaveNothing) {
    SampleTruth truth = counted(0.3);
    truth.kind = record::SampleKind::angle_increment_arcsec;
    truth.count_quantization_arcsec = 1.5;
    const Closure found = close_samples(generate_samples(truth));
    EXPECT_EQ(found.verdict, Verdict::closed);
    ASSERT_EQ(found.steps.size(), 1U);
    EXPECT_EQ(found.steps[0].name(), "count_quantization");
    EXPECT_LT(found.heldout_after, found.heldout_before);
    EXPECT_NEAR(found.base[1].value, 0.3, 4.0 * found.base[1].sd);
}

// Whole counts of a quiet gyro: between two crossings of a step the rounding hides all, and the noise of the values
// says nothing of that beneath them.
TEST(LongRoundedRecords, StepsOfFortyTimesTheNoiseLeaveNothing) {
    SampleTruth truth = counted(0.02);
    truth.kind = record::SampleKind::angle_increment_arcsec;
    truth.count_quantization_arcsec = 1.5;
    truth.rates.quantum_noise_deg_rt_h = 0.005;
    const Closure found = close_samples(generate_samples(truth));
    EXPECT_EQ(found.verdict, Verdict::closed);
    ASSERT_EQ(found.steps.size(), 1U);
    EXPECT_EQ(found.steps[0].name(), "count_quantization");
    EXPECT_NEAR(found.base[0].value, 10.0, 4.0 * found.base[0].sd);
    EXPECT_NEAR(found.base[2].value, 0.005, 4.0 * found.base[2].sd);
}

// Beside a walk that nobody knows of yet the steps would be drawn as lines; a line that they hide most of shows when
// the walk is named.
TEST(LongRoundedRecords, EffectsBeneathStepsOfTwentyTimesTheNoiseAreNamed) {
    SampleTruth truth = counted(0.3, 5);
    truth.size = 30000;
    truth.kind = record::SampleKind::angle_increment_arcsec;
    truth.count_quantization_arcsec = 6.9;
    truth.rates.rate_random_walk_deg_h_rt_h = 130.0;
    truth.dither_residue = {44.2, -1.1e-4, 0.35, 2.3};
    const Closure found = close_samples(generate_samples(truth));
    EXPECT_EQ(found.verdict, Verdict::closed);
    std::vector<std::string> named;
    for (const auto& step : found.steps) {
        named.push_back(step.name());
        EXPECT_TRUE(step.confounded_with.empty());
    }
    ASSERT_EQ(named, (std::vector<std::string>{"count_quantization", "rate_random_walk", "dither_residue"}));
    for (const auto& estimate : found.steps[2].parameters) {
        if (estimate.name != "amplitude_arcsec") continue;
        EXPECT_NEAR(estimate.value, truth.dither_residue.amplitude_arcsec, 4.0 * estimate.sd);
        EXPECT_LT(estimate.sd, 0.02);
    }
}

}  // namespace
}  // namespace samples_rounded_test
}  // namespace ringlock::test::closure
