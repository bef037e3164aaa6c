// Verdict, advice on ties, training rows and levels, from models that are made up.
#include "analysis/closure/decide/verdict.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/decide/rows.hpp"
#include "analysis/closure/options.hpp"

namespace ringlock::test::closure {
namespace decide_verdict_test {
namespace {

using ringlock::closure::Closure;
using ringlock::closure::experiment_for;
using ringlock::closure::options;
using ringlock::closure::ResidualTest;
using ringlock::closure::Step;
using ringlock::closure::training_rows;
using ringlock::closure::Verdict;
using ringlock::closure::verdict_of;
using ringlock::closure::Where;
using testing::HasSubstr;

TEST(Verdict, FollowsFromStepsAndResidual) {
    Closure closure;
    EXPECT_EQ(verdict_of(closure), Verdict::nothing_missing);
    closure.steps.emplace_back().effect = effects::find("bias_step");
    EXPECT_EQ(verdict_of(closure), Verdict::closed);
    closure.unexplained = ResidualTest{Where::time, "a test", 1e-9, ""};
    EXPECT_EQ(verdict_of(closure), Verdict::unexplained);
    closure.steps.clear();
    EXPECT_EQ(verdict_of(closure), Verdict::unexplained);
}

// The advice changes the quantity that the tied effects have in common; it goes by what an effect follows, and not by
// which of them leads.
TEST(Advice, GoesByWhatTiedEffectsFollow) {
    const auto* ramp = effects::find("bias_ramp");
    const auto* temperature = effects::find("bias_temperature");
    EXPECT_THAT(experiment_for(*ramp, {temperature}), HasSubstr("temperature that does not follow time"));
    EXPECT_EQ(experiment_for(*temperature, {ramp}), experiment_for(*ramp, {temperature}));
    EXPECT_THAT(experiment_for(*ramp, {effects::find("scale_factor_error")}), HasSubstr("three input rates"));
    EXPECT_THAT(experiment_for(*effects::find("dither_asymmetry"), {effects::find("dither_second_harmonic")}),
                HasSubstr("accelerations"));
    EXPECT_THAT(experiment_for(*effects::find("base_vibration"), {effects::find("dither_residue")}),
                HasSubstr("another dither frequency"));
    EXPECT_THAT(experiment_for(*effects::find("detector_phase_offset"), {effects::find("lockin_second_harmonic")}),
                HasSubstr("more injected noise"));
    EXPECT_THAT(experiment_for(*ramp, {effects::find("rate_random_walk")}), HasSubstr("for longer"));
    EXPECT_THAT(experiment_for(*effects::find("bias_step"), {effects::find("mode_hop")}),
                HasSubstr("record the turns"));
}

TEST(TrainingRows, HoldOutATenthInContiguousBlocks) {
    constexpr std::size_t rows = 4000;
    const auto training = training_rows(rows);
    const auto count = std::accumulate(training.begin(), training.end(), std::size_t{0});
    EXPECT_EQ(count, rows / 10 * 9);
    std::size_t changes = 0;
    for (std::size_t i = 1; i < rows; ++i) changes += training[i] != training[i - 1] ? 1 : 0;
    // Each of the four held-out blocks begins and ends once; none stands at an end of the record.
    EXPECT_EQ(changes, 2 * options.blocks / options.blocks_in_a_row);
}

TEST(Evidence, OneEffectOfTheLibraryPassesAtItsShareOfTheLevel) {
    const auto library = static_cast<double>(effects::registry().size());
    const double level = options.level_of_effects / library;
    EXPECT_TRUE(ringlock::closure::passes(0.99 * level));
    EXPECT_FALSE(ringlock::closure::passes(1.01 * level));
    // All effects together keep the level: 1 - (1 - p)^n <= n p.
    EXPECT_LE(1.0 - std::pow(1.0 - level, library), options.level_of_effects);
    EXPECT_NEAR(ringlock::closure::cost_of_choice(), std::log(library), 1e-12);
}

TEST(Evidence, AGainIsJudgedByAllFreeParameters) {
    // A chi-squared of 8 with one degree of freedom and with two: two-sided normal tail and exp(-4).
    EXPECT_NEAR(ringlock::closure::p_of_gain(4.0, *effects::find("bias_ramp")), std::erfc(2.0), 1e-12);
    EXPECT_NEAR(ringlock::closure::p_of_gain(4.0, *effects::find("bias_step")), std::exp(-4.0), 1e-12);
}

TEST(Evidence, RandomRatesAreThoseWithADeviation) {
    for (const char* name : {"rate_random_walk", "bias_instability", "quantum_noise"}) {
        EXPECT_TRUE(ringlock::closure::is_random_rate(*effects::find(name))) << name;
    }
    for (const char* name : {"bias_ramp", "bias_step", "base_vibration", "missed_counts"}) {
        EXPECT_FALSE(ringlock::closure::is_random_rate(*effects::find(name))) << name;
    }
}

// A step of the bias by 0.8 deg/h comes with changes of the threshold by 0.12 and of the phase by 0.5 rad in a typical
// hop of modes.
TEST(Evidence, AnAdditionIsToldByARecordThatCouldShowIt) {
    const effects::Effect& hop = *effects::find("mode_hop");
    const effects::Effect& step = *effects::find("bias_step");
    constexpr double unlimited = std::numeric_limits<double>::infinity();
    const auto evidence = [&](double size, double threshold, double phase, double sd, double ratio) {
        const std::vector<ringlock::closure::Estimate> fitted = {{"mode_hop", "step_deg_h", 0.8 * size, 0.01},
                                                                 {"mode_hop", "threshold_ratio", threshold, 0.12 * sd},
                                                                 {"mode_hop", "phase_rad", phase, 0.5 * sd}};
        return ringlock::closure::evidence_for_addition(hop, step, fitted, ratio).value();
    };
    // Where the record could show no typical change the two effects are tied.
    EXPECT_NEAR(evidence(1.0, 0.0, 0.0, 100.0, unlimited), 0.0, 1e-3);
    EXPECT_NEAR(evidence(0.01, 0.3, 1.0, 1.0, unlimited), 0.0, 1e-2);
    // Where it could and shows none: half the logarithm of one and the square of a hundred, twice.
    EXPECT_NEAR(evidence(1.0, 0.0, 0.0, 0.01, unlimited), -std::log(1.0 + 1e4), 1e-9);
    EXPECT_LT(evidence(1.0, 0.0, 0.0, 0.01, unlimited), -options.tie);
    // Where it shows them.
    EXPECT_GT(evidence(1.0, 0.12, 0.5, 0.1, unlimited), options.tie);
    EXPECT_GT(evidence(-1.0, 0.0, 0.5, 0.1, unlimited), options.tie);
    // No Bayes factor is larger than the likelihood ratio, whatever standard errors say of a likelihood far from
    // normal.
    EXPECT_EQ(evidence(1.0, 0.12, 0.5, 1e-4, 20.0), 20.0);
    EXPECT_EQ(evidence(1.0, 0.0, 0.0, 0.01, 20.0), evidence(1.0, 0.0, 0.0, 0.01, unlimited));
    // Effects without typical sizes are not compared so.
    EXPECT_FALSE(ringlock::closure::evidence_for_addition(*effects::find("readout_ellipse"), step, {}, unlimited));
}

}  // namespace
}  // namespace decide_verdict_test
}  // namespace ringlock::test::closure
