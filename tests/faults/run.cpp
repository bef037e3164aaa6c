#include <gmock/gmock.h>
#include <sys/resource.h>

#include <csignal>

#include "tests/cli/program.hpp"

// What goes wrong outside of the program while it runs: signals and full disks. Nothing half-written may be left.
namespace ringlock {
namespace run_test {
namespace {

using test::Outcome;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// Minutes of work if nobody stops it.
constexpr const char* long_scenario = "[ensemble]\ngyros = 64\nduration_s = 20000.0\n";
constexpr const char* short_scenario = "[ensemble]\ngyros = 2\nduration_s = 50.0\n";

class RunFaults : public test::ProgramTest {
   protected:
    void SetUp() override {
        ProgramTest::SetUp();
        write("long.toml", long_scenario);
        write("short.toml", short_scenario);
    }
    bool has_partial() const {
        for (const std::string& name : left()) {
            if (name.ends_with(".partial")) return true;
        }
        return false;
    }
    /// A long run that has claimed its output.
    pid_t start_long(const Prepare& prepare = {}) {
        const pid_t child = start({"run", "long.toml", "-o", "out.h5", "--threads", "2"}, prepare);
        EXPECT_TRUE(soon([&] { return has_partial(); }));
        return child;
    }
    /// The folder of the run may be there, without anything finished; the next run takes it over.
    void expect_no_file() const {
        for (const std::string& name : left()) EXPECT_TRUE(untouched_.contains(name) || name == "out.h5.parts") << name;
    }
    const std::set<std::string> untouched_ = {"long.toml", "short.toml"};
};

/// As `ulimit -f` does; the program itself must cope with the signal that comes with it.
void limit_file_size(rlim_t bytes) {
    const rlimit limit{bytes, bytes};
    setrlimit(RLIMIT_FSIZE, &limit);
}

TEST_F(RunFaults, ASignalEndsTheRunAndLeavesNothing) {
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
        const pid_t child = start_long();
        kill(child, number);
        const Outcome r = finish(child);
        EXPECT_EQ(r.signal, number) << "status " << r.status;
        EXPECT_EQ(r.out, "");
        EXPECT_THAT(r.err, HasSubstr("interrupted, nothing written"));
        EXPECT_EQ(left(), untouched_);
    }
}

TEST_F(RunFaults, ASignalAtAnyMomentLeavesNothing) {
    for (const int milliseconds : {0, 2, 5, 10, 20, 40, 80, 160, 320}) {
        const pid_t child = start({"run", "long.toml", "-o", "out.h5"});
        std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
        kill(child, SIGINT);
        EXPECT_EQ(finish(child).signal, SIGINT) << milliseconds;
        EXPECT_EQ(left(), untouched_) << milliseconds;
    }
}

TEST_F(RunFaults, ASecondSignalEndsAtOnceAndLeavesNoFile) {
    const pid_t child = start_long();
    kill(child, SIGINT);
    kill(child, SIGTERM);
    const Outcome r = finish(child);
    EXPECT_TRUE(r.signal == SIGINT || r.signal == SIGTERM) << "status " << r.status;
    expect_no_file();
    write("long.toml", short_scenario);
    EXPECT_EQ(run({"run", "long.toml", "-o", "out.h5"}).status, 0);
    EXPECT_FALSE(left().contains("out.h5.parts"));
}

// The file is there, and the program has not yet seen that it made it.
TEST_F(RunFaults, ASecondSignalWhileTheFileIsMadeLeavesNoFile) {
    const pid_t child = start_long([] {
        setenv("LD_PRELOAD", RINGLOCK_DISK_FAULTS, 1);
        setenv("RINGLOCK_SLOW_CREATE_MS", "200", 1);
    });
    kill(child, SIGINT);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    kill(child, SIGTERM);
    const Outcome r = finish(child);
    EXPECT_TRUE(r.signal == SIGINT || r.signal == SIGTERM) << "status " << r.status;
    expect_no_file();
}

TEST_F(RunFaults, AnInterruptedRunKeepsTheResultOfAnEarlierOne) {
    write("long.toml", short_scenario);
    ASSERT_EQ(run({"run", "long.toml", "-o", "out.h5"}).status, 0);
    const std::string before = read("out.h5");
    const pid_t child = start({"run", "long.toml", "-o", "out.h5"});
    kill(child, SIGTERM);
    finish(child);
    if (read("out.h5") != before) {  // it was faster than the signal
        EXPECT_EQ(run({"validate", "out.h5"}).status, 0);
    }
    EXPECT_FALSE(has_partial());
}

TEST_F(RunFaults, AResultThatTheDiskCannotHoldFailsTheRunAndLeavesNothingHalfWritten) {
    // At the first byte, in the middle of the angle records, and close to the end.
    for (const rlim_t bytes : {0, 1, 100, 2048, 4096, 8192, 16384, 24576, 32768}) {
        const Outcome r = run({"run", "short.toml", "-o", "out.h5"}, [&] {
            // The limit holds for the files behind the standard streams, too.
            limit_file_size(bytes);
            dup2(open("/dev/null", O_WRONLY), STDOUT_FILENO);
        });
        if (r.status == 0) {
            EXPECT_GE(bytes, 8192U) << "a result that small cannot be whole";
            EXPECT_EQ(run({"validate", "out.h5"}).status, 0);
            std::filesystem::remove(directory_ / "out.h5");
            continue;
        }
        EXPECT_EQ(r.status, 1) << bytes << " bytes, signal " << r.signal << "\n" << r.err;
        if (bytes > 1024) {  // the message is written into a file, too
            EXPECT_THAT(r.err, AllOf(HasSubstr("out.h5"), HasSubstr("File too large"))) << bytes;
        }
        // What was finished may be kept; then the result can be had where there is room.
        if (left().contains("out.h5.parts")) {
            EXPECT_EQ(run({"run", "short.toml", "-o", "out.h5", "--resume"}).status, 0);
            std::filesystem::remove(directory_ / "out.h5");
        }
        EXPECT_EQ(left(), untouched_) << bytes;
    }
}

TEST_F(RunFaults, AFullDiskKeepsTheResultOfAnEarlierRun) {
    ASSERT_EQ(run({"run", "short.toml", "-o", "out.h5"}).status, 0);
    const std::string before = read("out.h5");
    EXPECT_EQ(run({"run", "short.toml", "-o", "out.h5"}, [] { limit_file_size(4096); }).status, 1);
    EXPECT_EQ(read("out.h5"), before);
    EXPECT_FALSE(has_partial());
}

TEST_F(RunFaults, OutputThatCannotBeWrittenIsAFailure) {
    if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
    ASSERT_EQ(run({"run", "short.toml", "-o", "out.h5"}).status, 0);
    const std::vector<Arguments> commands = {{"run", "short.toml", "-o", "out.h5"},
                                             {"run", "short.toml", "-o", "out.h5", "--json"},
                                             {"run", "--print-schema"},
                                             {"analyze", "out.h5"},
                                             {"validate", "short.toml"},
                                             {"--help"},
                                             {"run", "--help"},
                                             {"--version"}};
    for (const Arguments& arguments : commands) {
        const Outcome r = run(arguments, [] { dup2(open("/dev/full", O_WRONLY), STDOUT_FILENO); });
        EXPECT_EQ(r.status, 1) << arguments[0];
        EXPECT_THAT(r.err, HasSubstr("standard output cannot be written")) << arguments[0];
    }
    EXPECT_EQ(run({"validate", "out.h5"}).status, 0) << "the result was whole before the table was printed";
}

TEST_F(RunFaults, ClosedStandardStreamsDoNotEndUpInTheResult) {
    const Outcome r = run({"run", "short.toml", "-o", "out.h5"}, [] {
        close(STDIN_FILENO);
        close(STDERR_FILENO);
    });
    EXPECT_EQ(r.status, 0);
    EXPECT_EQ(run({"validate", "out.h5"}).status, 0);
    EXPECT_THAT(read("out.h5"), Not(HasSubstr("the result will take")));
}

TEST_F(RunFaults, ClosedStandardOutputIsAFailure) {
    const Outcome r = run({"run", "short.toml", "-o", "out.h5"}, [] { close(STDOUT_FILENO); });
    EXPECT_EQ(r.status, 1);
    EXPECT_THAT(r.err, HasSubstr("standard output cannot be written"));
    EXPECT_EQ(run({"validate", "out.h5"}).status, 0);
}

TEST_F(RunFaults, MessagesThatNobodyCanReadChangeNothing) {
    if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
    const auto deaf = [] { dup2(open("/dev/full", O_WRONLY), STDERR_FILENO); };
    EXPECT_EQ(run({"run", "short.toml", "-o", "out.h5"}, deaf).status, 0);
    EXPECT_EQ(run({"validate", "out.h5"}).status, 0);
    EXPECT_EQ(run({"run", "missing.toml"}, deaf).status, 2);
    EXPECT_EQ(run({"run", "--nonsense"}, deaf).status, 2);
}

TEST_F(RunFaults, TooLittleMemoryIsAFailureThatSaysSo) {
#ifdef __SANITIZE_ADDRESS__
    GTEST_SKIP() << "the address sanitizer needs more memory than the limit leaves";
#endif
    // Of data, not of addresses: the program does not know beforehand of all limits that there are.
    write("huge.toml", "[ensemble]\ngyros = 600000\n[output]\nangle_record = false\n");
    const Outcome r = run({"run", "huge.toml", "-o", "out.h5"}, [] {
        const rlimit limit{rlim_t{192} << 20, rlim_t{192} << 20};
        setrlimit(RLIMIT_DATA, &limit);
    });
    EXPECT_EQ(r.status, 1) << "signal " << r.signal << "\n" << r.err;
    EXPECT_THAT(r.err, HasSubstr("memory"));
    std::set<std::string> expected = untouched_;
    expected.insert("huge.toml");
    EXPECT_EQ(left(), expected);
}

}  // namespace
}  // namespace run_test
}  // namespace ringlock
