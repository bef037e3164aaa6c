#include <gmock/gmock.h>
#include <signal.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/cli/program.hpp"
#include "tests/cli/scenarios.hpp"

// Processes of mpirun that simulate one run: the file is the one that a single process writes.
namespace ringlock {
namespace ranks_test {
namespace {

using test::design;
using test::growing;
using test::Outcome;
using test::with_records;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
namespace fs = std::filesystem;

/// Passes messages through sockets, and one-sided operations as messages: the target must call MPI to serve them.
const std::vector<std::string> without_hardware = {"--mca", "osc", "pt2pt", "--mca", "btl", "self,tcp"};

class Ranks : public test::ProgramTest {
   protected:
    static void as_root() {
        setenv("OMPI_ALLOW_RUN_AS_ROOT", "1", 1);
        setenv("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1", 1);
    }
    void launch_with(int processes, const std::vector<std::string>& options = {}) {
        launcher_ = {RINGLOCK_MPIRUN, "--oversubscribe", "-n", std::to_string(processes)};
        launcher_.insert(launcher_.begin() + 1, options.begin(), options.end());
    }
    Outcome run_ranks(const Arguments& arguments) const { return run(arguments, as_root); }

    void write_reference(const std::string& scenario) {
        write("s.toml", scenario);
        fs::remove(directory_ / "reference.h5");
        launcher_.clear();
        ASSERT_EQ(run({"run", "s.toml", "-o", "reference.h5", "--checkpoint-every", "never"}).status, 0);
    }
    void expect_reference(int processes, const std::vector<std::string>& options = {}) {
        launch_with(processes, options);
        fs::remove(directory_ / "out.h5");
        const Outcome outcome = run_ranks({"run", "s.toml", "-o", "out.h5", "--threads", "1"});
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        EXPECT_TRUE(same_results("reference.h5", "out.h5")) << processes << " processes";
        EXPECT_FALSE(fs::exists(directory_ / "out.h5.parts"));
    }

