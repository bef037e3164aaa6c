#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <ostream>
#include <random>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "engine/ensemble/progress/progress.hpp"
#include "engine/ensemble/progress/time_left.hpp"

namespace ensemble_time_left_test {
namespace {

using ringlock::ensemble::BlockStage;
using ringlock::ensemble::PlannedBlock;
using ringlock::ensemble::Progress;
using ringlock::ensemble::ProgressOptions;
using ringlock::ensemble::TimeLeft;

constexpr std::int64_t piece_turns = 128;

/// What a block takes, on a machine that is made up.
struct Block {
    double turns_s = 10.0;  ///< at a pace of 1
    double set_up_s = 1.0;
    double output_s = 0.05;
    int tabulated = 0;        ///< pieces of 128 turns on whose way turn maps are tabulated: the first, the second, ...
    double tables_s = 0.0;    ///< of each of them
    int tabulated_every = 1;  ///< ... or every so many
    std::int64_t gyros = 16;
    std::int64_t turns = 128 * 500;  ///< of each gyro
};

struct History {
    std::string name;
    int threads = 2;
    std::vector<Block> blocks;
    double before_s = 0.0;  ///< a stage before the blocks
    double after_s = 0.0;   ///< a stage after them
    std::function<double(double time_s)> pace = [](double) { return 1.0; };
    ProgressOptions::Done already_done = {};
};

void PrintTo(const History& history, std::ostream* out) { *out << history.name; }

/// A time left as it was shown, and the truth.
struct Shown {
    double at_s;
    double left_s;
    double truly_left_s;
};

struct Outcome {
    double turns_began_s = 0.0;
    double end_s = 0.0;
    std::vector<Shown> shown;
    std::string written;
};

/// "2 h 26 min left" in seconds.
std::optional<double> left_s(const std::string& text) {
    static const std::regex pattern(R"(  (?:(\d+) h )?(?:(\d+) min)?(?: ?(\d+) s)? left)");
    std::smatch match;
    if (!std::regex_search(text, match, pattern)) return std::nullopt;
    const auto number = [&](std::size_t i) { return match[i].matched ? std::stod(match[i].str()) : 0.0; };
    return 3600.0 * number(1) + 60.0 * number(2) + number(3);
}

/// Goes through a history: the threads take one block after the other, and Progress hears of it as it does from
/// ensemble::run.
class Machine {
   public:
    Machine(const History& history, bool terminal) : history_(history), terminal_(terminal) {}

    Outcome run() {
        ProgressOptions::Done total = history_.already_done;
        std::vector<PlannedBlock> plan;
        for (const Block& block : history_.blocks) {
            plan.push_back({block.gyros, block.gyros * block.turns});
            total.gyros += plan.back().gyros;
            total.turns += plan.back().turns;
        }
        Progress progress(total.gyros, {.total_turns = total.turns,
                                        .already_done = history_.already_done,
                                        .out = &out_,
                                        .is_terminal = terminal_,
                                        .clock = [this] { return clock(); },
                                        .terminal_width = [] { return 160; }});
        if (history_.before_s > 0.0) {
            tell([&] { progress.stage("preparing"); });
            now_s_ += history_.before_s;
        }
        tell([&] { progress.plan(plan, history_.threads); });
        threads_.resize(static_cast<std::size_t>(history_.threads));
        for (Thread& thread : threads_) take_block(thread, progress);
        while (Thread* next = first_busy()) {
            now_s_ = next->at_s;
            step(*next, progress);
        }
        if (history_.after_s > 0.0) {
            tell([&] { progress.stage("summing up"); });
            now_s_ += history_.after_s;
        }
        tell([&] { progress.finish(); });
        outcome_.end_s = now_s_;
        for (Shown& shown : outcome_.shown) shown.truly_left_s = now_s_ - shown.at_s;
        return outcome_;
    }

   private:
    struct Thread {
        std::optional<std::size_t> block = {};
        BlockStage stage = BlockStage::set_up;
        std::int64_t turns_done = 0;
        double at_s = 0.0;  ///< when something happens next
    };

