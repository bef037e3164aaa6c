#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "tests/cli/program.hpp"
#include "tests/cli/scenarios.hpp"

// Runs that are interrupted, divided and put together again: the file is the one that an undisturbed run writes.
namespace ringlock {
namespace resume_test {
namespace {

using nlohmann::json;
using test::design;
using test::growing;
using test::Outcome;
using test::read_by_readers;
using test::statistics_only;
using test::with_records;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
namespace fs = std::filesystem;

class Resumed : public test::ProgramTest {
   protected:
    /// The file that an undisturbed run writes.
    void write_reference(const std::string& scenario) {
        write("s.toml", scenario);
        fs::remove(directory_ / "reference.h5");
        ASSERT_EQ(run({"run", "s.toml", "-o", "reference.h5", "--checkpoint-every", "never", "--threads", "1"}).status,
                  0);
    }
    /// All but /provenance is equal, by the program that comes with HDF5.
    void expect_reference(const std::string& file) { EXPECT_TRUE(same_results("reference.h5", file)) << file; }
    bool holds_parts(const std::string& output) const {
        std::error_code gone;
        for (const auto& entry : fs::directory_iterator(directory_ / (output + ".parts"), gone)) {
            if (entry.path().extension() == ".part") return true;
        }
        return false;
    }
    /// Kills a run as soon as it has kept something. False where it was through before.
    bool kill_when_something_is_kept(const Arguments& arguments, const std::string& output, int signal = SIGKILL) {
        const pid_t child = start(arguments);
        const auto runs = [&] {
            siginfo_t info{};
            waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | WNOHANG | WNOWAIT);
            return info.si_pid == 0;
        };
        while (!holds_parts(output) && runs()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        kill(child, signal);
        last_ = finish(child);
        return holds_parts(output);
    }
    void expect_to_go_on(std::initializer_list<const char*> scenarios) {
        for (const char* const scenario : scenarios) {
            SCOPED_TRACE(scenario);
            write_reference(scenario);
            ASSERT_TRUE(kill_when_something_is_kept(each_block_, "out.h5"));
            const Outcome r = run({"run", "s.toml", "-o", "out.h5", "--resume"});
            EXPECT_EQ(r.status, 0) << r.err;
            EXPECT_THAT(r.err, HasSubstr("resumed: "));
            expect_reference("out.h5");
            EXPECT_EQ(left(), (std::set<std::string>{"s.toml", "reference.h5", "out.h5"}));
            fs::remove(directory_ / "out.h5");
        }
    }
    void expect_the_same_of_eight_threads(std::initializer_list<const char*> scenarios) {
        for (const char* const scenario : scenarios) {
            SCOPED_TRACE(scenario);
            write_reference(scenario);
            fs::remove(directory_ / "out.h5");
            const Outcome outcome = run({"run", "s.toml", "-o", "out.h5", "--threads", "8"});
            ASSERT_EQ(outcome.status, 0) << outcome.err;
            EXPECT_THAT(outcome.err, Not(HasSubstr("TBB")));
            expect_reference("out.h5");
        }
    }
    /// Kills runs at random moments, each going on from the last, until one is through. Returns how many runs went on
    /// from something. A machine that is busy may need longer for a block than it is first given.
    int kill_and_resume(std::mt19937& random, double longest_s) {
        int used = 0;
        for (;; longest_s *= 1.2) {
            const pid_t child = start({"run", "s.toml", "-o", "out.h5", "--checkpoint-every", "0", "--resume"});
            const double wait_s = std::uniform_real_distribution<double>(0.0, longest_s)(random);
            std::this_thread::sleep_for(std::chrono::duration<double>(wait_s));
            kill(child, SIGKILL);
            const Outcome r = finish(child);
            used += r.err.find("resumed:") != std::string::npos ? 1 : 0;
            if (r.signal == SIGKILL) continue;
            EXPECT_EQ(r.status, 0) << r.err;
            return used;
        }
    }

