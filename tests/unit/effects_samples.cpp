#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace effects_samples_test {
namespace {

Values values_of(const Effect& effect, const Values& given) {
    Values values;
    for (const Parameter& p : effect.parameters()) values.emplace(p.name, p.default_value);
    for (const auto& [name, value] : given) values.at(name) = value;
    return values;
}

Sampled through(std::string_view name, const Values& given, Sampled samples) {
    const Effect& effect = *find(name);
    effect.sample_stage(values_of(effect, given), {.seed = 3, .gyro = 1})->apply(samples);
    return samples;
}

TEST(SampleStages, QuantizationKeepsTheAngleWithinAStep) {
    Sampled samples{.rate_hz = 100.0, .record_hz = 100.0, .increment_arcsec = std::vector<double>(1000, 0.137)};
    const Sampled out = through("count_quantization", {{"step_arcsec", 0.5}}, samples);
    double angle = 0.0;
    for (std::size_t i = 0; i < 1000; ++i) {
        angle += out.increment_arcsec[i];
        EXPECT_NEAR(angle, 0.5 * std::floor(0.137 * static_cast<double>(i + 1) / 0.5), 0.5 + 1e-9);
        EXPECT_NEAR(std::remainder(out.increment_arcsec[i], 0.5), 0.0, 1e-12);
    }
}

TEST(SampleStages, AResidueIsASineOfTheAngle) {
    Sampled samples{.rate_hz = 100.0, .record_hz = 100.0, .increment_arcsec = std::vector<double>(1000, 0.0)};
    const Sampled out = through("dither_residue", {{"frequency_hz", 137.0}, {"amplitude_arcsec", 0.2}}, samples);
    const auto angle = [](double t) { return 0.2 * std::sin(2.0 * M_PI * 137.0 * (t - 5.0)); };
    for (std::size_t i = 0; i < 1000; ++i) {
        const double t = 0.01 * static_cast<double>(i);
        EXPECT_NEAR(out.increment_arcsec[i], angle(t + 0.01) - angle(t), 1e-9);
    }
}

// White source increments of variance 1: p - 1/3 above the record's rate, p^2 - p^3/3 below it (docs/effects.md), over
// all places of the beat. 200 000 rows: the variance is known to 0.4 %, four of them allowed.
TEST(SampleStages, ResampledIncrementsHaveTheirVariance) {
    for (const double p : {1.234, 0.789}) {
        const auto rows = static_cast<std::size_t>(200000.0 * p) + 2;
        Sampled samples{.rate_hz = 100.0 * p, .record_hz = 100.0};
        for (std::size_t i = 0; i < rows; ++i) {
            samples.increment_arcsec.push_back(random::normal({.seed = 9}, random::Purpose::quantum_noise, i));
        }
        const Sampled out = through("resampling", {{"from_hz", 100.0 * p}}, samples);
        EXPECT_EQ(out.rate_hz, 100.0);
        double variance = 0.0;
        for (const double x : out.increment_arcsec)
            variance += x * x / static_cast<double>(out.increment_arcsec.size());
        EXPECT_NEAR(variance / (p >= 1.0 ? p - 1.0 / 3.0 : p * p - p * p * p / 3.0), 1.0, 0.016) << p;
    }
}

TEST(SampleStages, AWitnessSeesTheMotionAsFarAsItIsCoherent) {
    Sampled samples{.rate_hz = 100.0, .record_hz = 100.0, .increment_arcsec = std::vector<double>(1000, 0.0)};
    const Sampled out = through("case_motion", {{"rms_arcsec", 2.0}, {"witness", 1.0}, {"coherence", 1.0}}, samples);
    const std::vector<double>& witness = out.witnesses.at("accel_y");
    ASSERT_EQ(witness.size(), 1000U);
    // Of means of the angle at both ends the differences are means of two increments.
    for (std::size_t i = 1; i < 1000; ++i) {
        EXPECT_NEAR((witness[i] - witness[i - 1]) / 9.80665 * 648000.0 / M_PI,
                    0.5 * (out.increment_arcsec[i] + out.increment_arcsec[i - 1]), 1e-9);
    }
}

// What is asked of an effect before its stage is made is what the stage does.
TEST(SampleStages, ActWhereTheirEffectSays) {
    for (const Effect* effect : registry()) {
        const auto stage = effect->sample_stage(values_of(*effect, {}), {.seed = 1, .gyro = 0});
        ASSERT_EQ(stage != nullptr, effect->sample_place().has_value()) << effect->name();
        if (stage) {
            EXPECT_EQ(stage->place(), *effect->sample_place()) << effect->name();
        }
    }
}

}  // namespace
}  // namespace effects_samples_test
}  // namespace ringlock::effects
