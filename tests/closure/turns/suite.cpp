// A small part of the bench of the closed loop (bench_closure.cpp), and what it stands on.
#include "tests/closure/suite/suite.hpp"

#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <algorithm>
#include <boost/random/mersenne_twister.hpp>
#include <boost/random/normal_distribution.hpp>
#include <cmath>
#include <map>
#include <numbers>
#include <string>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/two_levels.hpp"
#include "analysis/closure/stats/two_states.hpp"
#include "analysis/closure/turns/fit/fitted.hpp"
#include "analysis/closure/turns/screen/dither_shape.hpp"
#include "tests/closure/generator/generator.hpp"

namespace ringlock::test::closure {
namespace turns_suite_test {
namespace {

constexpr std::size_t turns = 8000;
constexpr double duration_s = 32.0;

std::vector<Outcome> judged(const std::vector<Case>& cases) {
    const auto records = make(cases);
    std::vector<Outcome> outcomes;
    for (std::size_t k = 0; k < cases.size(); ++k) outcomes.push_back(judge(cases[k], records[k]));
    return outcomes;
}

TEST(LongClosureSuite, NamesNothingInRecordsWithoutAnything) {
    std::vector<Case> cases;
    for (const Condition& condition : conditions) {
        cases.push_back({.truth = {}, .condition = &condition, .seed = 300 + cases.size(), .turns = turns});
    }
    cases[1].direct = true;
    for (const Outcome& outcome : judged(cases)) {
        EXPECT_EQ(outcome.judged, Judged::right) << outcome.verdict << " " << outcome.named;
        // The same model from another start: fits end within a fraction of their standard errors.
        EXPECT_NEAR(outcome.after / outcome.oracle, 1.0, 1e-2);
        EXPECT_FALSE(outcome.deviations.empty());
    }
}

TEST(LongClosureSuite, NamesWhatIsFourTimesItsLimit) {
    std::vector<Case> cases;
    const auto add = [&](const char* effect, double size, std::size_t condition) {
        Case of{.kind = Kind::single, .truth = {}, .multiple = 4.0, .condition = &conditions[condition]};
        of.seed = 320 + cases.size();
        of.turns = turns;
        of.truth = {draw(effect, 4.0 * size, of.seed, duration_s)};
        settle(of);
        cases.push_back(std::move(of));
    };
    add("bias_step", 3e-4, 0);
    add("lockin_turn_asymmetry", 0.05, 1);
    add("scale_factor_error", 3e-6, 2);
    add("missed_counts", 2e-3, 3);
    cases[0].direct = true;
    for (const Outcome& outcome : judged(cases)) {
        EXPECT_TRUE(outcome.judged == Judged::right || outcome.judged == Judged::tie)
            << outcome.verdict << " " << outcome.named;
        EXPECT_NEAR(outcome.after / outcome.oracle, 1.0, 0.02);
    }
}

std::shared_ptr<ringlock::closure::Fitted> fitted_to_all(const record::Record& record,
                                                         const ringlock::closure::TurnParameters& start) {
    return ringlock::closure::TurnProblem(record, ringlock::closure::Rows(record.turns->size(), 1)).fit(start);
}

TEST(ClosureSuite, AnswersAreJudgedStepByStep) {
    const std::vector<Added> both = {{"dither_residue", {}}, {"base_vibration", {}}};
    const auto judged_as = [&](std::vector<ringlock::closure::Step> steps, const std::vector<Added>& truth) {
        ringlock::closure::Closure closure;
        closure.verdict = ringlock::closure::Verdict::closed;
        closure.steps = std::move(steps);
        Outcome outcome;
        compare(closure, std::nullopt, truth, outcome);
        return outcome;
    };
    const auto step = [](const char* effect, const std::vector<std::string>& others) {
        ringlock::closure::Step of;
        of.effect = effects::find(effect);
        for (const std::string& other : others) of.confounded_with.push_back(effects::find(other));
        return of;
    };
    const auto vibration = step("base_vibration", {"dither_residue"});
    EXPECT_EQ(judged_as({vibration, vibration}, both).judged, Judged::tie);
    EXPECT_THAT(judged_as({vibration}, both).missing, testing::ElementsAre("dither_residue"));
    EXPECT_EQ(judged_as({step("base_vibration", {}), step("dither_residue", {})}, both).judged, Judged::right);
    EXPECT_EQ(judged_as({vibration, step("base_vibration", {})}, both).judged, Judged::tie);
    // Two that may stand in place of another together.
    const auto walk = step("rate_random_walk", {"dither_residue", "base_vibration"});
    EXPECT_EQ(judged_as({walk}, both).judged, Judged::tie);
    const Outcome wrong = judged_as({vibration, step("bias_ramp", {})}, both);
    EXPECT_EQ(wrong.judged, Judged::wrong);
    EXPECT_TRUE(wrong.false_name);
}

TEST(LongClosureSuite, SizesComeFromTheRecordsInformation) {
    // Information goes with the number of turns, and for a ramp with the fourth power of the time beside it.
    const auto limit = [](std::size_t count) {
        Case of{.kind = Kind::single, .truth = {}, .multiple = 1.0, .condition = &conditions[0], .seed = 340};
        of.turns = count;
        of.truth = {draw("lockin_turn_asymmetry", 2e-3, of.seed, duration_s)};
        settle(of);
        return std::abs(of.truth[0].values.at("ratio"));
    };
    EXPECT_NEAR(limit(4000) / limit(16000), 2.0, 0.4);
}

TEST(LongClosureSuite, SizesFollowPhasesThatAreForetoldAlike) {
    // This gyro's phases are foretold alike turn after turn, so that the noise of 3 rad decides both how large an
    // innovation is and at which phase it ends; without that in the test four of these draws are below 1e-3.
    double product = 1.0;
    constexpr int draws = 8;
    for (int k = 0; k < draws; ++k) {
        Case of{.kind = Kind::null, .truth = {}, .condition = &conditions[3], .seed = 1862};
        of.noise = static_cast<std::uint64_t>(k);
        const auto closure = ringlock::closure::close_loop(make({&of, 1}).front());
        for (const auto& test : closure.tests) {
            if (test.subject != "size of the residual over the turn's phase") continue;
            EXPECT_GT(test.p_value, 1e-3) << k;
            product *= test.p_value;
        }
    }
    // Fisher: minus twice the logarithm is chi-squared with twice as many degrees of freedom; one in 1000 is above 39.
    EXPECT_LT(-2.0 * std::log(product), 39.3);
    EXPECT_LT(product, 1.0);
}

// In a locked gyro bias, threshold and the coupling's phase move together, as do the amplitudes of its harmonics.
TEST(LongClosureSuite, ADetectorsPhaseIsFoundAlongWithTheThreshold) {
    Case of{.kind = Kind::single, .truth = {}, .multiple = 2.0, .condition = &conditions[0], .seed = 1037};
    of.truth = {{"detector_phase_offset", {{"phase_rad", 0.25677}}}};
    const Outcome outcome = judged({of}).front();
    EXPECT_EQ(outcome.judged, Judged::tie) << outcome.verdict << " " << outcome.named;
    EXPECT_EQ(outcome.named, "detector_phase_offset~lockin_second_harmonic");
}

/// What the columns beside the phase tell of the dither's shape in the record of a case.
ringlock::closure::DitherShape shape_of(const Case& of) {
    const record::Record record = make({&of, 1}).front();
    const auto fitted = fitted_to_all(record, {});
    return ringlock::closure::dither_shape(*record.turns, *fitted->fit);
}

// A gyro that moves and whose turns do not meet all phases alike: what times and accelerations follow of the phase, by
// pulses of quarter fringes, was not all taken away, and a second harmonic was called an asymmetry.
TEST(LongClosureSuite, AShapeOfTheDitherIsNotCalledAnother) {
    Case of{.kind = Kind::single, .truth = {}, .multiple = 30.0, .condition = &conditions[2], .seed = 1887};
    of.truth = {{"dither_second_harmonic", {{"ratio", 6.3363e-4}, {"phase_rad", 1.3093}}}};
    EXPECT_EQ(of.condition->injected_rad, 0.0);
    EXPECT_TRUE(of.condition->moving);
    const auto shape = shape_of(of);
    const double sine = 6.3363e-4 * std::sin(1.3093);
    EXPECT_NEAR(shape.sides->value, -shape.sides_by_sine * sine, 4.0 * shape.sides->sd);
    EXPECT_LT(shape.sides->sd, 2e-5);
    EXPECT_NEAR(shape.turns->value, 6.3363e-4 * std::cos(1.3093), 4.0 * shape.turns->sd);
    EXPECT_LT(shape.turns->sd, 5e-5);
    const Outcome outcome = judged({of}).front();
    EXPECT_EQ(outcome.judged, Judged::right) << outcome.verdict << " " << outcome.named;
}

/// Logarithm of the acceleration, over the true one of 1, by the two pulses of quarter fringes on one side of a minimum
/// where the phase stands still at psi: delta' = t + b (sin(psi + delta) - sin psi), by Runge and Kutta.
double acceleration_by_pulses(double psi, double b, int side) {
    constexpr double quarter = 0.5 * std::numbers::pi;
    const double first = (std::ceil(psi / quarter) - psi / quarter) * quarter;
    const double step = 1e-3 * side;
    const auto rate = [&](double t, double delta) { return t + b * (std::sin(psi + delta) - std::sin(psi)); };
    double t = 0.0;
    double delta = 0.0;
    double times[2];
    for (std::size_t pulse = 0; pulse < 2;) {
        const double k1 = rate(t, delta);
        const double k2 = rate(t + 0.5 * step, delta + 0.5 * step * k1);
        const double k3 = rate(t + 0.5 * step, delta + 0.5 * step * k2);
        const double next = delta + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(t + step, delta + step * k3));
        const double target = first + static_cast<double>(pulse) * quarter;
        // Within a step the phase is as good as a parabola.
        if (next >= target) {
            const double r = k1 * side;
            times[pulse++] = std::abs(t) + 2.0 * (target - delta) / (r + std::sqrt(r * r + 2.0 * (target - delta)));
            continue;
        }
        delta = next;
        t += step;
    }
    const double root = std::numbers::sqrt2 * (std::sqrt(first + quarter) - std::sqrt(first)) / (times[1] - times[0]);
    return 2.0 * std::log(root);
}

// The 0.145 of dither_shape: turns is half the sum of a quarter of both logarithms over minima, less that over maxima.
TEST(DitherShape, AccelerationsComeOutTooSmallOfSecondOrder) {
    for (const double b : {0.1, 0.2}) {
        constexpr int phases = 64;
        double both = 0.0;
        double sides = 0.0;
        for (int k = 0; k < phases; ++k) {
            const double psi = (k + 0.5) * 2.0 * std::numbers::pi / phases;
            const double after = acceleration_by_pulses(psi, b, 1);
            const double before = acceleration_by_pulses(psi, b, -1);
            both += 0.5 * 0.25 * (after + before) / phases;
            sides += std::pow(0.25 * (after - before), 2) / phases;
        }
        EXPECT_NEAR(both / sides, -0.145, 0.002) << b;
    }
}

// What a strong harmonic does to the gains of the filter is a rotation: steps that left it out crept, and gave up short
// of the summit.
TEST(LongClosureSuite, AStrongSecondHarmonicIsFoundBehindAStep) {
    Truth truth;
    truth.scale_factor_arcsec = 0.60439;
    truth.lockin_threshold_deg_h = 222.81;
    truth.dither_frequency_hz = 218.3394;
    truth.dither_peak_rate_deg_s = 82.035;
    truth.bias_deg_h = 0.9378;
    truth.initial_phase_rad = 0.7;
    truth.input_rate_deg_h = 235.393;
    truth.readout_noise = 0.01;
    truth.lockin_second_harmonic = {0.2, -1.5};
    truth.rates.bias_step = {0.01996459, 14.656};
    truth.turns = 16000;
    truth.seed = 18;
    truth.declared = record::Declared{};
    truth.declared->scale_factor_arcsec = truth.scale_factor_arcsec;
    truth.declared->lockin_threshold_deg_h = 235.956;
    truth.declared->input_rate_deg_h = truth.input_rate_deg_h;
    const auto closure = ringlock::closure::close_loop(generate({&truth, 1}).front());
    EXPECT_EQ(closure.verdict, ringlock::closure::Verdict::closed);
    EXPECT_THAT(closure.steps, testing::UnorderedElementsAre(
                                   testing::Property(&ringlock::closure::Step::name, "bias_step"),
                                   testing::Property(&ringlock::closure::Step::name, "lockin_second_harmonic")));
}

// The phase turns faster than a sine of the counted swing: a rotation moves zero-rate points by less.
TEST(LongClosureSuite, AThirdHarmonicOfTheDitherIsNoOtherShape) {
    Truth truth;
    truth.scale_factor_arcsec = 0.55;
    truth.dither_frequency_hz = 310.0;
    truth.dither_peak_rate_deg_s = 130.0;
    truth.input_rate_deg_h = 300.0;
    truth.readout_noise = 0.005;
    truth.turns = 5000;
    truth.seed = 815;
    truth.dither_third_harmonic = 0.003;
    const record::Record record = generate({&truth, 1}).front();
    const auto fitted = fitted_to_all(record, {});
    const auto shape = ringlock::closure::dither_shape(*record.turns, *fitted->fit);
    EXPECT_NEAR(shape.even->value, 3.0 * 0.003 - 0.003 / 3.0, 4.0 * shape.even->sd);
    EXPECT_LT(shape.even->sd, 3e-4);
    const auto closure = ringlock::closure::close_loop(record);
    EXPECT_EQ(closure.verdict, ringlock::closure::Verdict::nothing_missing);
    EXPECT_THAT(closure.notes, testing::Contains(testing::HasSubstr("third harmonic of the dither's rate of 0.3")));
}

// A lock-in of which much is at minima makes their accelerations smaller, of second order.
TEST(LongClosureSuite, AStrongLockInIsNoShapeOfTheDither) {
    Case of{.kind = Kind::several, .truth = {}, .multiple = 5.0, .condition = &other_gyro, .seed = 2092};
    of.truth = {{"missed_counts", {{"probability_per_turn", 0.0053584}}},
                {"bias_temperature", {{"deg_h_per_k", 0.062808}}},
                {"lockin_turn_asymmetry", {{"ratio", 0.085593}}}};
    const Outcome outcome = judged({of}).front();
    EXPECT_EQ(outcome.judged, Judged::right) << outcome.verdict << " " << outcome.named;
    // Detectors of 2 % noise: times that do not follow the lock-in all the way were not those of the phase.
    const Case plain{.kind = Kind::other, .truth = {}, .multiple = 0.0, .condition = &other_gyro, .seed = 1998};
    const auto shape = shape_of(plain);
    EXPECT_LT(std::abs(shape.late_s.value), 3.0 * shape.late_s.sd);
    EXPECT_EQ(judged({plain}).front().verdict, "nothing_missing");
}

TEST(LongClosureSuite, ASecondHarmonicIsFollowedToItsSummit) {
    Case of{.kind = Kind::single, .truth = {}, .multiple = 6.0, .condition = &conditions[0], .direct = true};
    of.seed = 1792;
    of.truth = {{"lockin_second_harmonic", {{"ratio", 0.025017}, {"phase_rad", 0.44522}}}};
    const Outcome outcome = judged({of}).front();
    EXPECT_EQ(outcome.judged, Judged::right) << outcome.verdict << " " << outcome.named;
}

TEST(LongClosureSuite, ThreeSlowEffectsAreNoRandomWalk) {
    // A random walk follows them better than any two of them do.
    Case of{.kind = Kind::several, .truth = {}, .multiple = 10.0, .condition = &other_gyro, .seed = 1055};
    of.truth = {{"bias_step", {{"step_deg_h", -0.14406}, {"time_s", 6.7773}}},
                {"bias_temperature", {{"deg_h_per_k", -0.05246}}},
                {"bias_ramp", {{"deg_h_per_h", -67.082}}}};
    const Outcome outcome = judged({of}).front();
    EXPECT_EQ(outcome.judged, Judged::right) << outcome.verdict << " " << outcome.named;
}

TEST(LongClosureSuite, AStepHidesBesideTwoRandomRates) {
    // With both of them in the model nothing of it is left but a jump.
    Case of{.kind = Kind::several, .truth = {}, .multiple = 10.0, .condition = &other_gyro, .seed = 1037};
    of.truth = {{"bias_instability", {{"deg_h", 0.0052609}}},
                {"rate_random_walk", {{"deg_h_rt_h", 0.60336}}},
                {"bias_step", {{"step_deg_h", -0.035429}, {"time_s", 9.0143}}}};
    const Outcome outcome = judged({of}).front();
    EXPECT_TRUE(outcome.judged == Judged::right || outcome.judged == Judged::tie)
        << outcome.verdict << " " << outcome.named;
}

TEST(LongClosureSuite, ALineAndASecondHarmonicAreNotSomethingElse) {
    // Of either alone kicks at harmonics of the phase explain more.
    Case of{.kind = Kind::several, .truth = {}, .multiple = 5.0, .condition = &other_gyro, .seed = 1001039};
    of.truth = {{"rate_random_walk", {{"deg_h_rt_h", 0.022854}}},
                {"lockin_second_harmonic", {{"ratio", 0.0069212}, {"phase_rad", 0.18909}}},
                {"base_vibration", {{"frequency_hz", 0.50646}, {"rate_deg_h", 0.00035372}, {"phase_rad", 2.3743}}}};
    const Outcome outcome = judged({of}).front();
    EXPECT_TRUE(outcome.judged == Judged::right || outcome.judged == Judged::tie)
        << outcome.verdict << " " << outcome.named;
}

TEST(LongClosureSuite, NothingOutsideTheLibraryHasItsName) {
    std::vector<Case> all = foreign_cases(1);
    ASSERT_EQ(all.size(), 6U);
    for (Case& of : all) of.turns = turns;
    const std::vector<Outcome> outcomes = judged(all);  // the generator takes all of them at a time
    for (std::size_t k = 0; k < all.size(); ++k) {
        EXPECT_FALSE(outcomes[k].false_name)
            << all[k].truth_text() << ": " << outcomes[k].verdict << " " << outcomes[k].named;
        EXPECT_TRUE(std::isnan(outcomes[k].oracle));
    }
}

TEST(LongClosureSuite, WhatFollowsThePhaseIsNoVibration) {
    // Kicks at three times the phase come at three times their beat, 18.17 Hz, where a line explains more than kicks of
    // first order do.
    Case of{.kind = Kind::foreign, .truth = {}, .condition = &conditions[0], .direct = true, .seed = 50030};
    of.foreign = {{"lockin_third_harmonic", {{"ratio", 0.10778}, {"phase_rad", 2.7158}}}};
    of.where = ringlock::closure::Where::phase;
    const Outcome outcome = judged({of}).front();
    EXPECT_EQ(outcome.judged, Judged::right) << outcome.verdict << " " << outcome.named;
    EXPECT_FALSE(outcome.false_name) << outcome.named;
}

TEST(LongClosureSuite, ALockInThatDriftsIsNoRandomRate) {
    // Kicks of a threshold that is not the mean one add up to a walk beside injected noise.
    Case of{.kind = Kind::foreign, .truth = {}, .condition = &conditions[1], .direct = true, .seed = 7};
    of.foreign = {{"lockin_swing", {{"ratio", 0.3}, {"period_s", 120.0}}}};
    of.where = ringlock::closure::Where::time;
    const Outcome outcome = judged({of}).front();
    EXPECT_EQ(outcome.judged, Judged::right) << outcome.verdict << " " << outcome.named << " " << outcome.where;
}

TEST(LongClosureSuite, AnEffectOfTheCouplingIsNamedBesideItsLine) {
    // Beside a ramp what the detectors' phase adds is a line at the beat, 19.61 Hz, that explains more than either.
    Case of{.kind = Kind::several, .truth = {}, .multiple = 30.0, .condition = &other_gyro, .seed = 2124};
    of.truth = {{"dither_asymmetry", {{"ratio", -7.2793e-05}}},
                {"detector_phase_offset", {{"phase_rad", 0.030307}}},
                {"bias_ramp", {{"deg_h_per_h", -0.016693}}}};
    const Outcome outcome = judged({of}).front();
    EXPECT_EQ(outcome.judged, Judged::right) << outcome.verdict << " " << outcome.named;
}

TEST(LongClosureSuite, TwoRatesAreNotOneRandomRate) {
    // A random rate follows a ramp and a temperature at once, better than either of them does.
    Case of{.kind = Kind::pair, .truth = {}, .multiple = 4.0, .condition = &conditions[2], .seed = 350, .turns = turns};
    of.truth = {draw("bias_ramp", 4.0 * start_size("bias_ramp"), of.seed, duration_s),
                draw("bias_temperature", 4.0 * start_size("bias_temperature"), of.seed, duration_s)};
    ASSERT_TRUE(settle(of));
    const Outcome outcome = judged({of}).front();
    EXPECT_TRUE(outcome.judged == Judged::right || outcome.judged == Judged::tie)
        << outcome.verdict << " " << outcome.named;
}

TEST(LongClosureSuite, OneSummitOfTheLikelihoodWhateverTheStart) {
    // Without injected noise there are two: a little of it, or none. Records in which a climb alone stays on the lower
    // one, by 5 and 21.
    for (const std::uint64_t seed : {363U, 368U}) {
        Case of{.truth = {}, .condition = &conditions[0], .seed = seed, .turns = turns};
        of.truth = {{"quantum_noise", {{"deg_rt_h", 4e-7}}}};
        const record::Record record = make({&of, 1}).front();
        std::vector<double> found;
        for (const double injected_rad : {0.0, 1e-8, 1e-4, 1e-2}) {
            ringlock::closure::TurnParameters start;
            if (injected_rad > 0.0) {
                start.injected_sd_rad = injected_rad;
                start.wander_sd_rad = 1e-6;
                start.readout_sd_rad = 0.005;
                start.threshold_deg_h = 300.0;
            }
            const auto fitted = fitted_to_all(record, start);
            found.push_back(fitted->fit->log_likelihood());
        }
        const double highest = *std::max_element(found.begin(), found.end());
        for (const double other : found) EXPECT_NEAR(other, highest, 0.1) << seed;
    }
}

// In a minute a line of 70 Hz goes through thousands of cycles: its phases follow from its frequency in straight lines
// for parts of a millionth of that only. Phase at the start and frequency have errors of sqrt(8/n) and sqrt(24/n)/T
// over the noise-to-signal ratio (Rife and Boorstyn, IEEE Trans. Information Theory 20, 1974, 591, time from the
// start).
TEST(ClosureSuite, AFastLineHasTheErrorsOfALine) {
    Case of{.truth = {}, .condition = &conditions[1], .seed = 5, .turns = turns};
    of.truth = {{"base_vibration", {{"frequency_hz", 70.3}, {"rate_deg_h", 200.0}, {"phase_rad", 0.9}}}};
    const record::Record record = make({&of, 1}).front();
    const double length_s = record.turns->time_s.back() - record.turns->time_s.front();
    const ringlock::closure::ActiveEffect line{
        effects::find("base_vibration"),
        {{"frequency_hz", 70.3 + 0.1 / length_s}, {"rate_deg_h", 180.0}, {"phase_rad", 0.7}}};
    ringlock::closure::TurnParameters start;
    start.effects.push_back(line);
    const auto fitted = fitted_to_all(record, start);
    std::map<std::string, ringlock::closure::Estimate> found;
    for (const ringlock::closure::Estimate& estimate : fitted->fit->estimates()) found[estimate.name] = estimate;
    const auto& frequency = found.at("frequency_hz");
    EXPECT_NEAR(frequency.value, 70.3, 3.0 * frequency.sd);
    EXPECT_NEAR(units::two_pi * length_s * frequency.sd / found.at("phase_rad").sd, std::sqrt(3.0), 0.02);
}

TEST(RandomRates, MayLookLikeARamp) {
    // A random walk by its modes, of which the first is nearly a ramp: variances S/k^2 beside noise of one. The ramp
    // takes the first as it is, the walk is likeliest at some S.
    constexpr int modes = 40;
    constexpr int draws = 20000;
    constexpr double seen = 8.0;  // nats
    constexpr int sizes = 60;
    Eigen::MatrixXd taken(sizes, modes);
    Eigen::VectorXd cost = Eigen::VectorXd::Zero(sizes);
    for (int s = 0; s < sizes; ++s) {
        for (int k = 0; k < modes; ++k) {
            const double variance = 1.0 + std::exp(-3.0 + 0.25 * s) / ((k + 1.0) * (k + 1.0));
            taken(s, k) = 0.5 * (1.0 - 1.0 / variance);
            cost(s) += 0.5 * std::log(variance);
        }
    }
    boost::random::mt19937_64 generator(2);
    boost::random::normal_distribution<double> normal;
    double most_by_four = 0.0;
    for (const double size : {10.0, 20.0, 40.0, 80.0, 160.0}) {
        double shown = 0.0;
        double by_four = 0.0;
        double by_more = 0.0;
        Eigen::VectorXd squares(modes);
        for (int draw = 0; draw < draws; ++draw) {
            for (int k = 0; k < modes; ++k) {
                squares(k) = (1.0 + size / ((k + 1.0) * (k + 1.0))) * std::pow(normal(generator), 2);
            }
            const double ramp = 0.5 * squares(0);
            const double walk = std::max(0.0, (taken * squares - cost).maxCoeff());
            if (std::max(ramp, walk) < seen) continue;
            shown += 1.0;
            by_four += ramp - walk > ringlock::closure::options.tie ? 1.0 : 0.0;
            by_more += ramp - walk > ringlock::closure::options.tie_with_random ? 1.0 : 0.0;
        }
        EXPECT_LT(by_more / shown, ringlock::closure::options.level) << size;
        most_by_four = std::max(most_by_four, by_four / shown);
    }
    EXPECT_NEAR(most_by_four, 0.05, 0.01);
}

TEST(TwoLevels, FindsTheCourseAndCountsItsJumps) {
    // Rates of 60 stretches, each known to within one, that jump three times by eight.
    const Eigen::Index n = 60;
    Eigen::VectorXd rate(n);
    std::uint64_t state = 1;
    for (Eigen::Index k = 0; k < n; ++k) {
        double noise = -6.0;  // twelve uniform numbers
        for (int j = 0; j < 12; ++j) {
            state = state * 6364136223846793005U + 1442695040888963407U;
            noise += static_cast<double>(state >> 11) * 0x1.0p-53;
        }
        rate(k) = noise + (k >= 10 && k < 25 ? 8.0 : 0.0) + (k >= 44 ? 8.0 : 0.0);
    }
    Eigen::MatrixXd free = Eigen::MatrixXd::Identity(n, n);
    free.array() -= 1.0 / static_cast<double>(n);
    const auto found = ringlock::closure::two_levels(free, free * rate);
    EXPECT_EQ(found.changes, 3);
    EXPECT_LT(found.p_value, 1e-30);
    for (Eigen::Index k = 1; k < n; ++k) {
        EXPECT_EQ(found.shape(k) != found.shape(k - 1), k == 10 || k == 25 || k == 44) << k;
    }
}

TEST(TwoLevels, SeesNoJumpsInNoise) {
    const Eigen::Index n = 60;
    const Eigen::MatrixXd normal = Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd noise(n);
    for (Eigen::Index k = 0; k < n; ++k) noise(k) = std::sin(7.0 * static_cast<double>(k * k));
    const auto found = ringlock::closure::two_levels(normal, noise);
    EXPECT_EQ(found.changes, 0);
    EXPECT_EQ(found.p_value, 1.0);
}

TEST(TwoLevels, EndsWhateverItIsGiven) {
    const Eigen::Index n = 60;
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(n);
    const auto of_nothing = ringlock::closure::two_levels(Eigen::MatrixXd::Identity(n, n), ones * std::nan(""));
    EXPECT_EQ(of_nothing.changes, 0);
    EXPECT_EQ(of_nothing.p_value, 1.0);
    // Stretches that show next to nothing beside what is asked of them: all that is gained is rounding.
    const Eigen::VectorXd along = Eigen::VectorXd::LinSpaced(n, -1.0, 1.0);
    Eigen::VectorXd rate(n);
    for (Eigen::Index k = 0; k < n; ++k) rate(k) = 1e9 * std::sin(7.0 * static_cast<double>(k * k));
    EXPECT_TRUE(std::isfinite(ringlock::closure::two_levels(along * along.transpose(), rate).p_value));
}

// All courses of eight stretches one by one, each as likely as its steps and as what it is held against.
TEST(TwoStates, AreSummedOverAllCourses) {
    const Eigen::Index n = 8;
    Eigen::MatrixXd normal = 3.0 * Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd right(n);
    Eigen::VectorXd shape(n);
    for (Eigen::Index k = 0; k < n; ++k) {
        right(k) = 1.0 + 2.0 * std::sin(1.0 + 7.0 * static_cast<double>(k * k));
        shape(k) = right(k) > 1.0 ? 1.0 : 0.0;
        if (k + 1 < n) normal(k, k + 1) = normal(k + 1, k) = -0.4 + 0.05 * static_cast<double>(k);
    }
    const auto found = ringlock::closure::two_states(normal, right, shape);
    const auto gain = [&](const ringlock::closure::TwoStates& states) {
        double sum = 0.0;
        for (unsigned path = 0; path < 1U << n; ++path) {
            Eigen::VectorXd rate(n);
            double chance = 0.5;
            const auto upper = [&](Eigen::Index k) { return (path >> k & 1U) != 0; };
            for (Eigen::Index k = 0; k < n; ++k) {
                rate(k) = states.rate + (upper(k) ? states.step : 0.0);
                if (k == 0) continue;
                const double leaves = upper(k - 1) ? states.down : states.up;
                chance *= upper(k) == upper(k - 1) ? 1.0 - leaves : leaves;
            }
            sum += chance * std::exp(right.dot(rate) - 0.5 * rate.dot(normal * rate));
        }
        return std::log(sum);
    };
    EXPECT_NEAR(found.gain, gain(found), 1e-9);
    // And none near it has more.
    for (const double more : {-0.05, 0.05}) {
        for (double ringlock::closure::TwoStates::*number :
             {&ringlock::closure::TwoStates::rate, &ringlock::closure::TwoStates::step,
              &ringlock::closure::TwoStates::up, &ringlock::closure::TwoStates::down}) {
            auto other = found;
            other.*number *= 1.0 + more;
            if (other.up > 0.5 || other.down > 0.5) continue;
            EXPECT_LT(gain(other), found.gain + 1e-3);
        }
    }
}

// What the search of a single course must pay for the places of many jumps it need not.
TEST(TwoStates, ManyJumpsCostLessThanTheirPlaces) {
    const Eigen::Index n = 120;
    boost::random::mt19937_64 random(4);
    boost::random::normal_distribution<double> normal;
    Eigen::VectorXd right(n);
    double state = 0.0;
    for (Eigen::Index k = 0; k < n; ++k) {
        if (normal(random) > 0.8416) state = 4.0 - state;  // one in five
        right(k) = state - 2.0 + normal(random);
    }
    const Eigen::MatrixXd each = Eigen::MatrixXd::Identity(n, n);
    const auto path = ringlock::closure::two_levels(each, right);
    ASSERT_GT(path.changes, 5);
    const auto states = ringlock::closure::two_states(each, right, path.shape);
    EXPECT_GT(states.gain, path.evidence + 2.0 * path.changes);
    EXPECT_NEAR(states.step, 4.0, 0.6);
    EXPECT_NEAR(states.up, 0.2, 0.12);
}

}  // namespace
}  // namespace turns_suite_test
}  // namespace ringlock::test::closure
