// The loop on uniform samples, blind: records of the generator, which shares no code with it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <string>
#include <utility>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/record/record.hpp"
#include "engine/effects/effect.hpp"
#include "tests/closure/generator/samples.hpp"
#include "tests/closure/heldout.hpp"

namespace samples_closed_test {
namespace {

using namespace ringlock;
using namespace ringlock::test::closure;

SampleTruth usual(std::uint64_t seed = 1) {
    SampleTruth truth;
    truth.seed = seed;
    truth.size = 60000;
    truth.white_angle_arcsec = 0.3;
    truth.rates.quantum_noise_deg_rt_h = 0.01;
    truth.mean_rate_deg_h = 10.0;
    return truth;
}

closure::Closure closed(const SampleTruth& truth) { return closure::close_loop(generate_samples(truth)); }

double value_of(const closure::Step& step, const std::string& name) {
    for (const auto& estimate : step.parameters) {
        if (estimate.name == name) return estimate.value;
    }
    ADD_FAILURE() << step.name() << " has no " << name;
    return 0.0;
}

/// The one step, of that name and with a smaller error held out.
closure::Step only_step(const closure::Closure& found, const std::string& effect) {
    EXPECT_EQ(found.verdict, closure::Verdict::closed) << (found.unexplained ? found.unexplained->description() : "");
    if (found.steps.size() != 1) {
        std::string names;
        for (const auto& step : found.steps) names += " " + step.name();
        ADD_FAILURE() << found.steps.size() << " steps:" << names;
        return {};
    }
    EXPECT_EQ(found.steps[0].name(), effect);
    EXPECT_LE(found.heldout_after, found.heldout_before * (1.0 + 1e-12));
    return found.steps[0];
}

// Each record has a chance of 0.3 % of a false alarm: that twenty have none by chance has a probability of 94 %; the
// seeds are fixed.
int false_alarms(std::uint64_t first, int records) {
    int alarms = 0;
    for (int i = 0; i < records; ++i) {
        SampleTruth truth = usual(first + static_cast<std::uint64_t>(i));
        truth.size = 20000;
        truth.accelerometers = i % 2 == 0;
        truth.white_angle_arcsec = i % 3 == 0 ? 0.1 : 0.3;
        truth.mean_rate_deg_h = i;
        const auto found = closed(truth);
        if (found.verdict != closure::Verdict::nothing_missing) {
            ++alarms;
            std::string what;
            for (const auto& step : found.steps) what += step.name() + " ";
            if (found.unexplained) what += found.unexplained->description();
            std::printf("seed %llu: %s\n", static_cast<unsigned long long>(truth.seed), what.c_str());
        }
    }
    return alarms;
}

TEST(LongSampleClosure, NothingIsMissingWhereNothingIs) { EXPECT_EQ(false_alarms(100, 20), 0); }

// Of 300 at 0.3 % one is expected; more than five have a probability of 3e-4.
TEST(LongSampleClosure, FalseAlarmsAreAsRareAsSaid) { EXPECT_LE(false_alarms(1000, 300), 5); }

TEST(LongSampleClosure, NamesWhatTheDataChainDid) {
    SampleTruth truth = usual();
    truth.count_quantization_arcsec = 0.5;
    EXPECT_NEAR(value_of(only_step(closed(truth), "count_quantization"), "step_arcsec"), 0.5, 1e-6);
    truth = usual();
    truth.resampling.from_hz = 123.4;
    // A hundredth of a cycle over ten minutes
    EXPECT_NEAR(value_of(only_step(closed(truth), "resampling"), "from_hz"), 123.4, 2e-3);
}

// A distribution of rates with several tops has a characteristic function that looks like a coarser step.
TEST(SampleClosure, RatesThatARecordDwellsAtAreNoSteps) {
    SampleTruth truth = usual();
    truth.size = 10000;
    truth.count_quantization_arcsec = 0.25;
    truth.input_profile_deg_h = {{0.0, 45.0, 46.0, 90.0, 91.0, 101.0}, {330.0, 330.0, -330.0, -330.0, 165.0, 165.0}};
    EXPECT_NEAR(value_of(only_step(closed(truth), "count_quantization"), "step_arcsec"), 0.25, 1e-6);
}

TEST(LongSampleClosure, NamesADitherThatDrifts) {
    SampleTruth truth = usual();
    truth.dither_residue = {437.3, 1e-4, 0.05, 0.0};
    const auto step = only_step(closed(truth), "dither_residue");
    // At its alias; standard errors: 3 % of the amplitude, and 1.6e-5 Hz
    EXPECT_NEAR(value_of(step, "frequency_hz"), 37.3, 1e-3);
    EXPECT_NEAR(value_of(step, "drift_hz_per_s"), 1e-4, 1e-5);
    EXPECT_NEAR(value_of(step, "amplitude_arcsec"), 0.05, 0.008);
    EXPECT_TRUE(step.confounded_with.empty());
}

// A dither whose springs take on another temperature: its frequency goes on a curve that no even drift follows. The
// truth is no polynomial.
TEST(LongSampleClosure, NamesADitherThatSettles) {
    SampleTruth truth = usual();
    truth.dither_residue = {437.3, 0.0, 0.1, 0.5, -0.5, 250.0};
    const auto step = only_step(closed(truth), "dither_residue");
    const double middle = -0.5 * std::exp(-300.0 / 250.0);
    EXPECT_NEAR(value_of(step, "frequency_hz"), 37.3 + middle, 1e-3);
    EXPECT_NEAR(value_of(step, "drift_hz_per_s"), -middle / 250.0, 2e-5);
    EXPECT_NEAR(value_of(step, "drift_2_hz_per_s2"), middle / 250.0 / 250.0, 1e-6);
    EXPECT_NEAR(value_of(step, "amplitude_arcsec"), 0.1, 0.008);
    for (const auto& estimate : step.parameters) EXPECT_NE(estimate.name, "wander_hz");
}

// A line whose phase walks is foretold as a resonance, and is not taken for the motion beside it, which has resonances
// too.
TEST(LongSampleClosure, AWanderingLineIsNotTheMotionBesideIt) {
    SampleTruth truth = usual();
    truth.accelerometers = true;
    truth.case_motion.rms_arcsec = 2.0;
    truth.case_motion.coherence = 0.7;
    truth.case_motion.centre_hz = 4.0;
    truth.dither_residue = {37.3, 0.0, 1.0, 0.0};
    truth.dither_residue.wander_hz = 0.05;
    const auto found = closed(truth);
    EXPECT_EQ(found.verdict, closure::Verdict::closed) << (found.unexplained ? found.unexplained->description() : "");
    std::set<std::string> named;
    for (const auto& step : found.steps) {
        named.insert(step.name());
        if (step.name() != "dither_residue") continue;
        EXPECT_NEAR(value_of(step, "frequency_hz"), 37.3, 0.05);
        EXPECT_NEAR(value_of(step, "wander_hz"), 0.05, 0.025);
    }
    EXPECT_EQ(named, (std::set<std::string>{"case_motion", "dither_residue"}));
    const auto of_line = std::find_if(found.notes.begin(), found.notes.end(), [](const std::string& note) {
        return note.find("does not keep its phase") != std::string::npos;
    });
    ASSERT_NE(of_line, found.notes.end());
    EXPECT_EQ(of_line->find("the line at 37."), 0U) << *of_line;
}

TEST(LongSampleClosure, ALineThatStandsStillMayBeEither) {
    SampleTruth truth = usual();
    truth.dither_residue = {137.3, 0.0, 0.05, 0.0};
    EXPECT_EQ(closure::names_of(only_step(closed(truth), "dither_residue").confounded_with),
              std::vector<std::string>{"base_vibration"});
    truth.declared.emplace().dither_frequency_hz = 137.2;
    EXPECT_TRUE(only_step(closed(truth), "dither_residue").confounded_with.empty());
    truth = usual();
    truth.rates.base_vibration = {7.7, 3.0, 0.0};
    const auto step = only_step(closed(truth), "base_vibration");
    EXPECT_NEAR(value_of(step, "frequency_hz"), 7.7, 1e-3);
    EXPECT_NEAR(value_of(step, "rate_deg_h"), 3.0, 0.5);
}

TEST(LongSampleClosure, NamesTheWitnessOfTheCasesMotion) {
    SampleTruth truth = usual();
    truth.case_motion.rms_arcsec = 1.0;
    truth.case_motion.witness = "accel_y";
    const auto found = closed(truth);
    const auto step = only_step(found, "case_motion");
    EXPECT_EQ(step.parameters[0].text, "accel_y");
    EXPECT_LT(found.heldout_after, 0.8 * found.heldout_before);
}

TEST(LongSampleClosure, NamesSlowRates) {
    SampleTruth truth = usual();
    truth.rates.bias_step = {3.0, 250.0};
    const auto step = only_step(closed(truth), "bias_step");
    EXPECT_NEAR(value_of(step, "step_deg_h"), 3.0, 0.3);
    EXPECT_NEAR(value_of(step, "time_s"), 250.0, 6.0);
    truth = usual();
    truth.rates.bias_ramp_deg_h_per_h = 20.0;
    EXPECT_NEAR(value_of(only_step(closed(truth), "bias_ramp"), "deg_h_per_h"), 20.0, 3.0);
    truth = usual();
    truth.temperature.swing_k = 3.0;
    truth.temperature.period_s = 200.0;
    truth.bias_temperature_deg_h_per_k = 1.0;
    EXPECT_NEAR(value_of(only_step(closed(truth), "bias_temperature"), "deg_h_per_k"), 1.0, 0.1);
    truth = usual();
    truth.rates.rate_random_walk_deg_h_rt_h = 10.0;
    only_step(closed(truth), "rate_random_walk");
}

// What is evident is named as surely as what hardly shows, though the noise that the base model takes it for is far
// from the one that is left.
TEST(LongSampleClosure, NamesWhatIsStrong) {
    const auto short_record = [] {
        SampleTruth truth = usual();
        truth.size = 20000;
        return truth;
    };
    SampleTruth truth = short_record();
    truth.dither_residue = {437.3, 0.0, 20.0, 0.0};
    EXPECT_NEAR(value_of(only_step(closed(truth), "dither_residue"), "amplitude_arcsec"), 20.0, 0.03);
    truth = short_record();
    truth.rates.base_vibration = {0.74, 100.0, 0.0};
    EXPECT_NEAR(value_of(only_step(closed(truth), "base_vibration"), "rate_deg_h"), 100.0, 1.0);
    // In blocks that are fitted, and in one that is not
    for (const double time_s : {81.0, 77.0}) {
        truth = short_record();
        truth.rates.bias_step = {150.0, time_s};
        const auto found = closed(truth);
        EXPECT_NEAR(value_of(only_step(found, "bias_step"), "time_s"), time_s, 0.03);
        expect_errors_of_the_noise(found);
    }
    truth = short_record();
    truth.case_motion.rms_arcsec = 10.0;
    truth.case_motion.coherence = 0.7;
    truth.case_motion.centre_hz = 1.4;
    only_step(closed(truth), "case_motion");
    // What the witness does not tell of it has a spectrum of its own, which shows in a longer record.
    truth = usual();
    truth.white_angle_arcsec = 0.2;
    truth.case_motion.rms_arcsec = 1.5;
    only_step(closed(truth), "case_motion");
}

// One jump is a step of the library's, and nothing that a random walk would have to be held back for.
TEST(SampleClosure, AWalkThatLooksLikeAStepIsNamed) {
    SampleTruth truth = usual(37);
    truth.size = 15000;
    truth.mean_rate_deg_h = 12.0;
    truth.white_angle_arcsec = 0.062;
    truth.rates.rate_random_walk_deg_h_rt_h = 20.0;
    only_step(closed(truth), "rate_random_walk");
}

// A line takes for itself what the noise has for a part of the motion; when it is named, that part has to come back.
TEST(LongSampleClosure, AMotionAndALineAreNamed) {
    SampleTruth truth = usual();
    truth.white_angle_arcsec = 0.2;
    truth.case_motion.rms_arcsec = 1.5;
    truth.dither_residue = {38.0, 0.0, 0.2, 0.0};
    const auto found = closed(truth);
    EXPECT_EQ(found.verdict, closure::Verdict::closed) << (found.unexplained ? found.unexplained->description() : "");
    ASSERT_EQ(found.steps.size(), 2U);
    EXPECT_EQ(found.steps[0].name(), "case_motion");
    EXPECT_EQ(found.steps[1].name(), "dither_residue");
}

// A resonance at next to nothing is a random walk of the rate.
TEST(SampleMotion, WhatIsLeftOfItIsNoSlowDrift) {
    SampleTruth truth = usual();
    truth.size = 20000;
    truth.rates.rate_random_walk_deg_h_rt_h = 100.0;
    const closure::SampleSeries series = closure::prepare_samples(generate_samples(truth));
    const closure::Rows rows(series.size(), 1);
    const closure::SampleFit base(series, closure::SampleModel{}, rows);
    const auto gain = [&](double motion_from_hz) {
        closure::SampleModel model = base.model();
        model.motion.assign(series.size(), 0.0);
        model.motion_from_hz = motion_from_hz;
        model.resonances = {{effects::find("case_motion"), 0}};
        model.noise.resonances = {{100.0, 0.002, 0.01}};
        return closure::SampleFit(series, std::move(model), rows, closure::SampleFit::Noise::near).gain_over(base);
    };
    EXPECT_GT(gain(0.0), 100.0);
    EXPECT_LT(gain(0.3), 1.0);
}

// A motion of the case that swings a few times only looks like a line.
TEST(SampleMotion, OfAShortRecordIsTiedToLinesAndRandomRates) {
    for (const double duration_s : {20.0, 60.0}) {
        SampleTruth truth = usual();
        truth.size = static_cast<std::size_t>(duration_s * truth.rate_hz);
        truth.accelerometers = true;
        truth.dither_residue = {.frequency_hz = 7.3, .amplitude_arcsec = 0.5};
        const auto found = closed(truth);
        ASSERT_EQ(found.steps.size(), 1U) << duration_s;
        const auto& tied = found.steps[0].confounded_with;
        const bool with_motion = std::find(tied.begin(), tied.end(), effects::find("case_motion")) != tied.end();
        EXPECT_EQ(with_motion, duration_s < 30.0);
    }
}

// What a witness tells of a strong motion has the witness's own noise in it.
TEST(LongSampleMotion, TheNoiseOfItsWitnessIsNoneOfTheGyros) {
    SampleTruth truth = usual();
    truth.size = 30000;
    truth.case_motion.rms_arcsec = 5.0;
    truth.accelerometer_noise = 3e-5;
    const auto found = closed(truth);
    only_step(found, "case_motion");
    const auto white = std::find_if(found.base.begin(), found.base.end(),
                                    [](const auto& e) { return e.name == "white_angle_arcsec"; });
    ASSERT_NE(white, found.base.end());
    EXPECT_NEAR(white->value, truth.white_angle_arcsec, 3.0 * white->sd);
    EXPECT_LT(white->sd, 0.1 * truth.white_angle_arcsec);
}

// A base at the temperature of the start is as uncertain as that.
TEST(SampleSeries, BeginAtTheTemperatureOfTheStart) {
    SampleTruth truth = usual();
    truth.size = 30000;
    truth.temperature.ramp_k_per_h = 360.0;
    truth.thermometer_noise_k = 0.01;
    const closure::SampleSeries series = closure::prepare_samples(generate_samples(truth));
    const double of_61 = 2.0 * truth.thermometer_noise_k / std::sqrt(61.0);
    EXPECT_NEAR(series.temperature_start_sd_k, of_61, 0.3 * of_61);
    for (const std::size_t i : {15000U, 29999U}) {
        const double change_k = 0.1 * static_cast<double>(i) / truth.rate_hz;
        EXPECT_NEAR(series.temperature_change_k[i], change_k, 4.0 * of_61) << i;
    }
}

// Either can stand in for the slow half of the other: each has to be told again once the other is there.
TEST(LongSampleClosure, AMotionBesideAStrongWalkIsToldAsItIs) {
    constexpr double most_errors = 4.0;
    for (const std::uint64_t seed : {2U, 4U}) {
        SampleTruth truth;
        truth.seed = seed;
        truth.size = 30000;
        truth.white_angle_arcsec = 0.24;
        truth.case_motion.witness = "accel_x";
        truth.case_motion.rms_arcsec = 2.8;
        truth.case_motion.coherence = 0.93;
        truth.case_motion.centre_hz = 1.4;
        truth.case_motion.width_hz = 2.8;
        truth.rates.rate_random_walk_deg_h_rt_h = 112.0;
        const auto found = closed(truth);
        EXPECT_EQ(found.verdict, closure::Verdict::closed);
        ASSERT_EQ(found.steps.size(), 2U);
        EXPECT_EQ(found.steps[0].name(), "case_motion");
        EXPECT_EQ(found.steps[1].name(), "rate_random_walk");
        const auto near = [&](std::size_t step, const std::string& name, double value) {
            const auto& parameters = found.steps[step].parameters;
            const auto estimate =
                std::find_if(parameters.begin(), parameters.end(), [&](const auto& e) { return e.name == name; });
            ASSERT_NE(estimate, parameters.end()) << name;
            EXPECT_NEAR(estimate->value, value, most_errors * estimate->sd) << name << ", seed " << seed;
        };
        near(0, "coherence", 0.93);
        near(0, "rms_arcsec", 2.8);
        near(0, "centre_hz", 1.4);
        near(0, "width_hz", 2.8);
        near(1, "deg_h_rt_h", 112.0);
    }
}

TEST(LongSampleClosure, DoesNotNameWhatTheLibraryDoesNotHave) {
    SampleTruth truth = usual();
    truth.jumping_line = {12.0, 2.0, 6.0, 300.0};
    EXPECT_EQ(closed(truth).verdict, closure::Verdict::unexplained);
    truth = usual();
    truth.saturation_arcsec = 0.9;
    EXPECT_EQ(closed(truth).verdict, closure::Verdict::unexplained);
}

// What a record of a real gyro must come to: the steps of its numbers, a witness that foretells it, and an end that
// admits what is left of a vehicle that was disturbed.
TEST(LongSampleClosure, ARealGyroOnAVehicle) {
    const std::string path = RINGLOCK_SHARED_DATA "/laser-gyro-triad-x.csv";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
    const auto found = closure::close_loop(record::read_record(path));
    EXPECT_EQ(found.verdict, closure::Verdict::unexplained);
    const auto has = [&](const std::string& effect) {
        return std::any_of(found.steps.begin(), found.steps.end(),
                           [&](const auto& step) { return step.name() == effect; });
    };
    EXPECT_TRUE(has("count_quantization"));
    EXPECT_TRUE(has("case_motion"));
    EXPECT_LT(found.heldout_after, found.heldout_before);
}

}  // namespace
}  // namespace samples_closed_test
