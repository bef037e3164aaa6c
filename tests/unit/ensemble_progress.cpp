#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "engine/ensemble/progress.hpp"

namespace ringlock::ensemble {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

class EnsembleProgress : public testing::Test {
   protected:
    ProgressSink sink(bool terminal) {
        return {.stream = &stream_,
                .terminal = terminal,
                .columns = [this] { return columns_; },
                .now_s = [this] { return now_s_; }};
    }
    /// What the terminal's line shows now.
    std::string line() const {
        const std::string all = stream_.str();
        return all.substr(all.rfind("\x1b[K") + 3);
    }

    std::ostringstream stream_;
    double now_s_ = 1000.0;
    int columns_ = 80;
};

TEST_F(EnsembleProgress, ATerminalSeesTheShareTheRateAndTheTimeLeft) {
    Progress progress(64, {}, sink(true));
    EXPECT_EQ(line(), "  0 % [----------------------------------------] 0/64 gyros");
    now_s_ += 10.0;
    progress.advance(16, 30'000'000);
    EXPECT_EQ(line(), " 25 % [#######---------------------] 16/64 gyros, 3 M turns/s, 30 s left");
}

TEST_F(EnsembleProgress, ATerminalIsWrittenToAFewTimesASecondAtMost) {
    Progress progress(1000, {}, sink(true));
    for (int i = 0; i < 1000; ++i) {
        now_s_ += 0.001;
        progress.advance(1, 1);
    }
    EXPECT_LE(std::ranges::count(stream_.str(), '\r'), 6);
    EXPECT_EQ(std::ranges::count(stream_.str(), '\n'), 0);
}

TEST_F(EnsembleProgress, NoLineFillsTheTerminal) {
    for (columns_ = 0; columns_ < 120; ++columns_) {
        Progress progress(64, {}, sink(true));
        now_s_ += 4000.0;
        progress.advance(3, 1'234'567'890);
        EXPECT_LT(static_cast<int>(line().size()), std::max(columns_, 1));
    }
}

TEST_F(EnsembleProgress, TheLineIsClearedAtTheEnd) {
    Progress progress(2, {}, sink(true));
    now_s_ += 1.0;
    progress.advance(2, 10);
    EXPECT_NE(line(), "");
    progress.finish();
    EXPECT_EQ(line(), "");
}

TEST_F(EnsembleProgress, TheLineIsClearedBeforeAnError) {
    { const Progress progress(2, {}, sink(true)); }
    EXPECT_EQ(line(), "");
}

TEST_F(EnsembleProgress, ALogGetsTheFirstLineOneEveryTenSecondsAndTheLast) {
    Progress progress(100, {}, sink(false));
    for (int i = 0; i < 100; ++i) {
        now_s_ += 0.25;
        progress.advance(1, 1000);
    }
    progress.finish();
    EXPECT_EQ(stream_.str(),
              "0 %, 0 of 100 gyros\n"
              "40 %, 40 of 100 gyros, 4 k turns/s, 15 s left\n"
              "80 %, 80 of 100 gyros, 4 k turns/s, 5 s left\n"
              "100 %, 100 of 100 gyros, 4 k turns/s, took 25 s\n");
}

TEST_F(EnsembleProgress, TurnsTellTheShareWhereTheirTotalIsKnown) {
    Progress progress(1, {.total_turns = 4'000'000}, sink(false));
    now_s_ += 3600.0;
    progress.advance(0, 1'000'000);
    EXPECT_THAT(stream_.str(), EndsWith("25 %, 0 of 1 gyros, 278 turns/s, 3 h 00 min left\n"));
}

TEST_F(EnsembleProgress, OneHundredPercentIsNotSaidTooEarly) {
    Progress progress(1000, {}, sink(false));
    now_s_ += 20.0;
    progress.advance(999, 1);
    EXPECT_THAT(stream_.str(), HasSubstr("\n99 %, 999 of 1000"));
}

TEST_F(EnsembleProgress, QuietSaysNothing) {
    for (const bool terminal : {false, true}) {
        Progress progress(2, {.quiet = true}, sink(terminal));
        now_s_ += 100.0;
        progress.advance(2, 10);
        progress.finish();
    }
    EXPECT_EQ(stream_.str(), "");
}

TEST_F(EnsembleProgress, NothingIsLostBetweenThreads) {
    Progress progress(4000, {}, sink(false));
    {
        std::vector<std::jthread> threads;
        for (int t = 0; t < 4; ++t)
            threads.emplace_back([&progress] {
                for (int i = 0; i < 1000; ++i) progress.advance(1, 2);
            });
    }
    now_s_ += 8.0;
    progress.finish();
    EXPECT_THAT(stream_.str(), HasSubstr("100 %, 4000 of 4000 gyros, 1 k turns/s, took 8 s\n"));
}

}  // namespace
}  // namespace ringlock::ensemble
