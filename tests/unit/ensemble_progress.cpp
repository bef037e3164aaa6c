#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "engine/ensemble/progress.hpp"

namespace {

using namespace std::chrono_literals;
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

    std::ostringstream out;
    std::chrono::steady_clock::time_point now{};
};

TEST_F(EnsembleProgress, WritesPlainLinesEveryTenSecondsElsewhere) {
    Progress progress(8, options(false));
    EXPECT_EQ(written(), "");
    now += 2s;
    progress.advance(1, 3000);
    EXPECT_EQ(written(), " 12 %  1/8 gyros  1.5e+03 turns/s  14 s left\n");
    now += 9s;
    progress.advance(2, 6000);
    EXPECT_EQ(written(), "");
    now += 1s;
    progress.advance(1, 3000);
    EXPECT_EQ(written(), " 50 %  4/8 gyros  1e+03 turns/s  12 s left\n");
    progress.advance(4, 12000);
    EXPECT_EQ(written(), "");
    now += 50s;
    progress.finish();
    EXPECT_EQ(written(), "100 %  8/8 gyros  387 turns/s  in 1 min 02 s\n");
    progress.finish();
    progress.advance(1, 1);
    EXPECT_EQ(written(), "");
}

TEST_F(EnsembleProgress, RedrawsABarInPlaceOnATerminal) {
    Progress progress(4, options(true));
    now += 1s;
    progress.advance(1, 1000);
    EXPECT_EQ(written(),
              "\r[" + std::string(8, '=') + std::string(27, ' ') + "]  25 %  1/4 gyros  1e+03 turns/s  3 s left\x1b[K");
    now += 199ms;
    progress.advance(1, 1000);
    EXPECT_EQ(written(), "");
    now += 1ms;
    progress.advance(1, 1000);
    EXPECT_THAT(written(), HasSubstr(" 75 %  3/4 gyros"));
    progress.advance(1, 1000);
    progress.finish();
    EXPECT_EQ(written(), "\r\x1b[K");
}

TEST_F(EnsembleProgress, NeverFillsTheWidthOfTheTerminal) {
    for (int width = 1; width < 200; ++width) {
        Progress progress(100000, options(true, width));
        now += 1h;
        written();  // the one before has cleared its bar
        progress.advance(1, 1000);
        const std::string text = written();
        EXPECT_LT(text.size() - std::string("\r\x1b[K").size(), static_cast<std::size_t>(width));
    }
    Progress progress(10, options(true, 0));
    progress.advance(1, 1);
    EXPECT_LT(written().size(), 85u);
}

TEST_F(EnsembleProgress, ClearsTheBarOfARunThatDidNotFinish) {
    {
        Progress progress(4, options(true));
        progress.advance(1, 1);
        written();
    }
    EXPECT_EQ(written(), "\r\x1b[K");
    {
        Progress progress(4, options(false));
        progress.advance(1, 1);
        written();
    }
    EXPECT_EQ(written(), "");
}

TEST_F(EnsembleProgress, IsSilentWhenQuiet) {
    for (const bool terminal : {false, true}) {
        ProgressOptions quiet = options(terminal);
        quiet.quiet = true;
        Progress progress(4, quiet);
        progress.advance(4, 1000);
        progress.finish();
    }
    EXPECT_EQ(written(), "");
}

TEST_F(EnsembleProgress, SaysHundredPercentOnlyWhenAllIsDone) {
    Progress progress(100000, options(false));
    progress.advance(99999, 1);
    EXPECT_EQ(written(), " 99 %  99999/100000 gyros\n");
    Progress none(0, options(false));
    none.finish();
    EXPECT_EQ(written(), "100 %  0/0 gyros  in 0 s\n");
}

TEST_F(EnsembleProgress, CountsFromManyThreads) {
    Progress progress(4000, options(false));
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t) {
        threads.emplace_back([&progress] {
            for (int i = 0; i < 1000; ++i) progress.advance(1, 10);
        });
    }
    for (std::thread& thread : threads) thread.join();
    written();
    now += 10s;
    progress.finish();
    EXPECT_EQ(written(), "100 %  4000/4000 gyros  4e+03 turns/s  in 10 s\n");
}

}  // namespace