    /// Processes that this one has started.
    static std::vector<pid_t> children_of(pid_t parent) {
        std::vector<pid_t> found;
        for (const auto& entry : fs::directory_iterator("/proc")) {
            const std::string name = entry.path().filename().string();
            if (name.find_first_not_of("0123456789") != std::string::npos) continue;
            std::ifstream in(entry.path() / "stat");
            std::string text((std::istreambuf_iterator<char>(in)), {});
            const std::size_t end = text.rfind(')');
            if (end == std::string::npos || end + 4 > text.size()) continue;
            if (std::atoi(text.c_str() + end + 4) == parent) found.push_back(std::atoi(name.c_str()));
        }
        return found;
    }
    /// Whether a process other than the leader has kept something.
    bool member_has_kept() const {
        std::error_code gone;
        for (const auto& entry : fs::directory_iterator(directory_ / "out.h5.parts", gone)) {
            const std::string name = entry.path().filename().string();
            if (name.starts_with("rank-") && name.ends_with(".part")) return true;
        }
        return false;
    }
};

TEST_F(Ranks, AnyNumberWritesTheSameFile) {
    if (!has_h5diff()) GTEST_SKIP() << "h5diff (hdf5-tools) is missing";
    write_reference(with_records);
    for (const int processes : {1, 2, 3, 4, 7}) expect_reference(processes);
}

TEST_F(Ranks, NeedNoHardwareForOneSidedOperations) {
    if (!has_h5diff()) GTEST_SKIP() << "h5diff (hdf5-tools) is missing";
    write_reference(with_records);
    for (const int processes : {2, 7}) expect_reference(processes, without_hardware);
}

TEST_F(Ranks, SharePointsOfADesign) {
    if (!has_h5diff()) GTEST_SKIP() << "h5diff (hdf5-tools) is missing";
    write_reference(design);
    expect_reference(3);
}

TEST_F(Ranks, GrowALotTogether) {
    if (!has_h5diff()) GTEST_SKIP() << "h5diff (hdf5-tools) is missing";
    write_reference(growing);
    expect_reference(3);
}

TEST_F(Ranks, ShareAShard) {
    if (!has_h5diff()) GTEST_SKIP() << "h5diff (hdf5-tools) is missing";
    write_reference(with_records);
    launch_with(2);
    ASSERT_EQ(run_ranks({"run", "s.toml", "-o", "out.h5", "--threads", "1", "--shard", "1/2"}).status, 0);
    launcher_.clear();
    ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5", "--shard", "2/2"}).status, 0);
    ASSERT_EQ(run({"merge", "out.h5"}).status, 0);
    EXPECT_TRUE(same_results("reference.h5", "out.h5"));
}

TEST_F(Ranks, OneThatDiesEndsTheRunWhichResumes) {
    if (!has_h5diff()) GTEST_SKIP() << "h5diff (hdf5-tools) is missing";
    for (const std::size_t which : {0, 1}) {
        write_reference(with_records);
        fs::remove(directory_ / "out.h5");
        // Turns take long enough for a kill between the first blocks and the last ones.
        const Arguments command = {"run", "s.toml",  "-o", "out.h5", "--threads", "1", "--checkpoint-every",
                                   "0",   "--resume"};
        launch_with(2);
        const pid_t mpirun = start(command, as_root);
        EXPECT_TRUE(soon([&] { return member_has_kept(); }));
        std::vector<pid_t> processes = children_of(mpirun);
        ASSERT_EQ(processes.size(), 2U);
        kill(processes[which], SIGKILL);
        EXPECT_NE(finish(mpirun).status, 0);
        EXPECT_FALSE(fs::exists(directory_ / "out.h5"));
        launch_with(3);
        const Outcome resumed = run_ranks(command);
        EXPECT_EQ(resumed.status, 0) << resumed.err;
        EXPECT_THAT(resumed.err, HasSubstr("resumed: "));
        EXPECT_TRUE(same_results("reference.h5", "out.h5"));
    }
}

TEST_F(Ranks, WrongInputIsToldOnce) {
    write("s.toml", "[gyro]\nlockin = 3.0\n");
    launch_with(3);
    const Outcome outcome = run_ranks({"run", "s.toml"});
    EXPECT_EQ(outcome.status, 2);
    const std::size_t first = outcome.err.find("ringlock: error: s.toml:2");
    ASSERT_NE(first, std::string::npos) << outcome.err;
    EXPECT_EQ(outcome.err.find("ringlock: error", first + 1), std::string::npos) << outcome.err;
    EXPECT_EQ(left(), std::set<std::string>{"s.toml"});
}

TEST_F(Ranks, OfDifferentScenariosAreRefused) {
    write("s.toml", with_records);
    write("other.toml", std::string(with_records) + "[gyro]\nlockin_threshold_deg_h = 150.0\n");
    launch_with(1);
    const Outcome outcome = run_ranks(
        {"run", "s.toml", "-o", "out.h5", ":", "-n", "1", RINGLOCK_PROGRAM, "run", "other.toml", "-o", "out.h5"});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("rank 1 has another scenario"), HasSubstr("lockin_threshold_deg_h")));
    EXPECT_FALSE(fs::exists(directory_ / "out.h5"));
}

TEST_F(Ranks, DoNoBatchesAndNeedCheckpoints) {
    write("s.toml", with_records);
    write("t.toml", with_records);
    launch_with(2);
    const Outcome batch = run_ranks({"run", "s.toml", "t.toml", "-o", "results"});
    EXPECT_EQ(batch.status, 2);
    EXPECT_THAT(batch.err, HasSubstr("batch"));
    const Outcome never = run_ranks({"run", "s.toml", "--checkpoint-every", "never"});
    EXPECT_EQ(never.status, 2);
    EXPECT_THAT(never.err, HasSubstr("--checkpoint-every never"));
    EXPECT_EQ(left(), (std::set<std::string>{"s.toml", "t.toml"}));
}

TEST_F(Ranks, AFinishedRunDoesNothing) {
    write("s.toml", with_records);
    launch_with(2);
    ASSERT_EQ(run_ranks({"run", "s.toml", "-o", "out.h5"}).status, 0);
    const Outcome again = run_ranks({"run", "s.toml", "-o", "out.h5", "--resume"});
    EXPECT_EQ(again.status, 0);
    EXPECT_THAT(again.err, HasSubstr("is finished"));
    EXPECT_THAT(again.out, Not(HasSubstr("turns")));
}

}  // namespace
}  // namespace ranks_test
}  // namespace ringlock