    std::chrono::steady_clock::time_point clock() const {
        using Clock = std::chrono::steady_clock;
        return Clock::time_point(
            std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1000.0 + now_s_)));
    }
    template <class Call>
    void tell(Call&& call) {
        out_.str("");
        call();
        const std::string text = out_.str();
        outcome_.written += text;
        if (const auto left = left_s(text)) outcome_.shown.push_back({now_s_, *left, 0.0});
    }
    Thread* first_busy() {
        Thread* first = nullptr;
        for (Thread& thread : threads_) {
            if (thread.block && (!first || thread.at_s < first->at_s)) first = &thread;
        }
        return first;
    }
    void take_block(Thread& thread, Progress& progress) {
        thread.block.reset();
        if (taken_ == history_.blocks.size()) return;
        thread = {taken_++, BlockStage::set_up, 0, now_s_ + history_.blocks[taken_].set_up_s};
        tell([&] { progress.enter(*thread.block, BlockStage::set_up); });
    }
    bool tables_on_the_way(const Thread& thread) const {
        const Block& block = history_.blocks[*thread.block];
        const std::int64_t piece = (thread.turns_done - 1) / piece_turns;
        return piece % block.tabulated_every == 0 && piece / block.tabulated_every < block.tabulated;
    }
    void begin_piece(Thread& thread) const {
        const Block& block = history_.blocks[*thread.block];
        const std::int64_t turns = std::min(piece_turns, block.turns - thread.turns_done);
        thread.at_s = now_s_ + block.turns_s * static_cast<double>(turns) / static_cast<double>(block.turns) /
                                   history_.pace(now_s_);
        Thread after = thread;
        after.turns_done += turns;
        if (tables_on_the_way(after)) thread.at_s += block.tables_s;
    }
    void step(Thread& thread, Progress& progress) {
        const std::size_t number = *thread.block;
        const Block& block = history_.blocks[number];
        if (thread.stage == BlockStage::set_up) {
            thread.stage = BlockStage::turns;
            tell([&] { progress.enter(number, BlockStage::turns); });
            begin_piece(thread);
        } else if (thread.stage == BlockStage::turns) {
            const std::int64_t turns = std::min(piece_turns, block.turns - thread.turns_done);
            thread.turns_done += turns;
            const bool tabulated = tables_on_the_way(thread);
            if (!tabulated && outcome_.turns_began_s == 0.0) outcome_.turns_began_s = now_s_;
            tell([&] { progress.advance(number, 0, turns * block.gyros, tabulated); });
            if (thread.turns_done < block.turns) return begin_piece(thread);
            thread.stage = BlockStage::output;
            tell([&] { progress.enter(number, BlockStage::output); });
            thread.at_s = now_s_ + block.output_s;
        } else {
            tell([&] { progress.advance(number, block.gyros, 0, false); });
            tell([&] { progress.enter(number, BlockStage::over); });
            take_block(thread, progress);
        }
    }

    const History& history_;
    bool terminal_;
    std::ostringstream out_;
    double now_s_ = 0.0;
    std::size_t taken_ = 0;
    std::vector<Thread> threads_;
    Outcome outcome_;
};

std::vector<Block> alike(std::size_t count, const Block& block) { return std::vector<Block>(count, block); }

/// Points of a design that take from `least` to `most` times as long, in order or not.
std::vector<Block> differing(std::size_t count, double least, double most, bool in_order) {
    std::vector<Block> blocks;
    std::minstd_rand random(7);
    for (std::size_t i = 0; i < count; ++i) {
        const auto place = static_cast<double>(i) / static_cast<double>(count - 1);
        const double share = in_order ? place : std::generate_canonical<double, 32>(random);
        blocks.push_back({.turns_s = 4.0 * (least + (most - least) * share), .set_up_s = 0.3 + share});
    }
    return blocks;
}

