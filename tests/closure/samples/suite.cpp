// A small part of the bench of the closed loop on samples (bench_closure_samples.cpp), and what it stands on.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/fit/line_search.hpp"
#include "analysis/closure/samples/loop/loop.hpp"
#include "analysis/closure/samples/model/filter.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "tests/closure/suite/sample_suite.hpp"

namespace ringlock::test::closure {
namespace samples_suite_test {
namespace {

Outcome judged(const SampleCase& of) { return judge(of, make(of)); }

const SampleCondition* condition(const std::string& name) {
    return &*std::find_if(sample_conditions.begin(), sample_conditions.end(),
                          [&](const SampleCondition& c) { return c.name == name; });
}

TEST(ClosureSampleSuite, NamesNothingInRecordsWithoutAnything) {
    std::uint64_t seed = 400;
    for (const SampleCondition& condition : sample_conditions) {
        SampleCase of{.truth = {}, .condition = &condition, .seed = seed++};
        of.size = 12000;
        const Outcome outcome = judged(of);
        EXPECT_EQ(outcome.judged, Judged::right) << condition.name << ": " << outcome.verdict << " " << outcome.where;
        EXPECT_NEAR(outcome.after / outcome.oracle, 1.0, 1e-4);
        EXPECT_FALSE(outcome.deviations.empty());
    }
}

TEST(LongClosureSampleSuite, NamesWhatIsFourTimesItsLimit) {
    std::uint64_t seed = 420;
    const auto named = [&](const char* effect, std::size_t condition) {
        SampleCase of{.kind = Kind::single, .truth = {}, .multiple = 4.0, .condition = &sample_conditions[condition]};
        of.seed = seed++;
        of.size = 12000;
        of.truth = {draw_on_samples(effect, of)};
        settle(of);
        const Outcome outcome = judged(of);
        EXPECT_TRUE(outcome.judged == Judged::right || outcome.judged == Judged::tie)
            << effect << ": " << outcome.verdict << " " << outcome.named;
    };
    named("bias_step", 0);
    named("dither_residue", 1);
    named("case_motion", 2);
    named("bias_temperature", 3);
    named("scale_factor_error", 4);
    named("null_shift_ramp", 3);
}

// Samples show a hop of modes as the step of the bias that comes with it.
TEST(ClosureSampleSuite, AStepOfTheBiasMayBeAHopOfModes) {
    SampleCase of{.truth = {{"bias_step", {{"step_deg_h", 12.0}, {"time_s", 60.0}}}},
                  .condition = &sample_conditions[0],
                  .seed = 440};
    of.size = 8000;
    const auto closure = ringlock::closure::close_samples(make(of));
    ASSERT_EQ(closure.steps.size(), 1U);
    EXPECT_EQ(closure.steps[0].name(), "bias_step");
    ASSERT_EQ(closure.steps[0].confounded_with.size(), 1U);
    EXPECT_EQ(closure.steps[0].confounded_with[0]->name(), "mode_hop");
    EXPECT_NE(closure.steps[0].experiment.find("turns"), std::string::npos) << closure.steps[0].experiment;
}

TEST(LongClosureSampleSuite, HasNoNameForWhatTheLibraryDoesNotHave) {
    for (SampleCase& of : foreign_sample_cases(1)) {
        // In a short record a temperature that is late by more than its period is the slope of the temperature.
        if (of.where != ringlock::closure::Where::temperature) of.size = 10000;
        const Outcome outcome = judged(of);
        EXPECT_FALSE(outcome.false_name) << of.truth_text() << ": " << outcome.verdict << " " << outcome.named;
        // Effects that the library has learned since are among the cases.
        EXPECT_EQ(std::isnan(outcome.oracle), of.truth.empty());
    }
}

// A step and a ramp that both hold against every view, beside a random rate that does not and yet is likelier.
TEST(LongClosureSampleSuite, ARandomRateThatDoesNotHoldIsInNobodysWay) {
    SampleCase of{.kind = Kind::pair, .truth = {}, .multiple = 2.0, .condition = condition("warm"), .seed = 20442};
    of.truth = {{"bias_step", {{"step_deg_h", -4.1735}, {"time_s", 136.0}}}, {"bias_ramp", {{"deg_h_per_h", -86.258}}}};
    const Outcome outcome = judged(of);
    EXPECT_TRUE(outcome.judged == Judged::right || outcome.judged == Judged::tie)
        << outcome.verdict << " " << outcome.named;
}

/// Several effects, all of which the loop names or ties with others.
void expect_all_named(const std::string& under, std::uint64_t seed, const std::vector<Added>& truth,
                      double off_oracle = 1e-3) {
    const SampleCase of{
        .kind = Kind::several, .truth = truth, .multiple = 10.0, .condition = condition(under), .seed = seed};
    const Outcome outcome = judged(of);
    EXPECT_TRUE(outcome.judged == Judged::right || outcome.judged == Judged::tie)
        << outcome.verdict << " " << outcome.named << " " << outcome.where;
    EXPECT_NEAR(outcome.after / outcome.oracle, 1.0, off_oracle);
}

// Where the step explains most alone it is not: with ramp and scale factor's error it explained less there than a
// random rate.
TEST(LongClosureSampleSuite, AStepIsPlacedBesideWhatIsAddedWithIt) {
    expect_all_named("moving, warm", 20650,
                     {{"bias_ramp", {{"deg_h_per_h", -82.369}}},
                      {"bias_step", {{"step_deg_h", -4.7639}, {"time_s", 229.69}}},
                      {"scale_factor_error", {{"relative", -0.013201}}}});
}

// Beside so strong a walk a step is forgotten within less than there is between the places that are searched at first.
TEST(LongClosureSampleSuite, AStepBesideAStrongWalkIsFound) {
    expect_all_named(
        "angles, dither declared", 20587,
        {{"rate_random_walk", {{"deg_h_rt_h", 59.581}}}, {"bias_step", {{"step_deg_h", -16.551}, {"time_s", 155.6}}}});
}

// A random rate follows all three better than the likeliest two; what it leaves is a line and more.
TEST(LongClosureSampleSuite, WhatARandomRateDoesNotFollowIsTriedWithoutOne) {
    expect_all_named("fine digits, accelerometers", 20606,
                     {{"base_vibration", {{"frequency_hz", 0.79619}, {"phase_rad", -0.4207}, {"rate_deg_h", 12.189}}},
                      {"bias_ramp", {{"deg_h_per_h", 609.06}}},
                      {"bias_step", {{"step_deg_h", 31.2}, {"time_s", 98.433}}}});
}

// What the witness left of the motion was fitted where the walk was noise: beside the walk it left structure, and
// nothing but the motion was named.
TEST(LongClosureSampleSuite, AMotionIsToldAnewBesideAWalk) {
    expect_all_named("fine digits, accelerometers", 20592,
                     {{"bias_step", {{"step_deg_h", 5.1547}, {"time_s", 82.778}}},
                      {"rate_random_walk", {{"deg_h_rt_h", 21.281}}},
                      {"case_motion",
                       {{"centre_hz", 2.9523},
                        {"coherence", 0.89455},
                        {"rms_arcsec", 0.43175},
                        {"width_hz", 0.77767},
                        {"witness", 0.0}}}});
}

// Drawn by a model without either, what was rounded to steps of eight times the noise was likelier of a walk. Errors of
// fits to one draw and to the next are 5e-4 apart (rms of ten, by hand), those of loop and oracle so by the root of
// two.
TEST(LongClosureSampleSuite, AFlickerBeneathLargeStepsIsNoWalk) {
    constexpr double of_draws = 4.0 * 5e-4 * 1.4142;
    expect_all_named("accelerometers", 20623,
                     {{"count_quantization", {{"step_arcsec", 2.4441}}}, {"bias_instability", {{"deg_h", 2.8212}}}},
                     of_draws);
}

SampleTruth short_record(std::uint64_t seed) {
    SampleTruth truth;
    truth.size = 16000;
    truth.seed = seed;
    truth.white_angle_arcsec = 0.3;
    truth.rates.quantum_noise_deg_rt_h = 0.01;
    return truth;
}

/// Nothing of the library is in the record, and the answer says so at that place.
void expect_unexplained(const record::Record& record, ringlock::closure::Where where) {
    const auto found = ringlock::closure::close_samples(record);
    EXPECT_EQ(found.verdict, ringlock::closure::Verdict::unexplained);
    EXPECT_TRUE(found.steps.empty()) << found.steps.front().name();
    ASSERT_TRUE(found.unexplained);
    EXPECT_EQ(found.unexplained->where, where) << found.unexplained->description();
}

// A bias of two states, 3 deg/h apart, was called bias_instability, and one that jumps four times a random walk.
TEST(LongClosureSampleSuite, ABiasOfTwoStatesIsNoRandomRate) {
    SampleTruth often = short_record(5);
    often.rates.telegraph_bias = {3.0, 20.0};
    SampleTruth seldom = short_record(61);
    seldom.white_angle_arcsec = 0.1;
    seldom.rates.quantum_noise_deg_rt_h = 0.006;
    seldom.rates.telegraph_bias = {0.6, 50.0};
    for (const SampleTruth& truth : {often, seldom}) {
        expect_unexplained(generate_samples(truth), ringlock::closure::Where::time);
    }
}

// A gyro that settles after it was switched on, and a sway of three and a half periods, were called a random walk.
TEST(LongClosureSampleSuite, ACourseInTimeIsNoRandomRate) {
    SampleTruth settles = short_record(7);
    settles.rates.settling = {8.0, 40.0};
    SampleTruth sways = short_record(8);
    sways.rates.base_vibration = {3.5 / 160.0, 3.0, 0.7};
    // One that looks like a line as well.
    SampleTruth strong = short_record(9);
    strong.size = 30000;
    strong.rates.settling = {6.7, 20.0};
    for (const SampleTruth& truth : {settles, sways, strong}) {
        expect_unexplained(generate_samples(truth), ringlock::closure::Where::time);
    }
}

// Biases that go with an acceleration, slow or fast, were called a random walk and a motion of the case, the latter
// also beside a random rate of no name.
TEST(LongClosureSampleSuite, ARateThatFollowsAWitnessIsNeitherRandomNorAMotion) {
    for (const double time_s : {3.0, 40.0}) {
        SampleTruth truth = short_record(6);
        truth.slow_acceleration = {0.01, time_s, 500.0};
        expect_unexplained(generate_samples(truth), ringlock::closure::Where::frequency);
    }
}

// A bias that follows the temperature through a thermal mass was called a random walk, and so was one whose mass was
// warmer than the thermometer at the start.
TEST(LongClosureSampleSuite, ARateThatFollowsTheTemperatureLateIsNoRandomRate) {
    SampleTruth truth = short_record(10);
    truth.temperature.swing_k = 2.0;
    truth.temperature.period_s = 70.0;
    truth.thermometer_noise_k = 0.01;
    truth.late_temperature = {3.0, 30.0};
    expect_unexplained(generate_samples(truth), ringlock::closure::Where::temperature);
    constexpr std::ptrdiff_t before = 12000;
    truth.size += before;
    truth.temperature.period_s = 50.0;
    truth.temperature.ramp_k_per_h = 60.0;
    truth.late_temperature.lag_s = 40.0;
    record::Record later = generate_samples(truth);
    for (auto* column : {&later.samples->values, &later.samples->witnesses.at("temperature_c")}) {
        column->erase(column->begin(), column->begin() + before);
    }
    expect_unexplained(later, ringlock::closure::Where::temperature);
}

// The instrument that tells the input is late, or noisy, which was called a bias instability.
TEST(LongClosureSampleSuite, AnInputThatIsToldLateOrWithNoiseHasItsPlace) {
    SampleTruth truth = short_record(11);
    std::mt19937_64 random(3);
    std::normal_distribution<double> normal;
    for (double t = 0.0; t < 163.0; t += 1.0) {
        truth.input_profile_deg_h.time_s.push_back(t);
        truth.input_profile_deg_h.value.push_back(100.0 * std::sin(t / 10.0));
    }
    record::Record noisy = generate_samples(truth);
    for (double& rate : noisy.input_rate_deg_h.value) rate += 2.0 * normal(random);
    expect_unexplained(noisy, ringlock::closure::Where::rate);
    double rate = 0.0;
    for (double& value : truth.input_profile_deg_h.value) value = rate += 30.0 * normal(random);
    record::Record late = generate_samples(truth);
    for (double& time_s : late.input_rate_deg_h.time_s) time_s += 0.3;
    expect_unexplained(late, ringlock::closure::Where::rate);
}

// What is left out of the fits as it is far larger than the rest is structure, and takes no name.
TEST(LongClosureSampleSuite, AJumpOfTheAngleIsStructure) {
    SampleTruth truth = short_record(12);
    record::Record jumps = generate_samples(truth);
    jumps.samples->values[9000] += 4.0;
    expect_unexplained(jumps, ringlock::closure::Where::time);
    truth.rates.rate_random_walk_deg_h_rt_h = 30.0;
    record::Record walks = generate_samples(truth);
    walks.samples->values[9000] += 4.0;
    const auto found = ringlock::closure::close_samples(walks);
    EXPECT_EQ(found.verdict, ringlock::closure::Verdict::unexplained);
    ASSERT_EQ(found.steps.size(), 1U);
    EXPECT_EQ(found.steps[0].name(), "rate_random_walk");
}

// Jumps between two levels explain more than any random rate, and more than the line: it is looked for beside the
// random rate that comes nearest.
TEST(LongClosureSampleSuite, ALineBesideARateOfNoNameIsNamed) {
    SampleTruth truth = short_record(5);
    truth.rates.telegraph_bias = {3.0, 20.0};
    truth.dither_residue = {37.3, 0.0, 0.04, 1.0};
    const auto found = ringlock::closure::close_samples(generate_samples(truth));
    EXPECT_EQ(found.verdict, ringlock::closure::Verdict::unexplained);
    ASSERT_TRUE(found.unexplained);
    EXPECT_EQ(found.unexplained->where, ringlock::closure::Where::time);
    ASSERT_EQ(found.steps.size(), 1U);
    EXPECT_EQ(found.steps[0].name(), "dither_residue");
    EXPECT_NEAR(found.steps[0].parameters[0].value, 37.3, 4.0 * found.steps[0].parameters[0].sd);
}

// A line that swings is no line of the library, and is beside nothing else.
TEST(LongClosureSampleSuite, WhatIsBesideALineOfNoNameIsNamed) {
    SampleTruth truth = short_record(6);
    truth.swinging_line = {8.0, 30.0, 0.2, 60.0};
    const auto alone = ringlock::closure::close_samples(generate_samples(truth));
    EXPECT_EQ(alone.verdict, ringlock::closure::Verdict::unexplained);
    EXPECT_TRUE(alone.steps.empty());
    truth.rates.bias_step = {5.0, 90.0};
    truth.dither_residue = {37.3, 0.0, 0.05, 1.0};
    const auto found = ringlock::closure::close_samples(generate_samples(truth));
    EXPECT_EQ(found.verdict, ringlock::closure::Verdict::unexplained);
    ASSERT_TRUE(found.unexplained);
    EXPECT_EQ(found.unexplained->where, ringlock::closure::Where::frequency);
    std::set<std::string> named;
    for (const auto& step : found.steps) named.insert(step.name());
    EXPECT_EQ(named, (std::set<std::string>{"bias_step", "dither_residue"}));
}

// A gyro that moves by rates that are known has nothing missing, and a scale factor's error is one of them alone.
TEST(LongClosureSampleSuite, KnownInputIsNoStructure) {
    SampleTruth truth;
    truth.size = 20000;
    truth.white_angle_arcsec = 0.2;
    truth.rates.quantum_noise_deg_rt_h = 0.01;
    truth.input_profile_deg_h = {{0.0, 60.0, 62.0, 130.0, 133.0, 210.0}, {200.0, 200.0, -300.0, -300.0, 50.0, 50.0}};
    EXPECT_EQ(ringlock::closure::close_samples(generate_samples(truth)).verdict,
              ringlock::closure::Verdict::nothing_missing);
    truth.scale_factor_error = 0.01;
    const auto found = ringlock::closure::close_samples(generate_samples(truth));
    ASSERT_EQ(found.steps.size(), 1U);
    EXPECT_EQ(found.steps[0].name(), "scale_factor_error");
    const auto& relative = found.steps[0].parameters.at(0);
    EXPECT_NEAR(relative.value, 0.01, 4.0 * relative.sd);
}

// A declared dither is looked for where it shows: what all frequencies and drifts would drown is named.
TEST(LongClosureSampleSuite, ADeclaredDitherNeedsLess) {
    SampleTruth truth;
    truth.size = 20000;
    truth.seed = 11;
    truth.white_angle_arcsec = 0.1;
    truth.rates.quantum_noise_deg_rt_h = 0.02;
    truth.dither_residue = {437.3, 0.0, 0.0075, 1.0};
    EXPECT_EQ(ringlock::closure::close_samples(generate_samples(truth)).verdict,
              ringlock::closure::Verdict::nothing_missing);
    truth.declared.emplace().dither_frequency_hz = 437.0;
    const auto found = ringlock::closure::close_samples(generate_samples(truth));
    ASSERT_EQ(found.steps.size(), 1U);
    EXPECT_EQ(found.steps[0].name(), "dither_residue");
    EXPECT_TRUE(found.steps[0].confounded_with.empty());
    EXPECT_NEAR(found.steps[0].parameters[0].value, 437.3, 4.0 * found.steps[0].parameters[0].sd);
}

// A random rate explains more than a ramp or a scale factor's error alone, but less than both.
TEST(LongClosureSampleSuite, TwoEffectsThatHideEachOtherAreNamed) {
    SampleTruth truth;
    truth.size = 20000;
    truth.white_angle_arcsec = 0.2;
    truth.rates.quantum_noise_deg_rt_h = 0.01;
    truth.input_profile_deg_h = {{0.0, 100.0, 101.0, 200.0}, {-150.0, -150.0, 150.0, 150.0}};
    truth.rates.bias_ramp_deg_h_per_h = -60.0;
    truth.scale_factor_error = 0.008;
    const auto found = ringlock::closure::close_samples(generate_samples(truth));
    ASSERT_EQ(found.steps.size(), 2U);
    for (const auto& step : found.steps) {
        EXPECT_TRUE(step.name() == "bias_ramp" || step.name() == "scale_factor_error") << step.name();
    }
    EXPECT_GT(found.log_likelihood_gain, 20.0);
}

// The largest standardised difference of means before and after, over all places but 0.6 % at either end: by
// simulation, which has places between which nothing is looked at. Three standard errors above.
TEST(SampleSteps, AreCountedAsABrownianBridge) {
    constexpr int records = 4000;
    constexpr std::size_t n = 1000;
    constexpr double chi2 = 9.0;
    constexpr double ends = 0.00625;
    std::mt19937_64 random(4);
    std::normal_distribution<double> normal;
    int above = 0;
    std::vector<double> sum(n + 1, 0.0);
    for (int k = 0; k < records; ++k) {
        for (std::size_t i = 0; i < n; ++i) sum[i + 1] = sum[i] + normal(random);
        double most = 0.0;
        for (std::size_t i = 1; i < n; ++i) {
            const double t = static_cast<double>(i) / n;
            if (t < ends || t > 1.0 - ends) continue;
            const double bridge = sum[i] - t * sum[n];
            most = std::max(most, bridge * bridge / (n * t * (1.0 - t)));
        }
        above += most > chi2 ? 1 : 0;
    }
    const double p = ringlock::closure::chi2_tail(chi2, 1) * ringlock::closure::look_elsewhere_of_step(chi2, ends);
    EXPECT_LT(above, records * p + 3.0 * std::sqrt(records * p));
    EXPECT_GT(above, 0.7 * records * p);
}

// Searches are counted as what they are worth: in noise alone each p-value is as rare as it says. Three standard errors
// above; a count ten times too large would leave none.
TEST(LongSampleLines, CountTheirSearches) {
    constexpr int records = 100;
    constexpr double p = 0.1;
    std::mt19937_64 random(3);
    std::normal_distribution<double> normal;
    std::array<int, 5> rare{};
    for (int k = 0; k < records; ++k) {
        std::vector<double> values(2100, 0.0);
        for (std::size_t i = 0; i < values.size(); ++i) {
            const double x = normal(random);
            if (i / 100 % 3 != 2) values[i] = x;
        }
        const auto lines = ringlock::closure::find_lines(values, 100.0);
        const auto narrow = ringlock::closure::find_lines_in(values, 100.0, {37.0, 2.0, 0.01});
        const std::array<double, 5> found = {lines.still.p_value, lines.slow.p_value, lines.likeliest().p_value,
                                             narrow.still.p_value, narrow.drifting.p_value};
        for (std::size_t j = 0; j < found.size(); ++j) rare[j] += found[j] < p ? 1 : 0;
    }
    for (const int count : rare) {
        EXPECT_LE(count, records * p + 3.0 * std::sqrt(records * p));
        EXPECT_GE(count, 1);
    }
}

// Where every p-value is nothing in double precision, it is the power that tells: fifteen cycles of drift, not the lobe
// of it that is strongest without.
TEST(SampleLines, OfStrongOnesTheStrongestIsTheLikeliest) {
    constexpr double rate_hz = 100.0;
    constexpr double drift_hz_per_s = 1.66e-4;
    std::mt19937_64 random(4);
    std::normal_distribution<double> normal;
    std::vector<double> values(30000);
    const auto phase = ringlock::closure::line_phase(values.size(), rate_hz,
                                                     ringlock::closure::FrequencyTrack::even(37.56, drift_hz_per_s));
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = normal(random) + 5.0 * std::cos(phase[i]);
    const auto lines = ringlock::closure::find_lines(values, rate_hz);
    ASSERT_EQ(lines.still.p_value, 0.0);
    const double a_cycle = std::pow(rate_hz / static_cast<double>(values.size()), 2);
    EXPECT_NEAR(lines.likeliest().drift_hz_per_s, drift_hz_per_s, 1.1 * a_cycle);
}

// Through power that pieces of the record have, with the phase lost from one to the next: the course is found to
// 0.03 cycles everywhere, by as many coefficients as that takes.
TEST(SampleLines, AreFollowedOnACurve) {
    using ringlock::closure::FrequencyTrack;
    constexpr double rate_hz = 100.0;
    constexpr std::size_t n = 60000;
    const FrequencyTrack truth{37.56, {6e-4, -3e-6, 1.5e-8, -6e-11, 2e-13}, 6};
    std::mt19937_64 random(6);
    std::normal_distribution<double> normal;
    const auto phase = ringlock::closure::line_phase(n, rate_hz, truth);
    std::vector<double> values(n);
    for (std::size_t i = 0; i < n; ++i) values[i] = normal(random) + std::cos(phase[i]);
    const auto lines = ringlock::closure::find_lines(values, rate_hz);
    const auto found = ringlock::closure::follow_bends(values, rate_hz, lines);
    // Half the values over 1.5, the variance with the line in it
    EXPECT_NEAR(found.chi2, 0.5 * n / 1.5, 3.0 * std::sqrt(2.0 * n));
    const auto off = [&](double t) {
        const double turns = found.track.turns(t) - truth.turns(t);
        return turns - std::round(turns);
    };
    for (double t = -295.0; t <= 295.0; t += 5.0) EXPECT_NEAR(off(t), 0.0, 0.03) << t;
    EXPECT_GT(found.track.free, 3U);
}

// By how many places the search over curves is counted: in noise alone what it finds is not rare.
TEST(LongSampleLines, SearchesOverCurvesAreCounted) {
    constexpr double rate_hz = 100.0;
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal;
    for (int k = 0; k < 20; ++k) {
        std::vector<double> values(20000);
        for (double& x : values) x = normal(random);
        auto lines = ringlock::closure::find_lines(values, rate_hz);
        lines.scattered_hz = 10.0 + k;
        const auto found = ringlock::closure::follow_bends(values, rate_hz, lines);
        const double cycles = 0.5 * static_cast<double>(values.size());
        const double places = ringlock::closure::look_elsewhere_of_track(found.chi2, cycles, found.track.free);
        EXPECT_GT(ringlock::closure::of_several(ringlock::closure::chi2_tail(found.chi2, 2), places), 0.01);
    }
}

// The filter's likelihood is that of the increments' covariance matrix: here by its Cholesky factor.
TEST(SampleFilter, LikelihoodIsThatOfTheCovariance) {
    using ringlock::closure::SampleFilter;
    ringlock::closure::SampleNoise noise;
    noise.angle_arcsec = 0.3;
    noise.rate_arcsec_rt_s = 0.8;
    noise.terms = {{0.2, 2.0}, {0.5, 0.4}, {5.0, 0.2}};
    constexpr int n = 60;
    constexpr double dt = 0.1;
    noise.walk_arcsec2_s3 = 0.7;
    // Angles at the ends, less that at the start: integrals of white, Markov and walking rates, and reading errors. The
    // walk begins one step of it from zero.
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
            const double s = dt * (std::min(i, j) + 1);
            const double t = dt * (std::max(i, j) + 1);
            covariance(i, j) = 0.64 * s + 0.09 * (i == j ? 2.0 : 1.0);
            covariance(i, j) += noise.walk_arcsec2_s3 * (s * s * (t / 2.0 - s / 6.0) + dt * s * t);
            for (const auto& term : noise.terms) {
                const double time = term.time_s;
                covariance(i, j) +=
                    term.variance_arcsec2_s2 * time * time *
                    (2.0 * s / time + std::exp(-s / time) + std::exp(-t / time) - 1.0 - std::exp((s - t) / time));
            }
        }
    }
    std::mt19937_64 random(3);
    std::normal_distribution<double> normal;
    std::vector<double> increments(n);
    Eigen::VectorXd angle(n);
    double sum = 0.0;
    for (int i = 0; i < n; ++i) angle(i) = sum += increments[static_cast<std::size_t>(i)] = normal(random);
    const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
    const Eigen::VectorXd white = factor.matrixL().solve(angle);
    double expected = 0.5 * white.squaredNorm();
    for (int i = 0; i < n; ++i) expected += std::log(factor.matrixL()(i, i));
    const std::vector<std::uint8_t> rows(n, 1);
    const auto likelihoods = SampleFilter::minus_log_likelihoods({&noise, 1}, dt, increments, rows);
    EXPECT_NEAR(likelihoods.front(), expected, 1e-6 * std::abs(expected));
    const SampleFilter filter(noise, n, dt);
    const auto e = filter.apply(increments);
    double applied = 0.0;
    for (std::size_t i = 0; i < e.size(); ++i) applied += 0.5 * e[i] * e[i] + std::log(filter.sd(i));
    EXPECT_NEAR(applied, expected, 1e-6 * std::abs(expected));
}

// Beside one another filters are what each is alone: far more of them than a vector has lanes, of different kinds, and
// of sources that pass a row at different times.
TEST(SampleFilter, ManyBesideOneAnotherAreWhatEachIsAlone) {
    using ringlock::closure::SampleFilter;
    using ringlock::closure::SampleNoise;
    constexpr std::size_t n = 3000;
    constexpr double dt = 0.01;
    std::vector<SampleNoise> noises;
    for (int k = 0; k < 24; ++k) {
        SampleNoise noise;
        noise.angle_arcsec = 0.3 + 0.01 * k;
        noise.rate_arcsec_rt_s = 0.8 - 0.02 * k;
        noise.terms = {{0.2 + 0.1 * k, 2.0}, {5.0, 0.2}};
        if (k % 3 > 0) noise.resonances = {{0.5, 7.0 + 0.5 * k, 0.3}};
        if (k % 4 == 1) noise.walk_arcsec2_s3 = 0.7;
        if (k % 4 == 2) {
            noise.from_hz = 125.0 + 3.0 * k;
            noise.from_phase = 0.03 * k;
            noise.blur_arcsec = 0.05;
        }
        if (k % 4 == 3) {
            noise.swing_hz = 3.0;
            noise.swing_cos = 0.2;
            noise.swing_sin = -0.1;
        }
        noises.push_back(noise);
    }
    std::mt19937_64 random(4);
    std::normal_distribution<double> normal;
    std::vector<double> increments(n);
    std::vector<std::uint8_t> rows(n, 1);
    for (double& increment : increments) increment = normal(random);
    for (std::size_t i = 500; i < 700; ++i) rows[i] = 0;
    const auto values = SampleFilter::minus_log_likelihoods(noises, dt, increments, rows);
    ASSERT_EQ(values.size(), noises.size());
    for (std::size_t k = 0; k < noises.size(); ++k) {
        const SampleFilter filter(noises[k], n, dt);
        const auto e = filter.apply(increments);
        double expected = 0.0;
        for (std::size_t i = 0; i < n; ++i) {
            if (rows[i]) expected += 0.5 * e[i] * e[i] + std::log(filter.sd(i));
        }
        EXPECT_NEAR(values[k], expected, 1e-7 * std::abs(expected)) << k;
    }
}

}  // namespace
}  // namespace samples_suite_test
}  // namespace ringlock::test::closure
