#include "engine/ensemble/ensemble.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/ensemble/draw.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/text/render.hpp"
#include "engine/simd/target.hpp"
#include "tests/property/random_scenario.hpp"
#include "tests/support/gyro_records.hpp"

namespace ringlock::ensemble {
namespace ensemble_test {
namespace {

using scenario::Scenario;
using test::GyroRecord;
using test::RandomScenarios;
using test::served_arms;
using test::simulate;

constexpr int scenarios = 12;

bool same(const gyro::Setup& a, const gyro::Setup& b) {
    return a.scale_factor_arcsec == b.scale_factor_arcsec && a.lockin_threshold_deg_h == b.lockin_threshold_deg_h &&
           a.coupling_phase_rad == b.coupling_phase_rad && a.dither_frequency_hz == b.dither_frequency_hz &&
           a.dither_peak_rate_deg_s == b.dither_peak_rate_deg_s &&
           a.dither_asymmetry_ratio == b.dither_asymmetry_ratio && a.initial_phase_rad == b.initial_phase_rad;
}

TEST(EnsembleProperty, AGyroDoesNotKnowHowManyOthersThereAre) {
    RandomScenarios random(1);
    for (int i = 0; i < scenarios; ++i) {
        const Scenario few = random.next();
        Scenario many = few;
        many.ensemble.gyros = few.ensemble.gyros + random.whole(1, 1000);
        const std::int64_t gyro = random.whole(0, few.ensemble.gyros - 1);
        const GyroRecord one = simulate(few, gyro);
        const GyroRecord other = simulate(many, gyro);
        EXPECT_TRUE(same(one.setup, other.setup)) << to_toml(few);
        EXPECT_EQ(one.counts, other.counts) << to_toml(few);
    }
}

TEST(EnsembleProperty, AnArmDoesNotKnowWhichOthersAreRun) {
    RandomScenarios random(2);
    for (int i = 0; i < scenarios; ++i) {
        Scenario scenario = random.next();
        scenario.arms = scenario::parse_arms(served_arms(scenario));
        scenario.noise_injection.turn_phase_rms_rad = 1.0;
        const GyroRecord all = simulate(scenario, 1);
        Scenario part = scenario;
        part.arms = scenario::parse_arms(random.arms(scenario));
        const GyroRecord some = simulate(part, 1);
        EXPECT_TRUE(same(all.setup, some.setup)) << "arms share what was drawn";
        for (std::size_t arm = 0; arm < part.arms.size(); ++arm) {
            const auto at = std::find(scenario.arms.begin(), scenario.arms.end(), part.arms[arm]);
            ASSERT_NE(at, scenario.arms.end());
            EXPECT_EQ(some.counts[arm], all.counts[static_cast<std::size_t>(at - scenario.arms.begin())])
                << part.arms[arm].name << "\n"
                << to_toml(part);
        }
    }
}

TEST(EnsembleProperty, AGyroWhoseAmplitudeWandersDoesNotKnowTheOthersOfItsBlock) {
    RandomScenarios random(9);
    int tried = 0;
    for (int i = 0; i < scenarios / 2; ++i) {
        Scenario scenario = random.next();
        scenario.ensemble.dither_amplitude_sd_relative = 0.01;
        scenario.dither.amplitude_wander_relative_rt_s = random.uniform(1e-5, 1e-3);
        scenario.dither.amplitude_drift_relative_per_h = random.uniform(-0.1, 0.1);
        if (!scenario::check(scenario).empty()) continue;
        ++tried;
        const auto total = total_gyros(scenario);
        test::GyroRecords records(scenario, static_cast<std::size_t>(total));
        records.run(0, total, 1);
        for (std::int64_t g = 0; g < total; ++g) {
            EXPECT_EQ(records[g].counts, simulate(scenario, g).counts) << g << "\n" << to_toml(scenario);
        }
    }
    EXPECT_GE(tried, 3);
}

TEST(EnsembleProperty, ARunIsItsGyrosInAnyPartsAndOnAnyThreads) {
    RandomScenarios random(3);
    for (int i = 0; i < scenarios / 2; ++i) {
        const Scenario scenario = random.next();
        const auto total = total_gyros(scenario);
        test::GyroRecords records(scenario, static_cast<std::size_t>(total));
        const std::int64_t cut = random.whole(0, total);
        records.run(0, cut, 3);
        records.run(cut, total, 1);
        for (std::int64_t g = 0; g < total; ++g) {
            EXPECT_EQ(records[g].seen, 1) << g;
            EXPECT_EQ(records[g].counts, simulate(scenario, g).counts) << g;
        }
    }
}

TEST(EnsembleProperty, InstructionSetsGiveTheSameBits) {
    RandomScenarios random(8);
    for (int i = 0; i < 4; ++i) {
        Scenario scenario = random.next();
        scenario.arms = scenario::parse_arms(served_arms(scenario));
        scenario.noise_injection.turn_phase_rms_rad = 3.0;
        const GyroRecord best = simulate(scenario, 1);
        for (const std::string& target : simd::available_targets()) {
            simd::use_target(target);
            EXPECT_EQ(simulate(scenario, 1).counts, best.counts) << target << "\n" << to_toml(scenario);
        }
        simd::use_best_target();
    }
}

TEST(EnsembleProperty, RatesOfASweepAreComparedInPairs) {
    RandomScenarios random(4);
    for (int i = 0; i < scenarios; ++i) {
        Scenario sweep = random.next();
        sweep.input = {.rate_deg_h = -3.0, .sweep_stop_deg_h = random.uniform(1.0, 9.0), .sweep_points = 3};
        Scenario single = sweep;
        const std::int64_t point = random.whole(0, 2);
        const std::int64_t member = random.whole(0, sweep.ensemble.gyros - 1);
        const std::int64_t gyro = point * sweep.ensemble.gyros + member;
        single.input = {.rate_deg_h = input_rate_deg_h(sweep, gyro), .sweep_stop_deg_h = 0.0, .sweep_points = 1};
        EXPECT_EQ(input_rate_deg_h(sweep, 2 * sweep.ensemble.gyros), sweep.input.sweep_stop_deg_h);
        EXPECT_TRUE(same(draw_setup(sweep, gyro), draw_setup(sweep, member)));
        EXPECT_EQ(simulate(sweep, gyro).counts, simulate(single, member).counts) << to_toml(sweep);
    }
}

TEST(EnsembleProperty, SeedsAndGyrosDrawOtherNumbers) {
    RandomScenarios random(5);
    for (int i = 0; i < scenarios; ++i) {
        Scenario scenario = random.next();
        const gyro::Setup setup = draw_setup(scenario, 0);
        EXPECT_NE(draw_setup(scenario, 1).initial_phase_rad, setup.initial_phase_rad);
        EXPECT_NE(draw_setup(scenario, 1).dither_peak_rate_deg_s, setup.dither_peak_rate_deg_s);
        ++scenario.ensemble.seed;
        EXPECT_NE(draw_setup(scenario, 0).initial_phase_rad, setup.initial_phase_rad);
    }
}

// Without lock-in there is nothing to inject noise against or to correct. The readout must be free of errors of its
// own, which depend on the phase and with it on injected noise. A compensator that is told no threshold takes unequal
// amplitudes on both sides of a turn for a kick.
TEST(EnsembleProperty, WithoutLockInAllArmsAreTheIdealOne) {
    RandomScenarios random(6);
    for (int i = 0; i < scenarios; ++i) {
        Scenario scenario = random.next();
        scenario.gyro.lockin_threshold_deg_h = 0.0;
        scenario.readout.model = scenario::ReadoutModel::ideal;
        scenario.readout.angle_output = scenario::AngleOutput::interpolated;
        scenario.noise_injection.turn_phase_rms_rad = 1.0;
        scenario.arms = scenario::parse_arms(served_arms(scenario));
        std::erase_if(scenario.arms,
                      [](const scenario::Arm& arm) { return arm.compensator == scenario::Compensator::extrapolated; });
        const GyroRecord record = simulate(scenario, 0);
        for (std::size_t arm = 1; arm < scenario.arms.size(); ++arm) {
            for (std::size_t k = 0; k < record.counts[0].size(); ++k) {
                ASSERT_NEAR(record.angle_arcsec(arm, k), record.angle_arcsec(0, k), 1e-9)
                    << scenario.arms[arm].name << " sample " << k << "\n"
                    << to_toml(scenario);
            }
        }
    }
}

// The equation of motion is one of phases: only rates over K count. With all rates and K doubled (a power of two, so
// that nothing is rounded) the phase does the same to the bit and the angle is twice as large.
TEST(EnsembleProperty, AnglesScaleWithTheScaleFactor) {
    RandomScenarios random(7);
    for (int i = 0; i < scenarios; ++i) {
        const Scenario scenario = random.next();
        Scenario twice = scenario;
        twice.gyro.scale_factor_arcsec *= 2.0;
        twice.gyro.lockin_threshold_deg_h *= 2.0;
        twice.dither.peak_rate_deg_s *= 2.0;
        twice.input.rate_deg_h *= 2.0;
        twice.effects["quantum_noise"]["deg_rt_h"] *= 2.0;
        twice.effects["rate_random_walk"]["deg_h_rt_h"] *= 2.0;
        const GyroRecord one = simulate(scenario, 0);
        const GyroRecord two = simulate(twice, 0);
        // Counts are parts of fringes, which stand for twice the angle.
        EXPECT_EQ(one.counts, two.counts) << to_toml(scenario);
    }
}

}  // namespace
}  // namespace ensemble_test
}  // namespace ringlock::ensemble
