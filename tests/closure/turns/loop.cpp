// The closed loop on turn records that it reads blind.
#include <gmock/gmock.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/report/report.hpp"
#include "analysis/instrument/simulate.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/scenario.hpp"
#include "tests/closure/answers.hpp"
#include "tests/closure/generator/generator.hpp"
#include "tests/closure/generator/plain_gyro.hpp"
#include "tests/closure/heldout.hpp"

namespace ringlock::test::closure {
namespace turns_loop_test {
namespace {

using ringlock::closure::close_loop;
using ringlock::closure::Closure;
using ringlock::closure::Estimate;
using ringlock::closure::Verdict;

TEST(LongTurnLoop, NothingIsMissingWhereNothingIs) {
    int k = 0;
    for (const double injected : {0.0, 3.0}) {
        for (const bool restless : {false, true}) {
            scenario::Scenario scenario = gyro(10000, 200 + static_cast<std::uint64_t>(++k), injected);
            if (restless) {
                scenario.dither.amplitude_wander_relative_rt_s = 1e-5;
                scenario.dither.amplitude_drift_relative_per_h = 0.01;
                scenario.input.profile_time_s = {0.0, 10.0, 11.0, 25.0, 26.0, 1000.0};
                scenario.input.profile_rate_deg_h = {100.0, 100.0, -200.0, -200.0, 300.0, 300.0};
            }
            const Closure closure = close_loop(instrument::simulate_record(scenario));
            print(restless ? "drifting amplitude, strong rates" : "plain", closure);
            EXPECT_EQ(closure.verdict, Verdict::nothing_missing);
            EXPECT_LT(deviation(closure.base, "lockin_threshold_deg_h", 300.0), 4.0);
            EXPECT_LT(deviation(closure.base, "bias_deg_h", 0.0), 4.0);
            expect_errors_of_the_noise(closure);
        }
    }
}

/// Closes the loop on what the gyros recorded; none of them misses anything.
std::vector<Closure> close_where_nothing_is_missing(const char* name, const std::vector<Truth>& truths) {
    std::vector<Closure> closures;
    for (const auto& record : generate(truths)) {
        const Closure& closure = closures.emplace_back(close_loop(record));
        print(name, closure);
        EXPECT_EQ(closure.verdict, Verdict::nothing_missing) << closures.size();
        const double threshold_deg_h = truths[closures.size() - 1].lockin_threshold_deg_h;
        EXPECT_LT(deviation(closure.base, "lockin_threshold_deg_h", threshold_deg_h), 4.0) << closures.size();
    }
    return closures;
}

/// Such a rotation moves zero-rate points by its share of the dither's peak rate, 2.8 and 28 % here, and lets swings
/// and accelerations differ from the dither's.
TEST(LongTurnLoop, AStrongRotationIsNoShapeOfTheDither) {
    std::vector<Truth> truths;
    for (const double rate_deg_h : {-5000.0, 50000.0}) {
        for (const double injected_rad : {0.0, 6.0}) {
            Truth truth;
            truth.scale_factor_arcsec = 1.2;
            truth.dither_frequency_hz = 450.0;
            truth.dither_peak_rate_deg_s = 50.0;
            truth.injected_noise_rad = injected_rad;
            truth.input_rate_deg_h = rate_deg_h;
            truth.bias_deg_h = -16.9;
            truth.readout_noise = 0.001;
            truth.turns = 6000;
            truth.seed = 40 + truths.size();
            truths.push_back(truth);
        }
    }
    const auto closures = close_where_nothing_is_missing("rotating", truths);
    for (std::size_t k = 0; k < closures.size(); ++k) {
        EXPECT_LT(deviation(closures[k].base, "bias_deg_h", truths[k].bias_deg_h), 4.0) << k;
    }
}

/// Closes the loop on what a gyro recorded that misses one vibration.
Closure close_on_vibration(const char* name, const Truth& truth) {
    Closure closure = close_loop(generate({&truth, 1}).front());
    print(name, closure);
    EXPECT_EQ(closure.verdict, Verdict::closed);
    EXPECT_THAT(closure.steps,
                testing::ElementsAre(testing::Property(&ringlock::closure::Step::name, "base_vibration")));
    return closure;
}

/// Three times the lock-in threshold: zero-rate points go to and fro with it, by a fifth of the time within which the
/// phase turns, and kicks with them.
TEST(LongTurnLoop, AStrongLineTakesTheZeroRatePointsAlong) {
    Truth truth;
    truth.readout_noise = 0.005;
    truth.bias_deg_h = 15.0;
    truth.rates.base_vibration = {59.567, 911.0, 0.6};
    truth.turns = 3000;
    truth.seed = 80;
    const Closure closure = close_on_vibration("strong line", truth);
    EXPECT_LT(deviation(closure.base, "lockin_threshold_deg_h", truth.lockin_threshold_deg_h), 4.0);
    EXPECT_LT(deviation(closure.base, "bias_deg_h", truth.bias_deg_h), 4.0);
}

/// Phases of either kind of turn beat with the dither at half its frequency nearly, and a vibration near that with
/// them: its image of 1.2 Hz stands higher above the noise than what is seen at its own frequency.
TEST(LongTurnLoop, AVibrationIsNotTakenForItsBeat) {
    Truth truth;
    truth.scale_factor_arcsec = 0.5;
    truth.input_rate_deg_h = 93.3;
    truth.dither_peak_rate_deg_s = 103.19;
    truth.readout_noise = 0.005;
    truth.rates.base_vibration = {60.5, 0.008, 0.0};
    truth.turns = 8000;
    truth.seed = 8;
    const Closure closure = close_on_vibration("beat", truth);
    ASSERT_FALSE(closure.steps.empty());
    EXPECT_LT(deviation(closure.steps[0].parameters, "frequency_hz", 60.5), 4.0);
    EXPECT_LT(deviation(closure.steps[0].parameters, "rate_deg_h", 0.008), 4.0);
    EXPECT_THAT(closure.notes, testing::Contains(testing::HasSubstr("base_vibration of 60.5 Hz: a frequency of 1.17")));
}

TEST(LongTurnLoop, ASwingOfTheAmplitudeIsTheDithersOwn) {
    std::vector<Truth> truths;
    for (const double period_s : {0.9, 11.0}) {
        Truth truth;
        truth.readout_noise = 0.005;
        truth.bias_deg_h = 15.0;
        truth.wander.swing = 1e-3;
        truth.wander.swing_period_s = period_s;
        truth.turns = 6000;
        truth.seed = 60 + truths.size();
        truths.push_back(truth);
    }
    for (const Closure& closure : close_where_nothing_is_missing("amplitude swings", truths)) {
        EXPECT_THAT(closure.notes,
                    testing::Contains(testing::HasSubstr("amplitude has a relative modulation of 0.001")));
    }
}

TEST(LongTurnLoop, AResonatorsAmplitudeIsTheDithersOwn) {
    std::vector<Truth> truths;
    for (const double injected_rad : {0.0, 1.0}) {
        Truth truth;
        truth.readout_noise = 0.005;
        truth.bias_deg_h = 15.0;
        truth.injected_noise_rad = injected_rad;
        truth.wander.rms = 1e-3;
        truth.wander.correlation_s = 0.03;
        truth.turns = 6000;
        truth.seed = 70 + truths.size();
        truths.push_back(truth);
    }
    for (const Closure& closure : close_where_nothing_is_missing("amplitude of a resonator", truths)) {
        EXPECT_LT(deviation(closure.base, "amplitude_correlation_s", 0.03), 4.0);
    }
}

TEST(LongTurnLoop, InjectedNoiseNeedNotBeNormal) {
    Truth truth;
    truth.readout_noise = 0.005;
    truth.injected_noise_rad = 3.0;
    truth.injected_noise_even = 1.0;
    truth.turns = 8000;
    close_where_nothing_is_missing("noise of even density", {truth});
}

TEST(LongTurnLoop, RoundingIsNoEffect) {
    Truth truth;
    truth.readout_noise = 0.0;
    truth.turns = 3000;
    truth.bias_deg_h = 15.0;
    Truth second = truth;
    second.lockin_second_harmonic = {0.1, 1.0};
    const auto records = generate(std::vector<Truth>{truth, second});
    const Closure plain = close_loop(records[0]);
    print("without noise", plain);
    EXPECT_EQ(plain.verdict, Verdict::nothing_missing);
    EXPECT_LT(plain.heldout_after, 1e-9);
    EXPECT_THAT(plain.notes, testing::Contains(testing::HasSubstr("not tested")));
    const Closure closed = close_loop(records[1]);
    print("second harmonic without noise", closed);
    EXPECT_EQ(closed.verdict, Verdict::closed);
    ASSERT_EQ(closed.steps.size(), 1U);
    EXPECT_EQ(closed.steps[0].name(), "lockin_second_harmonic");
    EXPECT_LT(closed.heldout_after, 1e-6);
}

/// Where the dither swings little, injected noise is a part of it that matters: the fit must not end where a threshold
/// of zero explains all, beside which the true one is likelier by thousands.
TEST(LongTurnLoop, InjectedNoiseOfAFiftiethOfTheDitherIsFitted) {
    Truth truth;
    truth.scale_factor_arcsec = 1.2;
    truth.dither_frequency_hz = 450.0;
    truth.dither_peak_rate_deg_s = 50.0;
    truth.injected_noise_rad = 6.0;
    truth.input_rate_deg_h = -5000.0;
    truth.bias_deg_h = -16.923;
    truth.initial_phase_rad = 2.843;
    truth.readout_noise = 0.001;
    truth.turns = 16000;
    truth.seed = 112;
    const Closure closure = close_loop(generate({&truth, 1}).front());
    print("much noise", closure);
    EXPECT_EQ(closure.verdict, Verdict::nothing_missing);
    EXPECT_NEAR(closure.heldout_after, truth.injected_noise_rad, 0.3);
}

/// Each moves what tells of others: times of turns, accelerations, readings and kicks.
TEST(LongTurnLoop, EvidentEffectsAreNamedAndNoOther) {
    struct Evident {
        std::set<std::string> named;
        Truth truth;
    };
    const auto device = [](double scale_factor_arcsec, double dither_hz, double dither_deg_s, double threshold_deg_h) {
        Truth truth;
        truth.scale_factor_arcsec = scale_factor_arcsec;
        truth.dither_frequency_hz = dither_hz;
        truth.dither_peak_rate_deg_s = dither_deg_s;
        truth.lockin_threshold_deg_h = threshold_deg_h;
        truth.readout_noise = 0.002;
        truth.bias_deg_h = -23.9;
        truth.turns = 8000;
        return truth;
    };
    std::vector<Evident> records_of;
    const auto add = [&](std::set<std::string> named, const Truth& truth) {
        records_of.push_back({std::move(named), truth});
        records_of.back().truth.seed = 500 + records_of.size();
        return &records_of.back().truth;
    };
    records_of.reserve(8);
    Truth* truth = add({"dither_asymmetry", "bias_step"}, device(2.43, 90.0, 100.0, 30.0));
    truth->injected_noise_rad = 1.0;
    truth->input_rate_deg_h = 100.0;
    truth->dither_asymmetry = 0.005;
    truth->rates.bias_step = {3.0, 17.8};
    truth = add({"dither_asymmetry"}, device(1.2, 200.0, 100.0, 100.0));
    truth->injected_noise_rad = 1.0;
    truth->input_rate_deg_h = -5000.0;
    truth->dither_asymmetry = 0.005;
    truth = add({"dither_second_harmonic", "detector_phase_offset"}, device(2.43, 124.7, 100.0, 300.0));
    truth->injected_noise_rad = 1.0;
    truth->dither_second_harmonic = {0.01, 0.8};
    truth->detector_phase_offset_rad = 0.8;
    truth = add({"detector_phase_offset", "lockin_turn_asymmetry"}, device(1.2, 124.7, 100.0, 600.0));
    truth->input_rate_deg_h = -5000.0;
    truth->detector_phase_offset_rad = 0.5;
    truth->lockin_turn_asymmetry = 0.2;
    truth->turns = 3000;
    truth = add({"readout_ellipse", "base_vibration"}, device(0.7, 124.7, 250.0, 100.0));
    truth->readout_ellipse.gain = 0.03;
    truth->readout_ellipse.offset_sin = 0.02;
    truth->rates.base_vibration = {7.3, 5.0, 0.5};
    truth = add({"bias_step"}, device(0.5, 200.0, 50.0, 60.0));
    truth->injected_noise_rad = 6.0;
    truth->rates.bias_step = {3.0, 8.0};

    std::vector<Truth> truths;
    for (const Evident& evident : records_of) truths.push_back(evident.truth);
    const auto records = generate(truths);
    for (std::size_t k = 0; k < records.size(); ++k) {
        const Closure closure = close_loop(records[k]);
        print("evident", closure);
        std::set<std::string> named;
        for (const auto& step : closure.steps) named.insert(step.name());
        EXPECT_EQ(closure.verdict, Verdict::closed) << k;
        EXPECT_EQ(named, records_of[k].named) << k;
    }
}

TEST(TurnLoop, RecordsThatCannotBeFollowedAreRefused) {
    Truth truth;
    truth.scale_factor_arcsec = 1.2;
    truth.dither_frequency_hz = 450.0;
    truth.dither_peak_rate_deg_s = 50.0;
    truth.input_rate_deg_h = 100000.0;
    truth.turns = 400;
    const auto expect_refused = [&](const char* why) {
        EXPECT_THAT(
            [&] {
                close_loop(generate({&truth, 1}).front());
            },
            testing::ThrowsMessage<InputError>(testing::HasSubstr(why)));
    };
    expect_refused("% of the dither's peak rate");
    truth.input_rate_deg_h = 0.0;
    truth.lockin_threshold_deg_h = 12000.0;
    truth.scale_factor_arcsec = 2.0;
    truth.dither_frequency_hz = 600.3;
    truth.dither_peak_rate_deg_s = 12.0;  // 11.5 fringes
    expect_refused("the lock-in threshold is too high for the number of fringes in a half cycle");
}

TEST(LongTurnLoop, WhatIsReadAgainIsFittedAnew) {
    // What quarters lost made of the noise is not what the record has once they are counted again.
    scenario::Scenario scenario = gyro(16000, 400, 0.0);
    scenario.dither.amplitude_wander_relative_rt_s = 1e-5;
    scenario.input.profile_time_s = {0.0, 20.0, 21.0, 40.0, 41.0, 1000.0};
    scenario.input.profile_rate_deg_h = {100.0, 100.0, -200.0, -200.0, 150.0, 150.0};
    scenario.effects.at("missed_counts").at("probability_per_turn") = 2e-3;
    const Closure closure = close_loop(instrument::simulate_record(scenario));
    print("missed counts, moving", closure);
    ASSERT_EQ(closure.steps.size(), 1U);
    EXPECT_EQ(closure.verdict, Verdict::closed);
    EXPECT_LT(closure.heldout_after, 0.01);
}

struct Single {
    const char* effect;
    std::vector<std::pair<std::string, double>> values;
    double injected_rad = 0.0;
    double temperature_swing_k = 0.0;
    bool profile = false;
};
void PrintTo(const Single& single, std::ostream* out) { *out << single.effect; }

class TurnLoopFinds : public testing::TestWithParam<Single> {};

TEST_P(TurnLoopFinds, TheEffectThatIsMissing) {
    const Single& single = GetParam();
    scenario::Scenario scenario = gyro(16000, 120, single.injected_rad);
    for (const auto& [name, value] : single.values) scenario.effects.at(single.effect).at(name) = value;
    scenario.environment.temperature_swing_k = single.temperature_swing_k;
    scenario.environment.temperature_period_s = 25.0;
    scenario.record.temperature_interval_s = 0.1;  // between rows the temperature is taken for linear
    if (single.profile) {
        scenario.input.profile_time_s = {0.0, 20.0, 21.0, 40.0, 41.0, 1000.0};
        scenario.input.profile_rate_deg_h = {300.0, 300.0, -300.0, -300.0, 600.0, 600.0};
    }
    ASSERT_TRUE(scenario::check(scenario).empty());
    const Closure closure = close_loop(instrument::simulate_record(scenario));
    print(single.effect, closure);
    EXPECT_EQ(closure.verdict, Verdict::closed);
    ASSERT_EQ(closure.steps.size(), 1U);
    EXPECT_EQ(closure.steps[0].name(), single.effect);
    // The record does not exclude an effect that contains the true one and whose additional sizes are small.
    for (const effects::Effect* other : closure.steps[0].confounded_with) {
        EXPECT_TRUE(ringlock::closure::contains(*other, *closure.steps[0].effect)) << other->name();
    }
    for (const auto& [name, value] : single.values) {
        EXPECT_LT(deviation(closure.steps[0].parameters, name, value), 4.0) << name;
    }
    expect_errors_of_the_noise(closure);
}

INSTANTIATE_TEST_SUITE_P(LongEffects, TurnLoopFinds,
                         testing::Values(Single{"base_vibration", {{"frequency_hz", 3.3}, {"rate_deg_h", 1.5}}, 3.0},
                                         Single{"bias_ramp", {{"deg_h_per_h", 0.5}}},
                                         Single{"bias_step", {{"step_deg_h", 0.01}, {"time_s", 25.0}}},
                                         Single{"bias_temperature", {{"deg_h_per_k", 0.002}}, 0.0, 1.0},
                                         Single{"detector_phase_offset", {{"phase_rad", 0.02}}},
                                         Single{"dither_asymmetry", {{"ratio", 1e-3}}, 3.0},
                                         Single{"dither_second_harmonic", {{"ratio", 1e-3}, {"phase_rad", 1.0}}, 3.0},
                                         Single{"lockin_second_harmonic", {{"ratio", 0.02}, {"phase_rad", 2.0}}},
                                         Single{"lockin_turn_asymmetry", {{"ratio", 0.01}}},
                                         Single{"missed_counts", {{"probability_per_turn", 2e-3}}},
                                         Single{"quantum_noise", {{"deg_rt_h", 2e-5}}},
                                         Single{"rate_random_walk", {{"deg_h_rt_h", 0.05}}},
                                         Single{"readout_ellipse", {{"gain", 0.01}, {"offset_sin", -0.008}}},
                                         Single{"scale_factor_error", {{"relative", 2e-5}}, 0.0, 0.0, true}),
                         [](const auto& single) { return std::string(single.param.effect); });

TEST(LongTurnLoop, TimesAndPhasesAreByTheRecordsClock) {
    // A cycle of the line is no longer than six turns: its phase tells by which of them time is counted.
    constexpr double frequency_hz = 40.7;
    constexpr double phase_rad = 1.0;
    scenario::Scenario scenario = gyro(12000, 125, 3.0);
    scenario.effects.at("base_vibration") = {
        {"frequency_hz", frequency_hz}, {"rate_deg_h", 200.0}, {"phase_rad", phase_rad}};
    scenario.effects.at("bias_step") = {{"step_deg_h", 0.2}, {"time_s", 20.0}};
    record::Record record = instrument::simulate_record(scenario);
    for (const double late_s : {0.0, 100.0}) {
        for (auto* times : {&record.turns->time_s, &record.temperature_c.time_s, &record.input_rate_deg_h.time_s}) {
            for (double& time : *times) time += late_s;
        }
        const Closure closure = close_loop(record);
        print("a line and a step", closure);
        EXPECT_EQ(closure.verdict, Verdict::closed);
        ASSERT_EQ(closure.steps.size(), 2U);
        std::vector<Estimate> all = closure.steps[0].parameters;
        all.insert(all.end(), closure.steps[1].parameters.begin(), closure.steps[1].parameters.end());
        EXPECT_LT(deviation(all, "time_s", 20.0 + late_s), 4.0);
        EXPECT_LT(deviation(all, "frequency_hz", frequency_hz), 4.0);
        for (const Estimate& estimate : all) {
            if (estimate.name != "phase_rad") continue;
            const double truth = phase_rad - units::two_pi * frequency_hz * late_s;
            EXPECT_LT(std::abs(std::remainder(estimate.value - truth, units::two_pi)), 4.0 * estimate.sd);
            // Long before the record it is less well known.
            EXPECT_LT(estimate.sd, late_s > 0.0 ? 0.5 : 0.05);
        }
        // The scenario has a clock that begins with the record.
        const scenario::Scenario closed = ringlock::closure::closed_scenario(record, closure).scenario;
        EXPECT_NEAR(closed.effects.at("bias_step").at("time_s"), 20.0, 0.5);
        EXPECT_NEAR(std::remainder(closed.effects.at("base_vibration").at("phase_rad") - phase_rad -
                                       units::two_pi * frequency_hz * (record.turns->time_s.front() - late_s),
                                   units::two_pi),
                    0.0, 0.2);
    }
}

TEST(LongTurnLoop, ReadsWhatAnotherSimulatorWrote) {
    Truth plain;
    plain.turns = 6000;
    plain.readout_noise = 0.005;
    plain.clock_hz = 1e8;
    plain.input_rate_deg_h = 20.0;
    plain.declared.emplace();
    plain.declared->scale_factor_arcsec = plain.scale_factor_arcsec;
    plain.declared->lockin_threshold_deg_h = 240.0;  // a fifth off
    std::vector<Truth> truths(3, plain);
    truths[1].lockin_second_harmonic = {0.03, -1.0};
    truths[2].lockin_third_harmonic = {0.08, 0.5};
    const auto records = generate(truths);
    const Closure nothing = close_loop(records[0]);
    print("plain", nothing);
    EXPECT_EQ(nothing.verdict, Verdict::nothing_missing);
    EXPECT_LT(deviation(nothing.base, "lockin_threshold_deg_h", 300.0), 4.0);
    EXPECT_LT(deviation(nothing.base, "bias_deg_h", 20.0), 4.0);

    const Closure second = close_loop(records[1]);
    print("second harmonic", second);
    EXPECT_EQ(second.verdict, Verdict::closed);
    ASSERT_EQ(second.steps.size(), 1U);
    EXPECT_EQ(second.steps[0].name(), "lockin_second_harmonic");
    EXPECT_LT(deviation(second.steps[0].parameters, "ratio", 0.03), 4.0);
    EXPECT_LT(deviation(second.steps[0].parameters, "phase_rad", -1.0), 4.0);

    // The library has no third harmonic.
    const Closure third = close_loop(records[2]);
    print("third harmonic", third);
    EXPECT_EQ(third.verdict, Verdict::unexplained);
    EXPECT_TRUE(third.steps.empty());
    ASSERT_TRUE(third.unexplained.has_value());
    EXPECT_EQ(third.unexplained->where, ringlock::closure::Where::phase);
}

TEST(LongTurnLoop, ClosesBackIntoTheMonteCarlo) {
    scenario::Scenario scenario = gyro(10000, 130, 3.0);
    scenario.effects.at("detector_phase_offset").at("phase_rad") = 0.6;
    const record::Record record = instrument::simulate_record(scenario);
    const Closure closure = close_loop(record);
    print("detector_phase_offset", closure);
    const scenario::Scenario closed = ringlock::closure::closed_scenario(record, closure).scenario;
    EXPECT_TRUE(scenario::check(closed).empty());
    EXPECT_NEAR(closed.effects.at("detector_phase_offset").at("phase_rad"), 0.6, 0.1);
    EXPECT_NEAR(closed.gyro.lockin_threshold_deg_h, 300.0, 15.0);
    EXPECT_NEAR(closed.noise_injection.turn_phase_rms_rad, 3.0, 0.1);
    EXPECT_NEAR(closed.input.rate_deg_h, 15.0, 0.01);
    const nlohmann::json json = ringlock::closure::to_json(closure);
    EXPECT_EQ(json.at("verdict"), "closed");
    EXPECT_EQ(json.at("steps").at(0).at("effect"), "detector_phase_offset");
    EXPECT_TRUE(json.at("steps").at(0).at("parameters").at("phase_rad").at("std").is_number());
    EXPECT_EQ(json.at("heldout_error").at("unit"), "rad");
    EXPECT_FALSE(json.at("unexplained").at("present"));
}

/// The rate of the gyro jumps between two levels, which the library does not have.
Truth jumping_rate(std::uint64_t seed, std::size_t turns) {
    Truth truth;
    truth.turns = turns;
    truth.scale_factor_arcsec = 1.3;
    truth.dither_frequency_hz = 400.0;
    truth.dither_peak_rate_deg_s = 80.0;
    truth.lockin_threshold_deg_h = 100.0;
    truth.injected_noise_rad = 2.5;
    truth.readout_noise = 0.005;
    truth.rates.telegraph_bias = {8.0, 0.8};
    truth.seed = seed;
    return truth;
}

void expect_unexplained_in_time(const std::vector<Truth>& truths) {
    for (const auto& record : generate(truths)) {
        const Closure closure = close_loop(record);
        print("a rate that jumps", closure);
        EXPECT_EQ(closure.verdict, Verdict::unexplained);
        EXPECT_TRUE(closure.steps.empty());
        ASSERT_TRUE(closure.unexplained);
        EXPECT_EQ(closure.unexplained->where, ringlock::closure::Where::time);
    }
}

TEST(LongTurnLoop, AShortRecordOfARateThatJumpsIsUnexplained) { expect_unexplained_in_time({jumping_rate(9, 4000)}); }

// Jumps far above the noise: places within a hundredth of the record leave more than a random rate does, and short
// stays are seen under the noise that the others leave.
TEST(LongTurnLoop, ARateThatJumpsFarAboveTheNoiseIsNoRandomRate) {
    expect_unexplained_in_time({jumping_rate(9, 10000), jumping_rate(12, 10000), jumping_rate(13, 10000)});
}

}  // namespace
}  // namespace turns_loop_test
}  // namespace ringlock::test::closure
