// Verdict, advice on ties, training rows and levels, from models that are made up.
#include "analysis/closure/decide/verdict.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numeric>

#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/decide/rows.hpp"
#include "analysis/closure/options.hpp"

namespace ringlock::test::closure {
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
    EXPECT_THAT(experiment_for(*ramp, {temperature}), HasSubstr("temperature changed against time"));
    EXPECT_EQ(experiment_for(*temperature, {ramp}), experiment_for(*ramp, {temperature}));
    EXPECT_THAT(experiment_for(*ramp, {effects::find("scale_factor_error")}), HasSubstr("three input rates"));
    EXPECT_THAT(experiment_for(*effects::find("dither_asymmetry"), {effects::find("dither_second_harmonic")}),
                HasSubstr("accelerations"));
    EXPECT_THAT(experiment_for(*effects::find("base_vibration"), {effects::find("dither_residue")}),
                HasSubstr("another dither frequency"));
    EXPECT_THAT(experiment_for(*effects::find("detector_phase_offset"), {effects::find("lockin_second_harmonic")}),
                HasSubstr("more injected noise"));
    EXPECT_THAT(experiment_for(*ramp, {effects::find("rate_random_walk")}), HasSubstr("for longer"));
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

}  // namespace
}  // namespace ringlock::test::closure
