// Blocks of gyros where tables must be made anew, and where one gyro cannot be simulated.
#include <cstdint>
#include <cstdio>
#include <memory>
#include <numeric>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/propagate/lane_propagator.hpp"
#include "engine/scenario/check.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/gyro_records.hpp"

namespace ringlock::test {
namespace blocks_test {
namespace {

scenario::Scenario quiet() {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.detector_noise_relative = 0.0;
    scenario.ensemble.seed = 801;
    return scenario;
}

struct Outcome {
    std::vector<simd::Lanes> angle_arcsec;
    std::int64_t remade = 0;
};

Outcome go(scenario::Scenario scenario, bool direct, const std::string& arm, std::size_t gyros, std::size_t turns) {
    if (direct) scenario.propagation.method = scenario::PropagationMethod::direct;
    const std::vector<scenario::Arm> arms{scenario::parse_arm(arm)};
    ensemble::GyroBlock block(scenario, arms, 0, gyros);
    Outcome outcome;
    for (std::size_t done = 0; done < turns;) {
        const std::size_t count = std::min<std::size_t>(128, turns - done);
        block.advance(count);
        for (std::size_t i = 0; i < count; i += 2) {
            outcome.angle_arcsec.emplace_back();
            for (std::size_t g = 0; g < gyros; ++g) {
                outcome.angle_arcsec.back()[g] =
                    (block.angles(0).angle_whole[i][g] + block.angles(0).angle_fringes[i][g]) *
                    block.setups()[g].scale_factor_arcsec;
            }
        }
        done += count;
    }
    outcome.remade = block.tables_remade();
    return outcome;
}

void expect_agreement(const scenario::Scenario& scenario, const std::string& arm, std::size_t turns) {
    constexpr std::size_t gyros = 2;
    const Outcome map = go(scenario, false, arm, gyros, turns);
    const Outcome direct = go(scenario, true, arm, gyros, turns);
    double worst = 0.0;
    for (std::size_t i = 0; i < map.angle_arcsec.size(); ++i) {
        for (std::size_t g = 0; g < gyros; ++g) {
            worst = std::max(worst, std::abs(map.angle_arcsec[i][g] - direct.angle_arcsec[i][g]));
        }
    }
    std::printf("%s: worst of %zu turns %.2g arcsec, tables made anew %ld times\n", arm.c_str(), turns, worst,
                static_cast<long>(map.remade));
    // 1e-10 rad of two methods each over hundreds of turns, all one way, are 1e-7 rad or 8e-9 arcsec.
    EXPECT_LT(worst, 1e-8);
}

TEST(GyroBlock, FollowsAVibrationLikeTheDirectIntegrator) {
    auto scenario = quiet();
    scenario.effects["base_vibration"]["rate_deg_h"] = 5000.0;
    scenario.effects["base_vibration"]["frequency_hz"] = 10.0;
    for (const std::string arm : {"uncompensated", "noise_injected"}) expect_agreement(scenario, arm, 300);
}

TEST(GyroBlock, FollowsARampLikeTheDirectIntegrator) {
    auto scenario = quiet();
    scenario.effects["bias_ramp"]["deg_h_per_h"] = 1000.0;
    for (const std::string arm : {"uncompensated", "noise_injected"}) expect_agreement(scenario, arm, 300);
}

TEST(LongGyroBlock, FollowsAStepBetweenTwoPiecesLikeTheDirectIntegrator) {
    // The half cycle under way when the tables are made anew has the old rate, its second half is gone through by the
    // new tables.
    auto scenario = quiet();
    scenario.effects["lockin_second_harmonic"]["ratio"] = 0.2;
    scenario.effects["bias_step"]["step_deg_h"] = 3000.0;
    scenario.effects["bias_step"]["time_s"] = 64.0 / scenario.dither.frequency_hz;
    for (const std::string arm : {"uncompensated", "noise_injected"}) expect_agreement(scenario, arm, 160);
}

TEST(GyroBlock, WithoutLockInTheDirectIntegratorNeedsNoFringes) {
    // 3 fringes in a half cycle: no turn map has a fast middle there, that of a gyro without lock-in neither.
    auto scenario = quiet();
    scenario.readout.model = scenario::ReadoutModel::ideal;
    scenario.dither.peak_rate_deg_s = 0.16;
    const Outcome outcome = go(scenario, true, "ideal", 2, 64);
    const double rate_deg_h = scenario.input.rate_deg_h;
    for (std::size_t i = 0; i < outcome.angle_arcsec.size(); ++i) {
        const double turned_arcsec = rate_deg_h * static_cast<double>(i) / scenario.dither.frequency_hz;
        for (std::size_t g = 0; g < 2; ++g) {
            EXPECT_NEAR(outcome.angle_arcsec[i][g] - outcome.angle_arcsec[0][g], turned_arcsec, 1e-9) << i;
        }
    }
}

TEST(GyroBlock, RemakesTablesAFewTimesOnly) {
    auto ramp = quiet();
    ramp.effects["bias_ramp"]["deg_h_per_h"] = 1000.0;
    // 60 s reach 17 deg/h. Ranges begin with the first piece, three times as wide as its 0.14 deg/h, and double from
    // remake to remake: a handful.
    const Outcome ramped = go(ramp, false, "noise_injected", 1, 15000);
    EXPECT_GE(ramped.remade, 1);
    EXPECT_LE(ramped.remade, 12);
    auto vibration = quiet();
    vibration.effects["base_vibration"]["rate_deg_h"] = 5000.0;
    vibration.effects["base_vibration"]["frequency_hz"] = 10.0;
    // Five periods a piece: the first piece's ranges hold for all.
    EXPECT_EQ(go(vibration, false, "noise_injected", 1, 15000).remade, 0);
    // A twentieth of a period a piece.
    vibration.effects["base_vibration"]["frequency_hz"] = 0.1;
    const Outcome slow = go(vibration, false, "noise_injected", 1, 15000);
    std::printf("tables made anew: %ld times on a ramp, %ld on 0.1 Hz\n", static_cast<long>(ramped.remade),
                static_cast<long>(slow.remade));
    EXPECT_GE(slow.remade, 1);
    // Of 118 pieces: ranges up to three times as wide as what a piece asks for last two or three of them.
    EXPECT_LE(slow.remade, 80);
}

TEST(TurnMapLanes, AmplitudesBeyondTheMarginAreTakenIn) {
    const std::vector<gyro::Device> devices{gyro::Device(paper_device())};
    const double a = devices[0].dither_amplitude_rad;
    propagate::TurnMapLanes<propagate::MoebiusTurns> map(devices, {5.0}, 1e-10);
    propagate::DirectPropagator direct(devices, 1e-10);
    double worst = 0.0;
    double plain = 0.1;
    for (int piece = 0; piece < 3; ++piece) {
        gyro::LaneDrive drive;
        drive.first_turn = 4 * piece;
        drive.resize(4);
        for (std::size_t i = 0; i < 5; ++i) {
            const double amplitude = a + (i == 2 && piece > 0 ? -20.0 : 3.0);
            const double swing = drive.direction(i) < 0 ? amplitude : -amplitude;  // half cycle i ends at turn i
            if (i > 0)
                plain += (2.0 * swing + devices[0].input_rate_rad_s * devices[0].positive_duration_s) / units::two_pi;
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                drive.amplitude_rad[i][lane] = amplitude;
                drive.rate_rad_s[i][lane] = devices[0].input_rate_rad_s;
                drive.b_rad_s[i][lane] = devices[0].coupling.b_rad_s;
                if (i < 4) drive.plain_fringes[i][lane] = plain - std::nearbyint(plain);
            }
        }
        gyro::LaneTurns by_map;
        gyro::LaneTurns by_direct;
        map.step(drive, by_map);
        direct.step(drive, by_direct);
        EXPECT_EQ(map.tables_remade(0), piece == 0 ? 0 : 1);
        for (std::size_t i = 0; i < 4; ++i) {
            worst = std::max(worst, std::abs((by_map.lockin_whole[0] - by_direct.lockin_whole[0]) +
                                             (by_map.lockin_fringes[i][0] - by_direct.lockin_fringes[i][0])));
        }
    }
    EXPECT_LT(units::two_pi * worst, 1e-8);
}

TEST(Ensemble, NamesAGyroThatFailsAndSimulatesTheOthers) {
    auto scenario = quiet();
    scenario.ensemble.gyros = 1;
    scenario.ensemble.duration_s = 1.0;
    scenario.arms = scenario::parse_arms({"noise_injected+compensated"});
    // The last of three rates is more than the dither's peak rate, 392 760 deg/h: its phase does not reverse.
    scenario.input.rate_deg_h = 0.0;
    scenario.input.sweep_stop_deg_h = 400000.0;
    scenario.input.sweep_points = 3;
    GyroRecords records(scenario, 3);
    const std::string message = message_of<RunError>([&] { records.run(0, 3, 1); });
    EXPECT_THAT(message, testing::HasSubstr("1 of 3 gyros"));
    EXPECT_THAT(message, testing::HasSubstr("gyro 2: "));
    for (std::int64_t g = 0; g < 2; ++g) {
        EXPECT_EQ(records[g].seen, 1) << g;
        EXPECT_EQ(records[g].setup.input_rate_deg_h, 200000.0 * static_cast<double>(g));
    }
    EXPECT_EQ(records[2].seen, 0);
}

TEST(Ensemble, TellsNoTurnTwiceWhereABlockBeginsAgain) {
    auto scenario = quiet();
    scenario.ensemble.gyros = 1;
    scenario.ensemble.duration_s = 1.0;
    scenario.output.sample_interval_s = 0.1;
    scenario.ensemble.dither_amplitude_sd_relative = 0.0;
    scenario.ensemble.dither_asymmetry_sd_ratio = 0.0;
    // 10.5 fringes in a half cycle: the turn map exists up to 0.54 of the dither's peak rate, 1100 deg/h. The last of
    // three gyros passes that at the step, which is in its second piece of 128 turns.
    scenario.dither.peak_rate_deg_s = 0.57;
    scenario.gyro.lockin_threshold_deg_h = 30.0;
    scenario.input.rate_deg_h = 0.0;
    scenario.input.sweep_stop_deg_h = 1070.0;
    scenario.input.sweep_points = 3;
    scenario.effects["bias_step"] = {{"step_deg_h", 60.0}, {"time_s", 0.8}};
    struct Nothing final : ensemble::BlockSink {
        void angles(std::size_t /*arm*/, std::span<const simd::LaneCounts> /*counts*/) override {}
        void finish(const ensemble::BlockResult& /*result*/) override {}
    };
    const std::vector<scenario::Arm> arms{scenario::parse_arm("uncompensated")};
    struct Told final : ensemble::Observer {
        void stage(const std::string& /*name*/) override {}
        void plan(std::span<const ensemble::PlannedBlock> blocks, int /*threads*/) override {
            planned.assign(blocks.begin(), blocks.end());
        }
        void enter(std::size_t block, ensemble::BlockStage stage) override {
            EXPECT_EQ(block, 0);
            stages.push_back(stage);
        }
        void advance(std::size_t block, std::int64_t more_gyros, std::int64_t more_turns, bool tables) override {
            EXPECT_EQ(block, 0);
            EXPECT_GE(more_turns, 0);
            gyros += more_gyros;
            turns += more_turns;
            tabulated.push_back(tables);
        }
        std::vector<ensemble::PlannedBlock> planned;
        std::vector<ensemble::BlockStage> stages;
        std::vector<bool> tabulated;  // of each call
        std::int64_t gyros = 0;
        std::int64_t turns = 0;
    } told;
    const std::string message = message_of<RunError>([&] {
        const ensemble::Job job{&scenario, arms, 0, 3,
                                [](std::int64_t, std::size_t) { return std::make_unique<Nothing>(); }};
        ensemble::run({&job, 1}, 1, {.observer = &told});
    });
    EXPECT_THAT(message, testing::HasSubstr("1 of 3 gyros"));
    EXPECT_EQ(told.gyros, 2);
    EXPECT_EQ(told.turns, 2 * ensemble::Schedule(scenario).turns() + 128);
    EXPECT_EQ(ensemble::expected_turns(scenario, arms), 3 * ensemble::Schedule(scenario).turns());
    ASSERT_EQ(told.planned.size(), 1);
    EXPECT_EQ(told.planned[0].gyros, 3);
    EXPECT_EQ(told.planned[0].turns, 3 * ensemble::Schedule(scenario).turns());
    using enum ensemble::BlockStage;
    EXPECT_THAT(told.stages, testing::ElementsAre(set_up, turns, over));
}

TEST(Ensemble, TakesPointsInAnOrderInWhichAFewStandForAll) {
    struct Nothing final : ensemble::BlockSink {
        void angles(std::size_t /*arm*/, std::span<const simd::LaneCounts> /*counts*/) override {}
        void finish(const ensemble::BlockResult& /*result*/) override {}
    };
    auto scenario = quiet();
    scenario.ensemble.gyros = 1;
    scenario.ensemble.duration_s = 0.1;
    scenario.output.sample_interval_s = 0.1;
    const std::vector<scenario::Arm> arms{scenario::parse_arm("ideal")};
    for (const std::size_t points : {2, 3, 7, 40, 60}) {
        std::vector<double> places;  // of the points in the design, from 0 to 1, in the order in which they begin
        std::vector<ensemble::Job> jobs;
        for (std::size_t point = 0; point < points; ++point) {
            const auto make_sink = [&, point](std::int64_t, std::size_t) {
                places.push_back((static_cast<double>(point) + 0.5) / static_cast<double>(points));
                return std::make_unique<Nothing>();
            };
            jobs.push_back({&scenario, arms, 0, 1, make_sink});
        }
        ensemble::run(jobs, 1, {});
        ASSERT_EQ(places.size(), points);
        EXPECT_EQ(std::set<double>(places.begin(), places.end()).size(), points) << "each once";
        constexpr std::size_t few = 6;
        for (std::size_t i = 0; i + few <= points; ++i) {
            const auto at = places.begin() + static_cast<std::ptrdiff_t>(i);
            EXPECT_NEAR(std::accumulate(at, at + few, 0.0) / few, 0.5, 0.2) << points << " points, from " << i;
        }
    }
}

TEST(Ensemble, CountsTheTurnsOfTheLongestRun) {
    // As much as the rules allow: 2500 gyros, two trajectories each, 2e9 s at 1e5 Hz.
    scenario::Scenario scenario;
    scenario.dither = {.frequency_hz = 1e5, .peak_rate_deg_s = 1e4};
    scenario.propagation.method = scenario::PropagationMethod::direct;
    scenario.ensemble.gyros = 2500;
    scenario.ensemble.duration_s = 1e9;
    scenario.ensemble.settle_s = 1e9;
    ASSERT_TRUE(scenario::check(scenario).empty());
    const std::vector<scenario::Arm> arms{scenario::parse_arm("uncompensated"), scenario::parse_arm("noise_injected")};
    const auto turns = static_cast<double>(ensemble::expected_turns(scenario, arms));
    EXPECT_NEAR(turns, 2e18, 1e10);  // but for the turn at time 0 of each trajectory and a share of a sample
}

TEST(Ensemble, AFailureOfTheSinkIsTheRunsNotAGyros) {
    struct Full final : ensemble::BlockSink {
        void angles(std::size_t /*arm*/, std::span<const simd::LaneCounts> /*counts*/) override {
            throw RunError("disk full");
        }
        void finish(const ensemble::BlockResult& /*result*/) override {}
    };
    auto scenario = quiet();
    scenario.ensemble.gyros = 64;
    const std::vector<scenario::Arm> arms{scenario::parse_arm("uncompensated")};
    int blocks = 0;
    const auto make_sink = [&](std::int64_t /*gyro*/, std::size_t /*gyros*/) {
        ++blocks;
        return std::make_unique<Full>();
    };
    const ensemble::Job job{&scenario, arms, 0, 64, make_sink};
    EXPECT_EQ(message_of<RunError>([&] { ensemble::run({&job, 1}, 1, {}); }), "disk full");
    EXPECT_EQ(blocks, 1) << "nothing is tried again";
}

}  // namespace
}  // namespace blocks_test
}  // namespace ringlock::test