std::vector<History> histories() {
    std::vector<History> all;
    all.push_back({.name = "Steady", .blocks = alike(8, {})});
    all.push_back({.name = "OneLongBlock", .threads = 1, .blocks = alike(1, {.turns_s = 3600.0, .turns = 12'800'000})});
    all.push_back({.name = "SetUpAsLongAsTurns", .blocks = alike(10, {.turns_s = 5.0, .set_up_s = 5.0})});
    all.push_back({.name = "TablesInTheFirstTurns", .blocks = alike(4, {.tabulated = 10, .tables_s = 0.8})});
    all.push_back(
        {.name = "TablesOnTheWay", .blocks = alike(12, {.tabulated = 10, .tables_s = 0.5, .tabulated_every = 40})});
    all.push_back({.name = "TablesOfOneLongBlock",
                   .threads = 1,
                   .blocks = alike(1, {.turns_s = 40.0, .tabulated = 40, .tables_s = 0.3, .tabulated_every = 2})});
    all.push_back(
        {.name = "SlowStart", .blocks = alike(12, {}), .pace = [](double t) { return t < 4.0 ? 0.25 : 1.0; }});
    all.push_back(
        {.name = "CrawlsAtFirst", .blocks = alike(8, {}), .pace = [](double t) { return t < 4.0 ? 0.05 : 1.0; }});
    all.push_back({.name = "FastStart", .blocks = alike(12, {}), .pace = [](double t) { return t < 4.0 ? 2.0 : 1.0; }});
    all.push_back({.name = "ThreeBlocksOnTwoThreads", .blocks = alike(3, {.turns_s = 30.0})});
    all.push_back({.name = "OneBlockMoreThanThreads", .threads = 16, .blocks = alike(17, {.turns_s = 30.0})});
    all.push_back({.name = "ManyThreads", .threads = 48, .blocks = alike(63, {.turns_s = 20.0, .set_up_s = 3.0})});
    all.push_back({.name = "FewGyrosInTheLastBlock",
                   .threads = 1,
                   .blocks = {{.turns_s = 20.0}, {.turns_s = 20.0}, {.turns_s = 20.0, .gyros = 1}}});
    all.push_back({.name = "PointsOfManyKinds", .blocks = differing(40, 1.0, 4.0, false)});
    all.push_back({.name = "PointsThatTakeLongerAndLonger", .blocks = differing(40, 1.0, 3.0, true)});
    all.push_back({.name = "PointsOfVeryManyKinds", .threads = 2, .blocks = differing(40, 1.0, 10.0, false)});
    all.push_back({.name = "ManyShortBlocks",
                   .blocks = alike(2000, {.turns_s = 0.02, .set_up_s = 0.03, .output_s = 0.005, .turns = 1000})});
    all.push_back(
        {.name = "Resumed", .blocks = alike(4, {}), .already_done = {.gyros = 16 * 36, .turns = 16 * 36 * 64'000L}});
    all.push_back({.name = "OutputThatTakesLong", .blocks = alike(8, {.turns_s = 6.0, .output_s = 2.0})});
    all.push_back({.name = "PredictionsFirst", .blocks = alike(4, {}), .before_s = 30.0, .after_s = 1.0});
    all.push_back({.name = "AnotherProgramBegins", .blocks = alike(20, {}), .pace = [](double t) {
                       return t < 50.0 ? 1.0 : 0.5;
                   }});
    all.push_back({.name = "UnevenPace", .blocks = alike(8, {}), .pace = [](double t) {
                       return 1.0 + 0.5 * std::sin(7.0 * t) + 0.3 * std::sin(0.9 * t);
                   }});
    return all;
}

struct EnsembleTimeLeft : testing::TestWithParam<History> {};

// The promise of docs/commands.md, for the bar and for plain lines.
TEST_P(EnsembleTimeLeft, IsWithinAFactorOfTwoNineTimesInTen) {
    for (const bool terminal : {true, false}) {
        const Outcome outcome = Machine(GetParam(), terminal).run();
        int counted = 0;
        int right = 0;
        for (const Shown& shown : outcome.shown) {
            EXPECT_GT(shown.at_s, outcome.turns_began_s);
            if (shown.truly_left_s < 5.0) continue;
            ++counted;
            const double ratio = shown.left_s / shown.truly_left_s;
            right += ratio >= 0.5 && ratio <= 2.0 ? 1 : 0;
        }
        EXPECT_GE(right, 0.9 * counted) << counted << " shown\n" << (terminal ? "" : outcome.written);
        if (!terminal) continue;
        // Silence would be right, too: a time is there for most of the run.
        ASSERT_FALSE(outcome.shown.empty());
        EXPECT_LT(outcome.shown.front().at_s - outcome.turns_began_s, 0.25 * (outcome.end_s - outcome.turns_began_s));
        EXPECT_GT(counted, 2.0 * (outcome.end_s - outcome.turns_began_s));
        RecordProperty("right", right);
        RecordProperty("counted", counted);
    }
}

INSTANTIATE_TEST_SUITE_P(Histories, EnsembleTimeLeft, testing::ValuesIn(histories()),
                         [](const testing::TestParamInfo<History>& history) { return history.param.name; });

/// One block of 16 gyros and so many turns each, on one thread, that goes on at so many turns of each gyro a second.
struct OneBlock {
    explicit OneBlock(std::int64_t turns) {
        time_left.plan({{PlannedBlock{16, 16 * turns}}}, 1);
        time_left.enter(0, BlockStage::set_up, 0.0);
        time_left.enter(0, BlockStage::turns, 5.0);
        now_s = 5.0;
    }
    /// The time left at the end of so many tenths of a second.
    std::optional<double> go(int tenths, std::int64_t turns_in_a_tenth) {
        std::optional<double> left_s;
        for (int i = 0; i < tenths; ++i) {
            now_s += 0.1;
            time_left.advance(0, 16 * turns_in_a_tenth, false, now_s);
            left_s = time_left.seconds(now_s);
        }
        return left_s;
    }

    TimeLeft time_left;
    double now_s = 0.0;
};

TEST(EnsembleTimeLeft, IsNotKnownBeforeTwoSecondsOfTurns) {
    OneBlock block(10'000);
    EXPECT_FALSE(block.go(19, 10));
    const auto left_s = block.go(2, 10);
    ASSERT_TRUE(left_s);
    EXPECT_NEAR(*left_s, 97.9, 0.1);
    EXPECT_NEAR(block.time_left.turns_per_s(block.now_s), 1600.0, 1e-6) << "the set-up is not in it";
}

TEST(EnsembleTimeLeft, IsNotKnownWhileWhatWasKnownIsContradicted) {
    OneBlock block(20'000);
    EXPECT_TRUE(block.go(40, 10)) << "196 s";
    EXPECT_FALSE(block.go(40, 100)) << "five times as fast all in all: neither is known to go on";
    const auto left_s = block.go(80, 100);
    ASSERT_TRUE(left_s);
    EXPECT_NEAR(*left_s, 7.6, 0.6) << "the slow part counts for less and less";
}

// A run of 20 s, whose first 128 turns of 1.3 million take 2 s, as turn maps are tabulated on the way: hours, said its
// first line once.
TEST(EnsembleTimeLeft, TheFirstLineOfAShortRunIsNoHoursAway) {
    const History short_run{
        .name = "", .blocks = alike(2, {.turns_s = 12.0, .tabulated = 4, .tables_s = 1.75, .turns = 128 * 10'000})};
    const Outcome outcome = Machine(short_run, false).run();
    EXPECT_NEAR(outcome.end_s, 20.0, 0.1);
    EXPECT_EQ(outcome.written.substr(0, outcome.written.find('\n')), "  0 %  0/32 gyros  set-up");
    for (const Shown& shown : outcome.shown) {
        EXPECT_GT(shown.at_s, 8.0) << "no sooner";
        EXPECT_GE(shown.left_s, 0.5 * shown.truly_left_s);
        EXPECT_LE(shown.left_s, 2.0 * shown.truly_left_s + 1.0);  // rounded up to whole seconds
    }
    EXPECT_FALSE(outcome.shown.empty());
    EXPECT_EQ(outcome.written.find(" h "), std::string::npos) << outcome.written;
}

}  // namespace
}  // namespace ensemble_time_left_test
