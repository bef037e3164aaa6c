// Several files on one command line, and what becomes of those that were there before.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "tests/cli/program.hpp"

namespace ringlock::test {
namespace files_test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

constexpr const char* small_scenario = "[ensemble]\ngyros = 2\nduration_s = 50.0\n";

class CommandFiles : public ProgramTest {
   protected:
    void SetUp() override {
        ProgramTest::SetUp();
        write("s.toml", small_scenario);
    }
    /// Every file of the directory with what is in it; links are not followed.
    std::set<std::string> everything() const {
        std::set<std::string> all;
        for (const auto& entry : fs::recursive_directory_iterator(directory_)) {
            const std::string name = entry.path().lexically_relative(directory_).string();
            all.insert(entry.is_regular_file() && !entry.is_symlink() ? name + ": " + contents(entry.path()) : name);
        }
        return all;
    }
    /// The command ends with status 2 because of one file with two parts to play, and touches nothing.
    void expect_refused(const Arguments& arguments) const {
        const auto before = everything();
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 2) << testing::PrintToString(arguments) << r.err;
        EXPECT_THAT(r.err, HasSubstr("are the same file")) << testing::PrintToString(arguments);
        EXPECT_EQ(everything(), before) << testing::PrintToString(arguments);
    }
    void link_to(const std::string& name, const std::string& link) const {
        fs::create_hard_link(directory_ / name, directory_ / link);
    }
    void symlink_to(const std::string& name, const std::string& link) const {
        fs::create_symlink(name, directory_ / link);
    }
};

TEST_F(CommandFiles, ARunWritesOverNothingOfItsOwn) {
    write("in.svg", small_scenario);
    symlink_to("a.svg", "dangling.svg");
    symlink_to("s.toml", "s-link.svg");
    link_to("s.toml", "s-too.svg");
    fs::create_directory(directory_ / "sub");
    symlink_to("sub", "sub-link");
    expect_refused({"run", "s.toml", "-o", "a.svg", "--plot", "a.svg"});
    expect_refused({"run", "s.toml", "-o", "a.svg", "--plot", "./sub/../a.svg"});
    expect_refused({"run", "s.toml", "-o", "a.svg", "--plot", "dangling.svg"});
    expect_refused({"run", "s.toml", "-o", "sub/a.svg", "--plot", "sub-link/a.svg"});
    expect_refused({"run", "in.svg", "--plot", "in.svg"});
    expect_refused({"run", "s.toml", "--plot", "s-link.svg"});
    expect_refused({"run", "s.toml", "--plot", "s-too.svg"});
    expect_refused({"run", "s.toml", "-o", "s.toml"});
    write("named.h5", small_scenario);
    expect_refused({"run", "named.h5"});
}

