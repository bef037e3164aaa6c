// A gyro that is replayed is the gyro of the study to the bit, whatever the scenario.
#include "analysis/study/replay.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "analysis/study/study.hpp"
#include "engine/core/units.hpp"
#include "engine/scenario/text/render.hpp"
#include "tests/property/random_scenario.hpp"

namespace ringlock::study {
namespace replay_test {
namespace {

using scenario::Scenario;
using test::RandomScenarios;

std::uint64_t bits(double value) { return std::bit_cast<std::uint64_t>(value); }

/// A study with the angle records of all its arms and gyros.
struct Recorded {
    Study study;
    std::vector<std::vector<std::vector<double>>> angle_arcsec;  ///< [arm][gyro][sample]
};

Recorded record(const Scenario& scenario) {
    Recorded out{Study(scenario), {}};
    const auto samples = static_cast<std::size_t>(out.study.schedule.samples);
    out.angle_arcsec.assign(scenario.arms.size(), std::vector(out.study.gyros.size(), std::vector(samples, 0.0)));
    const OnSamples keep = [&](const SampledAngles& s) {  // each arm and block has places of its own
        const std::size_t n = s.angle_arcsec.size() / s.gyros;
        for (std::size_t g = 0; g < s.gyros; ++g) {
            auto& row = out.angle_arcsec[s.arm][static_cast<std::size_t>(s.first_gyro) + g];
            std::copy_n(s.angle_arcsec.begin() + static_cast<std::ptrdiff_t>(g * n), n, row.begin() + s.first_sample);
        }
    };
    out.study = run(std::move(out.study), 2, keep);
    return out;
}

struct Kept final : TurnSink {
    void take(std::span<const ReplayedTurn> more) override { turns.insert(turns.end(), more.begin(), more.end()); }
    std::vector<ReplayedTurn> turns;
};

/// Holds one gyro of one arm against its study.
void expect_same(const Recorded& recorded, std::size_t arm, std::int64_t gyro) {
    const Scenario& scenario = recorded.study.scenario;
    const std::string where = scenario.arms[arm].name + ", gyro " + std::to_string(gyro);
    GyroReplay replay(scenario, scenario.arms[arm], gyro);
    const auto g = static_cast<std::size_t>(gyro);
    EXPECT_EQ(replay.setup(), recorded.study.gyros[g]) << where;
    const GyroReplay::Range all = replay.turns_between(-1e9, 1e9);
    ASSERT_EQ(all.first, 0);
    ASSERT_EQ(all.last, replay.schedule().turns());
    Kept kept;
    std::int64_t samples = 0;
    int different = 0;
    const ReplayFigures figures = replay.run(
        all, kept,
        [&](std::int64_t sample, double angle_arcsec) {
            EXPECT_EQ(sample, samples++);
            if (bits(angle_arcsec) != bits(recorded.angle_arcsec[arm][g][static_cast<std::size_t>(sample)])) {
                ++different;
            }
        },
        {});
    EXPECT_EQ(different, 0) << where << " of " << samples << " samples";
    EXPECT_EQ(samples, replay.schedule().samples) << where;
    ASSERT_TRUE(figures.rate_error_deg_h) << where;
    EXPECT_EQ(bits(*figures.rate_error_deg_h), bits(recorded.study.arms[arm].gyros[g].rate_error_deg_h)) << where;

    // The turns hang together: they alternate in time, errors are the sum of their steps, and the output is the
    // rotation and the lock-in less the correction, but for what a reading is off by.
    ASSERT_EQ(static_cast<std::int64_t>(kept.turns.size()), replay.schedule().turns()) << where;
    const double scale_factor_arcsec = replay.setup().scale_factor_arcsec;
    // Counts that are missed add up, a quarter fringe each: four times as many as are to be expected.
    const double missed = replay.setup().missed_count_probability * static_cast<double>(kept.turns.size());
    const double most_off_arcsec = scale_factor_arcsec * (1.01 + missed);
    double error_rad = kept.turns.front().lockin_error_rad;
    double fastest_deg_h = 0.0;
    for (const ReplayedTurn& turn : kept.turns) fastest_deg_h = std::max(fastest_deg_h, std::abs(turn.rate_deg_h));
    EXPECT_TRUE(std::isnan(kept.turns.front().lockin_step_rad)) << where;
    for (std::size_t i = 0; i < kept.turns.size(); ++i) {
        const ReplayedTurn& turn = kept.turns[i];
        ASSERT_EQ(turn.direction, i % 2 == 0 ? 1 : -1) << where << " turn " << i;
        ASSERT_LE(std::abs(turn.phase.rest_rad), units::pi * (1.0 + 1e-15)) << where << " turn " << i;
        const double truth_arcsec =
            turn.rotation_arcsec + scale_factor_arcsec * (turn.lockin_error_rad - turn.correction_rad) / units::two_pi;
        ASSERT_NEAR(turn.angle_arcsec, truth_arcsec, most_off_arcsec) << where << " turn " << i;
        if (i == 0) continue;
        ASSERT_GT(turn.time_s, kept.turns[i - 1].time_s) << where << " turn " << i;
        error_rad += turn.lockin_step_rad;
        ASSERT_NEAR(turn.lockin_error_rad, error_rad, 1e-9 * (1.0 + std::abs(error_rad))) << where << " turn " << i;
        // From turn to turn the phase goes through the swing of the dither, the rotation and the lock-in, and a little
        // of each between the dither's turn and its own.
        const ReplayedTurn& before = kept.turns[i - 1];
        const double gone_rad =
            units::two_pi * static_cast<double>(turn.phase.whole_fringes - before.phase.whole_fringes) +
            (turn.phase.rest_rad - before.phase.rest_rad);
        const double rotated_rad =
            units::two_pi * (turn.rotation_arcsec - before.rotation_arcsec) / scale_factor_arcsec;
        const double swing_rad = -2.0 * turn.direction * turn.dither_amplitude_rad;
        const double rate_rad_s = units::two_pi * (fastest_deg_h + turn.lockin_threshold_deg_h) / scale_factor_arcsec;
        // A harmonic of the dither moves the phase's turn itself.
        const double harmonic_rad = std::abs(replay.setup().dither_harmonic_ratio * swing_rad);
        const double between_rad =
            harmonic_rad + 3.0 * rate_rad_s * (std::abs(turn.zero_rate_s) + std::abs(before.zero_rate_s));
        ASSERT_NEAR(gone_rad, swing_rad + rotated_rad + turn.lockin_step_rad, between_rad + 1e-6 * std::abs(swing_rad))
            << where << " turn " << i;
    }
}

TEST(ReplayProperty, IsTheGyroOfTheStudy) {
    RandomScenarios random(71);
    for (int i = 0; i < 12; ++i) {
        Scenario scenario = random.next();
        scenario.ensemble.settle_s = random.coin() ? random.uniform(0.01, 0.5) : 0.0;
        const Recorded recorded = record(scenario);
        for (std::size_t arm = 0; arm < scenario.arms.size(); ++arm) {
            expect_same(recorded, arm, random.whole(0, scenario.ensemble.gyros - 1));
        }
        if (HasFailure()) {
            ADD_FAILURE() << scenario::to_toml(scenario);
            return;
        }
    }
}

TEST(LongReplayProperty, IsTheGyroOfTheStudyWhateverTheDriveDoes) {
    const std::vector<std::function<void(Scenario&)>> changes = {
        [](Scenario& s) {  // amplitudes that grow over half cycles
            s.noise_injection.model = scenario::NoiseModel::drive;
            s.noise_injection.form = gyro::NoiseForm::held;
        },
        [](Scenario& s) {
            s.noise_injection.model = scenario::NoiseModel::drive;
            s.noise_injection.form = gyro::NoiseForm::white;
            s.noise_injection.resonator_q = 20.0;
        },
        [](Scenario& s) {
            auto& hop = s.effects["mode_hop"];
            hop["time_s"] = 0.7;
            hop["phase_rad"] = 1.0;
            hop["step_deg_h"] = 2.0;
        },
        [](Scenario& s) { s.effects["missed_counts"]["probability_per_turn"] = 1e-2; },
        [](Scenario& s) {
            s.effects["lockin_second_harmonic"] = {{"ratio", 0.2}, {"phase_rad", 1.0}};
        },
        [](Scenario& s) {
            s.effects["readout_ellipse"]["gain"] = 0.05;
            s.readout.ellipse_correction = true;
        },
        [](Scenario& s) {
            s.effects["dither_second_harmonic"] = {{"ratio", 0.05}, {"phase_rad", 1.0}};
        },
        [](Scenario& s) {
            s.dither.amplitude_wander_relative_rt_s = 1e-4;
            s.dither.amplitude_drift_relative_per_h = 0.1;
        },
        [](Scenario& s) {
            s.input.profile_time_s = {0.0, 0.5, 1.5};
            s.input.profile_rate_deg_h = {0.0, 3000.0, -20.0};
        },
        [](Scenario& s) {
            s.effects["lockin_temperature"]["relative_per_k"] = 0.01;
            s.environment.temperature_ramp_k_per_h = 900.0;
        },
    };
    Scenario base;
    base.ensemble.gyros = 3;
    base.ensemble.duration_s = 1.0;
    base.ensemble.settle_s = 0.25;
    base.ensemble.lockin_threshold_sd_relative = 0.05;
    base.ensemble.seed = 72;
    base.readout.model = scenario::ReadoutModel::instrument;
    base.output.sample_interval_s = 0.05;
    base.arms = scenario::parse_arms({"uncompensated", "noise_injected+compensated_adaptive", "compensated_two_train",
                                      "noise_injected", "noise_injected+compensated_exact", "ideal"});
    for (std::size_t change = 0; change < changes.size(); ++change) {
        Scenario scenario = base;
        changes[change](scenario);
        const auto complaints = scenario::check(scenario);
        ASSERT_TRUE(complaints.empty()) << change << ": " << complaints.front().problem;
        const Recorded recorded = record(scenario);
        for (std::size_t arm = 0; arm < scenario.arms.size(); ++arm) {
            SCOPED_TRACE("change " + std::to_string(change));
            expect_same(recorded, arm, static_cast<std::int64_t>(change % 3));
        }
    }
}

TEST(ReplayProperty, IsTheGyroOfAFullBlock) {
    Scenario scenario;
    scenario.ensemble.gyros = 33;
    scenario.ensemble.duration_s = 0.5;
    scenario.ensemble.seed = 73;
    scenario.output.sample_interval_s = 0.05;
    scenario.arms = scenario::parse_arms({"uncompensated", "noise_injected+compensated_exact"});
    const Recorded recorded = record(scenario);
    for (const std::int64_t gyro : {0, 15, 16, 32}) {
        for (std::size_t arm = 0; arm < scenario.arms.size(); ++arm) expect_same(recorded, arm, gyro);
    }
}

TEST(ReplayProperty, FollowsTheDirectIntegratorInItsPieces) {
    Scenario scenario;
    scenario.propagation.method = scenario::PropagationMethod::direct;
    scenario.dither.peak_rate_deg_s = 5.0;
    scenario.gyro.lockin_threshold_deg_h = 30.0;
    scenario.ensemble.gyros = 2;
    scenario.ensemble.duration_s = 0.2;
    scenario.ensemble.settle_s = 0.03;
    scenario.ensemble.seed = 74;
    scenario.output.sample_interval_s = 0.02;
    scenario.arms = scenario::parse_arms({"uncompensated", "noise_injected+compensated"});
    ASSERT_TRUE(scenario::check(scenario).empty());
    const Recorded recorded = record(scenario);
    for (std::size_t arm = 0; arm < scenario.arms.size(); ++arm) expect_same(recorded, arm, 1);
}

TEST(ReplayProperty, PartsOfAReplayAreRowsOfTheWhole) {
    RandomScenarios random(75);
    for (int i = 0; i < 4; ++i) {
        Scenario scenario = random.next();
        scenario.ensemble.settle_s = 0.2;
        const scenario::Arm& arm = scenario.arms.front();
        const auto replayed = [&](double from_s, double to_s) {
            GyroReplay replay(scenario, arm, 1);
            const GyroReplay::Range range = replay.turns_between(from_s, to_s);
            Kept kept;
            const ReplayFigures figures = replay.run(range, kept, [](std::int64_t, double) {}, {});
            EXPECT_EQ(figures.turns, range.last - range.first);
            EXPECT_EQ(figures.turns, static_cast<std::int64_t>(kept.turns.size()));
            return std::pair(std::move(kept.turns), figures);
        };
        const auto whole = replayed(-1.0, 100.0).first;
        const auto [part, figures] = replayed(-0.05, 0.4);
        EXPECT_FALSE(figures.rate_error_deg_h) << "the record goes on";
        EXPECT_TRUE(figures.angle_error_arcsec);
        ASSERT_GT(part.size(), 80U);
        const auto first = std::ranges::find_if(whole, [&](const ReplayedTurn& t) { return t.time_s >= -0.05; });
        for (std::size_t t = 0; t < part.size(); ++t) {
            const ReplayedTurn& same = first[static_cast<std::ptrdiff_t>(t)];
            ASSERT_EQ(bits(part[t].time_s), bits(same.time_s)) << t;
            ASSERT_EQ(bits(part[t].angle_arcsec), bits(same.angle_arcsec)) << t;
            ASSERT_EQ(bits(part[t].lockin_step_rad), bits(same.lockin_step_rad)) << t;
            ASSERT_EQ(bits(part[t].seen.phase.rest_rad), bits(same.seen.phase.rest_rad)) << t;
        }
        EXPECT_LE(part.back().time_s, 0.4);
        EXPECT_FALSE(replayed(-0.15, -0.05).second.angle_error_arcsec) << "before the record";
        const GyroReplay none(scenario, arm, 1);
        EXPECT_EQ(none.turns_between(5.0, 6.0).first, none.turns_between(5.0, 6.0).last);
        EXPECT_EQ(none.turns_between(1.0, 0.5).first, none.turns_between(1.0, 0.5).last);
    }
}

}  // namespace
}  // namespace replay_test
}  // namespace ringlock::study
