// ringlock closure from outside: what it prints and what it leaves.
#include <gmock/gmock.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "tests/cli/program.hpp"

namespace ringlock::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class ClosureProgram : public ProgramTest {
   protected:
    void SetUp() override {
        ProgramTest::SetUp();
        write("s.toml", "[ensemble]\nduration_s = 8\ngyros = 1\ndither_asymmetry_sd_ratio = 0\n");
        ASSERT_EQ(run({"record", "s.toml", "-o", "r.h5"}).status, 0);
    }
    /// Every file of found/, once somebody has changed it or has put one of his own in its place, is kept.
    void expect_others_kept() const {
        std::set<std::string> names;
        for (const auto& entry : std::filesystem::directory_iterator(directory_ / "found")) {
            names.insert(entry.path().filename().string());
        }
        EXPECT_TRUE(names.contains("report.md") && names.contains("closed.toml")) << testing::PrintToString(names);
        for (const std::string& name : names) {
            const std::string own = read("found/" + name);
            for (const std::string& theirs : {std::string("a note of mine\n"), "# changed\n" + own}) {
                write("found/" + name, theirs);
                const Outcome r = run({"closure", "r.h5", "-o", "found"});
                EXPECT_EQ(r.status, 2) << name;
                EXPECT_THAT(r.err, HasSubstr("found: " + name + " would be replaced")) << name;
                EXPECT_EQ(r.out, "") << "it was computed before it was refused";
                EXPECT_EQ(read("found/" + name), theirs);
            }
            write("found/" + name, own);
        }
    }
    bool has(const std::string& name) const { return std::filesystem::exists(directory_ / name); }
};

TEST_F(ClosureProgram, LeavesAReport) {
    const Outcome r = run({"closure", "r.h5", "-o", "found", "--json"});
    EXPECT_EQ(r.status, 0) << r.err;
    const auto printed = nlohmann::json::parse(r.out);
    EXPECT_EQ(printed.at("predictive").at("simulations"), 39);
    EXPECT_EQ(nlohmann::json::parse(read("found/closure.json")), printed);
    const std::string page = read("found/report.md");
    EXPECT_THAT(page, AllOf(HasSubstr("# What was found in r.h5"), HasSubstr("## The base model"),
                            HasSubstr("Allan deviation"), HasSubstr("`closed.toml`")));
    for (const char* file : {"closed.toml", "closure.h5"}) EXPECT_TRUE(has(std::string("found/") + file)) << file;
    EXPECT_EQ(run({"validate", "found/closed.toml"}).status, 0);
    // What it wrote itself it replaces, whatever the figures and their order.
    EXPECT_EQ(run({"closure", "r.h5", "-o", "found", "-q"}).status, 0);
    EXPECT_EQ(nlohmann::json::parse(read("found/closure.json")), printed);
    expect_others_kept();
    // Without a folder nothing is simulated and nothing written.
    const Outcome alone = run({"closure", "r.h5", "--json"});
    EXPECT_EQ(alone.status, 0) << alone.err;
    EXPECT_FALSE(nlohmann::json::parse(alone.out).contains("predictive"));
    EXPECT_EQ(left(), (std::set<std::string>{"found", "r.h5", "s.toml"}));
}

TEST_F(ClosureProgram, DoesWithoutGnuplot) {
    const Outcome r = run({"closure", "r.h5", "-o", "found"}, [] { setenv("PATH", "/nowhere", 1); });
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, HasSubstr("among 39 simulations of this model"));
    EXPECT_THAT(read("found/report.md"), AllOf(HasSubstr("Figures are missing"), Not(HasSubstr(".svg)"))));
    EXPECT_FALSE(has("found/allan.svg"));
}

TEST_F(ClosureProgram, RefusesAFolderThatIsAFile) {
    const Outcome r = run({"closure", "r.h5", "-o", "s.toml"});
    EXPECT_EQ(r.status, 2);
    EXPECT_THAT(r.err, HasSubstr("s.toml"));
    EXPECT_EQ(left(), (std::set<std::string>{"r.h5", "s.toml"}));
}

/// How much memory the loop takes of records of turns.
class LongClosureMemory : public ProgramTest {
   protected:
    /// Peak of a process that reads a record of so long at 380 Hz with these effects, beyond what the program takes
    /// for nothing, over the turns.
    double bytes_per_turn(int duration_s, const std::string& effects) {
        write("s.toml",
              "[dither]\nfrequency_hz = 380.0\npeak_rate_deg_s = 150.0\n[ensemble]\ngyros = 1\n"
              "dither_asymmetry_sd_ratio = 0\nduration_s = " +
                  std::to_string(duration_s) + "\n" + effects);
        EXPECT_EQ(run({"record", "s.toml", "-o", "r.h5"}).status, 0);
        const double bytes = peak_bytes({"closure", "r.h5", "-q", "-o", "found"});
        return (bytes - fixed_bytes) / (760.0 * duration_s);
    }
    double peak_bytes(const Arguments& arguments) {
        const pid_t child = start(arguments);
        int raw = 0;
        rusage used = {};
        wait4(child, &raw, 0, &used);
        EXPECT_TRUE(WIFEXITED(raw) && WEXITSTATUS(raw) == 0) << contents(streams_ / "err");
        return 1024.0 * static_cast<double>(used.ru_maxrss);
    }
    /// The program and its libraries take 18 MB, their tables and the threads' heaps some more.
    static constexpr double fixed_bytes = 32e6;
    static constexpr double most_bytes_per_turn = 2000.0;
};

TEST_F(LongClosureMemory, IsTwoKilobytesATurn) {
    const double bytes = bytes_per_turn(60, "");
    std::printf("%.0f bytes a turn\n", bytes);
    EXPECT_LT(bytes, most_bytes_per_turn);
}

TEST_F(ClosureProgram, EndsAtASignalWithNothingWritten) {
    write("long.toml", "[ensemble]\nduration_s = 120\ngyros = 1\ndither_asymmetry_sd_ratio = 0\n");
    ASSERT_EQ(run({"record", "long.toml", "-o", "long.h5"}).status, 0);
    for (const int number : {SIGINT, SIGTERM}) {
        const pid_t child = start({"closure", "long.h5", "-o", "found"});
        ASSERT_TRUE(soon([&] { return contents(streams_ / "err").find("fitting") != std::string::npos; }));
        kill(child, number);
        // Not waited for, it would end by itself much later. The program gives itself 0.8 s.
        const Outcome r = finish(child);
        EXPECT_EQ(r.signal, number);
        EXPECT_THAT(r.err, HasSubstr("interrupted, nothing written"));
        EXPECT_EQ(r.out, "");
        EXPECT_EQ(left(), (std::set<std::string>{"long.h5", "long.toml", "r.h5", "s.toml"}));
    }
}

}  // namespace
}  // namespace ringlock::test