TEST_F(CommandFiles, AResultIsReplacedByItsOwnScenarioStill) {
    ASSERT_EQ(run({"run", "s.toml", "-q"}).status, 0);
    ASSERT_EQ(chmod((directory_ / "s.h5").c_str(), 0600), 0);
    EXPECT_EQ(run({"run", "s.toml", "-q"}).status, 0);
    struct stat status = {};
    ASSERT_EQ(stat((directory_ / "s.h5").c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 07777, 0600U);
}

TEST_F(CommandFiles, NoCommandWritesOverWhatItReads) {
    ASSERT_EQ(run({"run", "s.toml", "-q"}).status, 0);
    link_to("s.h5", "result.svg");
    expect_refused({"analyze", "s.h5", "--plot", "result.svg"});
    expect_refused({"analyze", "result.svg", "--plot", "result.svg"});
    write("data.svg", "1\n2\n3\n4\n");
    expect_refused({"allan", "data.svg", "--rate", "1", "--kind", "rate", "--plot", "data.svg"});
    expect_refused({"record", "s.toml", "-o", "s.toml"});
    write("d.csv", "# format = rlg-record\n");
    symlink_to("d.csv", "d.h5");
    expect_refused({"import", "d.csv", "-o", "d.h5"});
    fs::create_directory(directory_ / "found");
    link_to("s.h5", "found/closure.h5");
    expect_refused({"closure", "s.h5", "-o", "found"});
    link_to("s.toml", "found/closed.toml");
    expect_refused({"closure", "d.csv", "--model", "found/closed.toml", "-o", "found"});
}

TEST_F(CommandFiles, AFileMadeDuringTheRunIsKept) {
    write("long.toml", "[ensemble]\ngyros = 64\nduration_s = 300\n[output]\nangle_record = false\n");
    const pid_t child = start({"run", "long.toml", "-o", "out.h5", "-q"});
    ASSERT_TRUE(soon([&] { return left().size() > 2; })) << "no partial file";
    write("out.h5", "theirs");
    const Outcome r = finish(child);
    EXPECT_EQ(r.status, 1) << r.err;
    EXPECT_THAT(r.err, AllOf(HasSubstr("somebody has made it"), HasSubstr("out.h5.ringlock-1")));
    EXPECT_EQ(read("out.h5"), "theirs");
    EXPECT_EQ(run({"validate", "out.h5.ringlock-1"}).status, 0) << "what was computed is not lost";
}

TEST_F(CommandFiles, ARunThatWasKilledLeavesNothingForLong) {
    write("long.toml", "[ensemble]\ngyros = 64\nduration_s = 20000\n");
    const pid_t child = start({"run", "long.toml", "-o", "out.h5", "-q"});
    ASSERT_TRUE(soon([&] { return left().size() > 2; })) << "no partial file";
    kill(child, SIGKILL);
    finish(child);
    EXPECT_EQ(left().size(), 4U) << "the folder of what is finished, beside the partial file";
    const Outcome r = run({"run", "s.toml", "-o", "out.h5", "-q"});
    EXPECT_EQ(r.status, 0);
    EXPECT_THAT(r.err, AllOf(HasSubstr("ringlock: removed "), HasSubstr("out.h5." + std::to_string(child) + "-0@")));
    EXPECT_EQ(left(), (std::set<std::string>{"long.toml", "out.h5", "s.toml"}));
}

TEST_F(CommandFiles, MoreMemoryThanThereIsIsRefusedBeforeItIsTaken) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "the sanitizer itself takes more memory than the limit leaves";
#endif
    write("huge.toml", "[ensemble]\ngyros = 10000000\n[output]\nangle_record = false\n");
    write("long.toml", "[ensemble]\nduration_s = 200000\n");
    const auto before = everything();
    const auto limited = [] {
        const rlimit limit{rlim_t{1} << 30, rlim_t{1} << 30};
        setrlimit(RLIMIT_AS, &limit);
    };
    for (const Arguments& arguments :
         {Arguments{"run", "huge.toml", "-o", "out.h5"}, Arguments{"record", "long.toml", "-o", "out.h5"}}) {
        const Outcome r = run(arguments, limited);
        EXPECT_EQ(r.status, 2) << r.err;
        EXPECT_THAT(r.err, AllOf(HasSubstr("GB of memory would be taken"), HasSubstr("are free"))) << arguments[0];
        EXPECT_EQ(everything(), before);
    }
}

TEST_F(CommandFiles, MoreDiskThanThereIsIsRefusedBeforeItIsTaken) {
    write("huge.toml", "[ensemble]\ngyros = 20000\nduration_s = 1000000000\n");
    const auto before = everything();
    const Outcome r = run({"run", "huge.toml", "-o", "out.h5"});  // 640 TB
    EXPECT_EQ(r.status, 2) << r.err;
    EXPECT_THAT(r.err, AllOf(HasSubstr("GB of the disk would be taken"), HasSubstr("output.angle_record = false")));
    EXPECT_EQ(everything(), before);
}

