#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "engine/ensemble/progress/progress.hpp"

namespace ensemble_progress_test {
namespace {

using namespace std::chrono_literals;
using ringlock::ensemble::BlockStage;
using ringlock::ensemble::PlannedBlock;
using ringlock::ensemble::Progress;
using ringlock::ensemble::ProgressOptions;
using testing::HasSubstr;

struct EnsembleProgress : testing::Test {
    ProgressOptions options(bool terminal, int width = 80) {
        return {.quiet = false,
                .out = &out,
                .is_terminal = terminal,
                .clock = [this] { return now; },
                .terminal_width = [width] { return width; }};
    }
    /// What was written since the last call.
    std::string written() {
        std::string text = out.str();
        out.str("");
        return text;
    }

    /// One block of so many gyros, which has begun with its turns.
    static void begin(Progress& progress, std::int64_t gyros, std::int64_t turns) {
        progress.plan({{PlannedBlock{gyros, turns}}}, 1);
        progress.enter(0, BlockStage::set_up);
        progress.enter(0, BlockStage::turns);
    }

    std::ostringstream out;
    std::chrono::steady_clock::time_point now{};
};

TEST_F(EnsembleProgress, WritesPlainLinesEveryTenSecondsElsewhere) {
    Progress progress(8, options(false));
    EXPECT_EQ(written(), "");
    progress.plan({{PlannedBlock{8, 24000}}}, 1);
    EXPECT_EQ(written(), "  0 %  0/8 gyros  set-up\n");
    now += 4s;
    progress.enter(0, BlockStage::set_up);
    now += 6s;
    progress.enter(0, BlockStage::turns);
    EXPECT_EQ(written(), "  0 %  0/8 gyros  set-up\n");
    now += 2s;
    progress.advance(0, 1, 2400, false);
    now += 7s;
    progress.advance(0, 2, 8400, false);
    EXPECT_EQ(written(), "");
    now += 1s;
    progress.advance(0, 1, 1200, false);
    EXPECT_EQ(written(), " 50 %  4/8 gyros  1.2e+03 turns/s  10 s left\n") << "the set-up is not in the rate";
    now += 5s;
    progress.advance(0, 4, 6000, false);
    EXPECT_EQ(written(), "");
    now += 45s;
    progress.advance(0, 0, 6000, true);
    EXPECT_EQ(written(), "100 %  8/8 gyros  1.2e+03 turns/s\n") << "turn maps were tabulated on the way";
    progress.finish();
    EXPECT_EQ(written(), "100 %  8/8 gyros  1.2e+03 turns/s  in 1 min 10 s\n");
    progress.finish();
    progress.advance(0, 1, 1, false);
    EXPECT_EQ(written(), "");
}

TEST_F(EnsembleProgress, RedrawsABarInPlaceOnATerminal) {
    ProgressOptions by_turns = options(true);
    by_turns.total_turns = 4000;
    Progress progress(4, by_turns);
    begin(progress, 4, 4000);
    EXPECT_EQ(written(), "\r[" + std::string(40, ' ') + "]   0 %  0/4 gyros  set-up\x1b[K");
    now += 4s;
    progress.advance(0, 1, 1000, false);
    now += 3s;
    progress.advance(0, 1, 750, false);
    written();
    now += 1s;
    progress.advance(0, 0, 250, false);
    EXPECT_EQ(written(),
              "\r[" + std::string(18, '=') + std::string(19, ' ') + "]  50 %  2/4 gyros  250 turns/s  8 s left\x1b[K");
    now += 199ms;
    progress.advance(0, 1, 1000, false);
    EXPECT_EQ(written(), "");
    now += 1ms;
    progress.advance(0, 1, 500, false);
    EXPECT_THAT(written(), HasSubstr(" 87 %  4/4 gyros"));
    progress.advance(0, 0, 500, false);
    progress.finish();
    EXPECT_EQ(written(), "\r\x1b[K");
}

TEST_F(EnsembleProgress, NamesStages) {
    Progress progress(4, options(true, 60));
    progress.stage("predicting");
    EXPECT_THAT(written(), HasSubstr("  0 %  0/4 gyros  predicting\x1b"));
    begin(progress, 4, 1000);
    now += 1s;
    progress.advance(0, 4, 1000, false);
    EXPECT_THAT(written(), HasSubstr("100 %  4/4 gyros  1e+03 turns/s\x1b"));
    progress.enter(0, BlockStage::output);
    progress.enter(0, BlockStage::over);
    progress.stage("summing up");
    EXPECT_THAT(written(), HasSubstr("100 %  4/4 gyros  summing up\x1b")) << "at once: nothing may follow for long";
}

TEST_F(EnsembleProgress, WhatWasDoneBeforeIsInTheShareNotInTheRate) {
    ProgressOptions resumed = options(false);
    resumed.total_turns = 100'000;
    resumed.already_done = {.gyros = 90, .turns = 90'000};
    Progress progress(100, resumed);
    begin(progress, 10, 10'000);
    EXPECT_EQ(written(), " 90 %  90/100 gyros  set-up\n");
    for (int i = 0; i < 10; ++i) {
        now += 1s;
        progress.advance(0, 0, 500, false);
    }
    EXPECT_EQ(written(), " 95 %  90/100 gyros  500 turns/s  10 s left\n");
}

TEST_F(EnsembleProgress, OfALotThatGrowsShowsTheWayToTheNextLook) {
    ProgressOptions growing = options(false);
    growing.total_turns = 1'000'000;
    growing.grows = true;
    Progress progress(1000, growing);
    begin(progress, 16, 16'000);
    EXPECT_EQ(written(), "  0 %  0/16 gyros, 1000 at most  set-up\n");
    for (int i = 0; i < 10; ++i) {
        now += 1s;
        progress.advance(0, 0, 400, false);
    }
    EXPECT_EQ(written(), " 25 %  0/16 gyros, 1000 at most  400 turns/s  30 s to the next look\n");
    progress.advance(0, 16, 12'000, false);
    progress.enter(0, BlockStage::output);
    progress.enter(0, BlockStage::over);
    now += 10s;
    progress.stage("judging the precision");
    EXPECT_EQ(written(), "100 %  16/16 gyros, 1000 at most  judging the precision\n");
    now += 10s;
    begin(progress, 16, 16'000);
    EXPECT_EQ(written(), " 50 %  16/32 gyros, 1000 at most  set-up\n");
    progress.finish();
    EXPECT_EQ(written(), " 50 %  16/32 gyros  1.6e+03 turns/s  in 30 s\n");
}

TEST_F(EnsembleProgress, AClockThatStepsBackDoesNoHarm) {
    ProgressOptions by_turns = options(false);
    by_turns.total_turns = 10'000;
    Progress progress(10, by_turns);
    begin(progress, 10, 10'000);
    written();
    for (int i = 0; i < 10; ++i) {
        now += i == 5 ? -1h : 1s;
        progress.advance(0, 0, 500, false);
    }
    EXPECT_EQ(written(), "") << "9 s have gone by";
    now += 1s;
    progress.advance(0, 0, 0, false);
    EXPECT_THAT(written(), HasSubstr(" 50 %  0/10 gyros  500 turns/s"));
    now += 10s;
    progress.advance(0, 10, 5000, false);
    progress.finish();
    EXPECT_THAT(written(), HasSubstr("100 %  10/10 gyros  500 turns/s  in 20 s\n"));
}

TEST_F(EnsembleProgress, NeverFillsTheWidthOfTheTerminal) {
    for (int width = 1; width < 200; ++width) {
        Progress progress(100000, options(true, width));
        written();  // the one before has cleared its bar
        begin(progress, 100000, 1'000'000'000);
        const std::string text = written();
        EXPECT_LT(text.size() - std::string("\r\x1b[K").size(), static_cast<std::size_t>(width));
    }
    Progress progress(10, options(true, 0));
    begin(progress, 10, 10);
    EXPECT_LT(written().size(), 85u);
}

TEST_F(EnsembleProgress, ClearsTheBarOfARunThatDidNotFinish) {
    {
        Progress progress(4, options(true));
        begin(progress, 4, 4);
        EXPECT_NE(written(), "");
    }
    EXPECT_EQ(written(), "\r\x1b[K");
    {
        Progress progress(4, options(false));
        begin(progress, 4, 4);
        EXPECT_NE(written(), "");
    }
    EXPECT_EQ(written(), "");
}

TEST_F(EnsembleProgress, IsSilentWhenQuiet) {
    for (const bool terminal : {false, true}) {
        ProgressOptions quiet = options(terminal);
        quiet.quiet = true;
        Progress progress(4, quiet);
        progress.stage("predicting");
        begin(progress, 4, 1000);
        progress.advance(0, 4, 1000, false);
        progress.finish();
    }
    EXPECT_EQ(written(), "");
}

TEST_F(EnsembleProgress, SaysHundredPercentOnlyWhenAllIsDone) {
    Progress progress(100000, options(false));
    begin(progress, 100000, 100000);
    written();
    now += 10s;
    progress.advance(0, 99999, 99999, false);
    EXPECT_THAT(written(), HasSubstr(" 99 %  99999/100000 gyros  "));
    Progress none(0, options(false));
    none.finish();
    EXPECT_EQ(written(), "100 %  0/0 gyros  in 0 s\n");
}

TEST_F(EnsembleProgress, CountsFromManyThreads) {
    Progress progress(4000, options(false));
    const std::vector<PlannedBlock> blocks(4, {1000, 10000});
    progress.plan(blocks, 4);
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < 4; ++t) {
        threads.emplace_back([&progress, t] {
            progress.enter(t, BlockStage::set_up);
            progress.enter(t, BlockStage::turns);
            for (int i = 0; i < 1000; ++i) progress.advance(t, 1, 10, false);
        });
    }
    for (std::thread& thread : threads) thread.join();
    written();
    now += 10s;
    progress.finish();
    EXPECT_EQ(written(), "100 %  4000/4000 gyros  in 10 s\n");
}

}  // namespace
}  // namespace ensemble_progress_test