    Outcome last_;
    const Arguments each_block_ = {"run", "s.toml", "-o", "out.h5", "--checkpoint-every", "0"};
};

class LongResumed : public Resumed {};

TEST_F(Resumed, AKilledRunGoesOnToTheSameFile) { expect_to_go_on({with_records, growing}); }

TEST_F(LongResumed, AKilledRunOfAnyOutputGoesOnToTheSameFile) {
    expect_to_go_on({statistics_only, read_by_readers, design});
}

TEST_F(LongResumed, AnyMomentOfAKillIsAsGoodAsAnother) {
    std::mt19937 random(3);
    write_reference(with_records);
    for (int trial = 0; trial < 3; ++trial) {
        kill_and_resume(random, 0.5);
        expect_reference("out.h5");
        fs::remove(directory_ / "out.h5");
    }
}

TEST_F(Resumed, WithNothingToResumeBegins) {
    write_reference(with_records);
    const Outcome r = run({"run", "s.toml", "-o", "out.h5", "--resume"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.err, Not(HasSubstr("resumed")));
    expect_reference("out.h5");
}

TEST_F(Resumed, AFinishedRunDoesNothing) {
    write_reference(statistics_only);
    ASSERT_EQ(run(each_block_).status, 0);
    const std::string before = read("out.h5");
    const auto names = left();
    const Outcome r = run({"run", "s.toml", "-o", "out.h5", "--resume"});
    EXPECT_EQ(r.status, 0);
    EXPECT_THAT(r.err, AllOf(HasSubstr("out.h5: is finished"), Not(HasSubstr("gyros x"))));
    EXPECT_EQ(read("out.h5"), before);
    EXPECT_EQ(left(), names);
}

TEST_F(Resumed, AnotherRunIsRefusedWithWhatDiffers) {
    write("s.toml", with_records);
    ASSERT_TRUE(kill_when_something_is_kept(each_block_, "out.h5"));
    for (const auto& [extra, key] :
         {std::pair<Arguments, std::string>{{"--seed", "5"}, "ensemble.seed: 1 before, 5 now"},
          {{"--set", "gyro.lockin_threshold_deg_h=250"}, "gyro.lockin_threshold_deg_h"},
          {{"--set", "ensemble.gyros=91"}, "ensemble.gyros: 90 before, 91 now"}}) {
        Arguments arguments = {"run", "s.toml", "-o", "out.h5", "--resume"};
        arguments.insert(arguments.end(), extra.begin(), extra.end());
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 2);
        EXPECT_THAT(r.err, AllOf(HasSubstr("out.h5.parts"), HasSubstr(key), HasSubstr("--discard")));
        EXPECT_TRUE(holds_parts("out.h5"));
    }
}

TEST_F(Resumed, WithoutBeingAskedNothingThatIsKeptIsLost) {
    write_reference(with_records);
    ASSERT_TRUE(kill_when_something_is_kept(each_block_, "out.h5"));
    const Outcome r = run({"run", "s.toml", "-o", "out.h5"});
    EXPECT_EQ(r.status, 2);
    EXPECT_THAT(r.err, AllOf(HasSubstr("out.h5.parts"), HasSubstr("--resume"), HasSubstr("--discard")));
    EXPECT_TRUE(holds_parts("out.h5"));
    EXPECT_EQ(run({"run", "s.toml", "-o", "out.h5", "--discard"}).status, 0);
    expect_reference("out.h5");
    EXPECT_FALSE(fs::exists(directory_ / "out.h5.parts"));
}

TEST_F(Resumed, AnInterruptedRunSaysWhatIsKeptAndWhatABlockTakes) {
    write_reference(with_records);
    for (const int number : {SIGINT, SIGTERM}) {
        if (!kill_when_something_is_kept(each_block_, "out.h5", number)) continue;
        EXPECT_EQ(last_.signal, number);
        EXPECT_EQ(last_.out, "");
        EXPECT_THAT(last_.err,
                    AllOf(HasSubstr("interrupted; "), HasSubstr("of 90 gyros are kept in"), HasSubstr("out.h5.parts"),
                          HasSubstr("--resume"), HasSubstr("a block of up to 16 gyros")));
        EXPECT_EQ(run({"run", "s.toml", "-o", "out.h5", "--resume"}).status, 0);
        expect_reference("out.h5");
        fs::remove(directory_ / "out.h5");
    }
}

TEST_F(Resumed, TheSecondOfTwoRunsOnOneOutputIsRefused) {
    write_reference(with_records);
    const pid_t first = start(each_block_);
    ASSERT_TRUE(soon([&] { return fs::exists(directory_ / "out.h5.parts" / "run.json"); }));
    kill(first, SIGSTOP);
    const fs::path streams = streams_;
    streams_ = streams / "second";
    fs::create_directories(streams_);
    for (const char* const way : {"--resume", "--discard", "-q"}) {
        const Outcome second = run({"run", "s.toml", "-o", "out.h5", way});
        EXPECT_EQ(second.status, 2);
        EXPECT_THAT(second.err, AllOf(HasSubstr("out.h5: is being written by process " + std::to_string(first)),
                                      HasSubstr(" on ")));
    }
    streams_ = streams;
    kill(first, SIGCONT);
    EXPECT_EQ(finish(first).status, 0);
    expect_reference("out.h5");
}

TEST_F(Resumed, StatusTellsHowFarItIs) {
    write("s.toml", with_records);
    EXPECT_EQ(run({"status", "out.h5"}).status, 2);
    ASSERT_TRUE(kill_when_something_is_kept(each_block_, "out.h5"));
    const Outcome text = run({"status", "out.h5"});
    EXPECT_EQ(text.status, 0) << text.err;
    EXPECT_THAT(text.out, AllOf(HasSubstr("out.h5: interrupted"), HasSubstr("of 90 gyros"), HasSubstr("--resume")));
    const json told = json::parse(run({"status", "out.h5", "--json"}).out);
    EXPECT_EQ(told["outputs"][0]["state"], "interrupted");
    EXPECT_GE(told["outputs"][0]["gyros"].get<int>(), 8);
    ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5", "--resume"}).status, 0);
    EXPECT_THAT(run({"status", "out.h5"}).out, HasSubstr("out.h5: finished"));
}

TEST_F(Resumed, StatusRefusesAFileThatNoRunWrites) {
    write("notes.txt", "not a result\n");
    const Outcome text = run({"status", "notes.txt"});
    EXPECT_EQ(text.status, 2);
    EXPECT_THAT(text.err,
                AllOf(HasSubstr("notes.txt: the file is neither a result nor a shard"), HasSubstr("with -o")));
}

TEST_F(Resumed, AnyNumberOfThreadsWritesTheSameFile) {
    if (!has_h5diff()) GTEST_SKIP() << "h5diff (hdf5-tools) is missing";
    expect_the_same_of_eight_threads({with_records, design});
}

TEST_F(LongResumed, AnyNumberOfThreadsWritesTheSameFileOfAnyOutput) {
    if (!has_h5diff()) GTEST_SKIP() << "h5diff (hdf5-tools) is missing";
    expect_the_same_of_eight_threads({statistics_only, read_by_readers, growing});
}

TEST_F(Resumed, AKillCostsNoMoreThanTheLastInterval) {
    // So many turns that the run is far from its end when the first count of finished gyros is there.
    write("s.toml", "[ensemble]\ngyros = 4000\nduration_s = 400.0\n[output]\nangle_record = false\n");
    const pid_t child = start({"run", "s.toml", "-o", "out.h5", "--checkpoint-every", "1", "--threads", "1"});
    const auto finished = [&]() -> std::int64_t {
        const json status = json::parse(read("out.h5.parts/status.json"), nullptr, false);
        return status.is_object() ? status.value("gyros", std::int64_t{0}) : 0;
    };
    ASSERT_TRUE(soon([&] { return finished() > 0; }));
    const std::int64_t before = finished();
    // The interval, and time for a busy machine to write.
    std::this_thread::sleep_for(std::chrono::seconds(4));
    kill(child, SIGKILL);
    EXPECT_EQ(finish(child).signal, SIGKILL) << "the run was through before it could be killed";
    const json status = json::parse(run({"status", "out.h5", "--json"}).out);
    EXPECT_GE(status["outputs"][0]["gyros"].get<std::int64_t>(), before);
}

TEST_F(LongResumed, ShardsMakeTheSameFileInAnyOrder) {
    std::mt19937 random(5);
    for (const char* const scenario : {with_records, read_by_readers, design}) {
        write_reference(scenario);
        const std::vector<int> counts = scenario == with_records ? std::vector{1, 3, 7, 16} : std::vector{3};
        for (const int count : counts) {
            SCOPED_TRACE(count);
            std::vector<std::string> shards;
            for (int number = 1; number <= count; ++number) {
                const std::string name = std::to_string(number) + "/" + std::to_string(count);
                const Outcome r = run(
                    {"run", "s.toml", "-o", "out.h5", "--shard", name, "--threads", std::to_string(1 + number % 2)});
                ASSERT_EQ(r.status, 0) << r.err;
                EXPECT_EQ(r.out, "");
                shards.push_back("out.h5.shard-" + std::to_string(number) + "-of-" + std::to_string(count));
            }
            std::shuffle(shards.begin(), shards.end(), random);
            Arguments merge = {"merge", "out.h5"};
            merge.insert(merge.end(), shards.begin(), shards.end());
            const Outcome merged = run(merge);
            EXPECT_EQ(merged.status, 0) << merged.err;
            EXPECT_THAT(merged.out, HasSubstr("Angle random walk"));
            expect_reference("out.h5");
            fs::remove(directory_ / "out.h5");
            EXPECT_EQ(run({"merge", "out.h5"}).status, 0);  // finds them by itself
            expect_reference("out.h5");
            fs::remove(directory_ / "out.h5");
            for (const std::string& shard : shards) fs::remove(directory_ / shard);
        }
    }
}

TEST_F(Resumed, AShardThatWasKilledGoesOn) {
    write_reference(with_records);
    const Arguments shard = {"run", "s.toml", "-o", "out.h5", "--shard", "1/2", "--checkpoint-every", "0"};
    ASSERT_TRUE(kill_when_something_is_kept(shard, "out.h5.shard-1-of-2"));
    EXPECT_THAT(run({"status", "out.h5"}).out, HasSubstr("shard 1/2: interrupted"));
    Arguments resume = shard;
    resume.push_back("--resume");
    EXPECT_THAT(run(resume).err, HasSubstr("resumed: "));
    EXPECT_THAT(run(resume).err, HasSubstr("is finished"));
    EXPECT_EQ(run({"run", "s.toml", "-o", "out.h5", "--shard", "2/2"}).status, 0);
    EXPECT_EQ(run({"merge", "out.h5"}).status, 0);
    expect_reference("out.h5");
}

TEST_F(Resumed, MergingNamesWhatIsMissingAndWritesNothing) {
    write("s.toml", with_records);
    for (const char* const shard : {"1/4", "3/4"}) {
        ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5", "--shard", shard}).status, 0);
    }
    const auto names = left();
    const Outcome r = run({"merge", "out.h5"});
    EXPECT_EQ(r.status, 2);
    EXPECT_EQ(r.out, "");
    EXPECT_THAT(r.err, HasSubstr("2/4 4/4"));
    EXPECT_EQ(run({"merge", "out.h5", "--missing"}).out, "2/4\n4/4\n");
    EXPECT_EQ(left(), names);
}

TEST_F(Resumed, MergingRefusesWhatDoesNotBelongTogether) {
    write("s.toml", statistics_only);
    ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5", "--shard", "1/2"}).status, 0);
    ASSERT_EQ(run({"run", "s.toml", "-o", "other.h5", "--seed", "9", "--shard", "2/2"}).status, 0);
    ASSERT_EQ(run({"run", "s.toml", "-o", "third.h5", "--shard", "2/3"}).status, 0);
    write("letter.txt", "not a shard at all");
    const auto names = left();
    const auto refused = [&](const std::string& shard, const testing::Matcher<std::string>& message) {
        const Outcome r = run({"merge", "new.h5", "out.h5.shard-1-of-2", shard});
        EXPECT_EQ(r.status, 2) << shard;
        EXPECT_EQ(r.out, "");
        EXPECT_THAT(r.err, message);
        EXPECT_EQ(left(), names) << shard;
    };
    refused("other.h5.shard-2-of-2", HasSubstr("ensemble.seed: 1 before, 9 now"));
    refused("third.h5.shard-2-of-3", HasSubstr("2/3"));
    refused("letter.txt", HasSubstr("letter.txt"));
    refused("nowhere", HasSubstr("nowhere"));
    refused("s.toml", HasSubstr("s.toml"));
    EXPECT_EQ(run({"merge", "new.h5"}).status, 2);
    EXPECT_EQ(run({"merge", "s.toml", "out.h5.shard-1-of-2"}).status, 2);
}

TEST_F(LongResumed, ADamagedShardIsNeverMerged) {
    write("s.toml", statistics_only);
    ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5", "--shard", "1/1"}).status, 0);
    const std::string whole = read("out.h5.shard-1-of-1");
    EXPECT_THAT(run({"validate", "out.h5.shard-1-of-1"}).out, HasSubstr("a valid shard 1/1: 90 gyros"));
    std::mt19937_64 random(11);
    for (int trial = 0; trial < 40; ++trial) {
        std::string damaged = whole;
        if (trial % 4 == 0) {
            damaged.resize(random() % whole.size());
        } else {
            const std::size_t bit = random() % (8 * whole.size());
            damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
        }
        write("out.h5.shard-1-of-1", damaged);
        const Outcome r = run({"merge", "out.h5"});
        EXPECT_EQ(r.status, 2) << trial;
        EXPECT_EQ(run({"validate", "out.h5.shard-1-of-1"}).status, 2) << trial;
        EXPECT_THAT(r.err, HasSubstr("out.h5.shard-1-of-1"));
        EXPECT_FALSE(fs::exists(directory_ / "out.h5"));
    }
}

TEST_F(Resumed, WhatCannotBeDividedIsRefused) {
    write("s.toml", growing);
    EXPECT_THAT(run({"run", "s.toml", "-o", "out.h5", "--shard", "1/2"}).err, HasSubstr("stopping rule"));
    write("s.toml", "[ensemble]\ngyros = 2\nduration_s = 20.0\n");
    EXPECT_THAT(run({"run", "s.toml", "-o", "out.h5", "--shard", "1/3"}).err, HasSubstr("2 gyros"));
    EXPECT_THAT(run({"run", "s.toml", "-o", "out.h5", "--shard", "4/3"}).err, HasSubstr("--shard 4/3"));
    EXPECT_THAT(run({"run", "s.toml", "-o", "out.h5", "--shard", "1/2", "--plot", "a.svg"}).err, HasSubstr("--plot"));
    EXPECT_THAT(run({"run", "s.toml", "-o", "out.h5", "--checkpoint-every", "-1"}).err,
                HasSubstr("--checkpoint-every"));
    EXPECT_THAT(run({"run", "s.toml", "-o", "out.h5", "--checkpoint-every", "1s"}).err,
                HasSubstr("--checkpoint-every"));
    EXPECT_EQ(run({"run", "s.toml", "-o", "out.h5", "--resume", "--discard"}).status, 2);
    EXPECT_EQ(left(), std::set<std::string>{"s.toml"});
}

TEST_F(Resumed, AFileThatIsNoShardIsKept) {
    write("s.toml", statistics_only);
    write("out.h5.shard-1-of-2", "mine");
    const Outcome r = run({"run", "s.toml", "-o", "out.h5", "--shard", "1/2"});
    EXPECT_EQ(r.status, 2);
    EXPECT_THAT(r.err, HasSubstr("out.h5.shard-1-of-2"));
    EXPECT_EQ(read("out.h5.shard-1-of-2"), "mine");
}

class LongKills : public Resumed {};

TEST_F(LongKills, AtAHundredRandomMomentsEndInTheSameFile) {
    std::mt19937 random(17);
    int used = 0;
    for (const char* const scenario : {with_records, statistics_only, design, growing}) {
        write_reference(scenario);
        for (int trial = 0; trial < 25; ++trial) {
            used += kill_and_resume(random, 0.4) > 0 ? 1 : 0;
            expect_reference("out.h5");
            fs::remove(directory_ / "out.h5");
        }
    }
    EXPECT_GE(used, 50);
    RecordProperty("final_files_of_resumed_runs_that_used_parts", used);
}

}  // namespace
}  // namespace resume_test
}  // namespace ringlock