/// A program that waits for the other side of a pipe.
class CommandSignals : public CommandFiles {
   protected:
    /// Ends a program that waits, by a signal that is to be heeded within seconds.
    void expect_heeded(pid_t child, int number) const {
        kill(child, number);
        int status = 0;
        pid_t ended = 0;
        EXPECT_TRUE(soon([&] { return (ended = waitpid(child, &status, WNOHANG)) != 0; })) << "deaf to the signal";
        if (ended == 0) {
            kill(child, SIGKILL);
            waitpid(child, &status, 0);
        }
        EXPECT_TRUE(WIFSIGNALED(status));
        EXPECT_EQ(WTERMSIG(status), number);
        EXPECT_THAT(contents(streams_ / "err"), HasSubstr("interrupted, nothing written"));
    }
    /// A pipe by that name, whose reader waits for what nobody writes.
    std::string make_fifo(const std::string& name) const {
        const std::string path = (directory_ / name).string();
        EXPECT_EQ(mkfifo(path.c_str(), 0600), 0);
        return path;
    }
    /// Whether the process waits for something.
    static bool sleeps(pid_t process) {
        const std::string status = contents("/proc/" + std::to_string(process) + "/stat");
        const std::size_t name_ends = status.rfind(')');
        return status.find("(ringlock)") != std::string::npos && status.compare(name_ends, 3, ") S") == 0;
    }
};

TEST_F(CommandSignals, APipeThatSaysNothingIsNotWaitedFor) {
    for (const int number : {SIGINT, SIGTERM}) {
        int ends[2];
        ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
        ASSERT_EQ(::write(ends[1], "1\n2\n", 4), 4);
        const pid_t child =
            start({"allan", "-", "--rate", "1", "--kind", "rate"}, [&] { dup2(ends[0], STDIN_FILENO); });
        ASSERT_TRUE(soon([&] { return sleeps(child); }));
        expect_heeded(child, number);
        close(ends[0]);
        close(ends[1]);
    }
}

TEST_F(CommandSignals, AFifoWithoutAWriterIsNotWaitedFor) {
    make_fifo("data");
    make_fifo("s2.toml");
    for (const Arguments& arguments :
         {Arguments{"validate", "data"}, Arguments{"validate", "s2.toml"}, Arguments{"run", "s2.toml"},
          Arguments{"closure", "data"}, Arguments{"import", "data", "-o", "r.h5"},
          Arguments{"allan", "data", "--rate", "1", "--kind", "rate"}}) {
        const pid_t child = start(arguments);
        ASSERT_TRUE(soon([&] { return sleeps(child); })) << arguments[0];
        expect_heeded(child, SIGINT);
        EXPECT_EQ(left(), (std::set<std::string>{"data", "s.toml", "s2.toml"})) << arguments[0];
    }
}

TEST_F(CommandSignals, AReaderThatReadsNothingIsNotWaitedFor) {
    int ends[2];
    ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
    ASSERT_GT(fcntl(ends[1], F_SETPIPE_SZ, 4096), 0);  // less than the schema takes
    const pid_t child = start({"run", "--print-schema=json"}, [&] { dup2(ends[1], STDOUT_FILENO); });
    ASSERT_TRUE(soon([&] { return sleeps(child); }));
    expect_heeded(child, SIGTERM);
    close(ends[0]);
    close(ends[1]);
}

TEST_F(CommandSignals, AFigureThatIsNotDoneIsNotWaitedFor) {
    fs::create_directory(directory_ / "bin");
    write("bin/gnuplot", "#!/bin/sh\necho here > started\nexec sleep 1000\n");
    fs::permissions(directory_ / "bin/gnuplot", fs::perms::owner_all);
    write("data.txt", "1\n2\n4\n3\n1\n2\n");
    const std::string path = (directory_ / "bin").string() + ":/usr/bin:/bin";
    const pid_t child = start({"allan", "data.txt", "--rate", "1", "--kind", "rate", "--plot", "a.svg"},
                              [&] { setenv("PATH", path.c_str(), 1); });
    ASSERT_TRUE(soon([&] { return left().contains("started"); }));
    expect_heeded(child, SIGTERM);
    EXPECT_EQ(left(), (std::set<std::string>{"bin", "data.txt", "s.toml", "started"}));
}

}  // namespace
}  // namespace files_test
}  // namespace ringlock::test
