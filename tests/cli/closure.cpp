// ringlock closure from outside: what it prints and what it leaves.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "tests/cli/program.hpp"

namespace ringlock::test {
namespace closure_test {
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
    EXPECT_THAT(page, AllOf(HasSubstr("# Error sources in r.h5"), HasSubstr("## The base model"),
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

/// Records of one box: readings of 61.8 a second, on the straight lines between which are 100 samples a second.
class ChainProgram : public ProgramTest {
   protected:
    void SetUp() override {
        ProgramTest::SetUp();
        write("x.csv", samples(100.0, 1));
        write("y.csv", samples(100.0, 2));
    }
    static std::string samples(double rate_hz, unsigned seed) {
        constexpr double from_hz = 61.8;
        constexpr int rows = 1500;
        std::mt19937_64 bits(seed);
        std::normal_distribution<double> normal;
        std::vector<double> readings;
        double angle = 0.0;
        for (int k = 0; k < rows; ++k) {
            angle += 0.05 * normal(bits);
            readings.push_back(angle + 0.3 * normal(bits));
        }
        const auto at = [&](int row) {
            const double place = from_hz / rate_hz * row + 0.3;
            const auto k = static_cast<std::size_t>(place);
            return readings[k] + (place - static_cast<double>(k)) * (readings[k + 1] - readings[k]);
        };
        std::string text = fmt::format("# rate_hz = {}\nangle_increment_arcsec\n", rate_hz);
        for (int row = 0; row < rows; ++row) text += fmt::format("{:.17g}\n", at(row + 1) - at(row));
        return text;
    }
    bool has(const std::string& name) const { return std::filesystem::exists(directory_ / name); }
};

TEST_F(ChainProgram, RefusesWhatIsNoChain) {
    const auto refused = [&](const Arguments& arguments) {
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 2);
        EXPECT_EQ(r.out, "");
        return r.err;
    };
    write("fast.csv", samples(200.0, 3));
    write("s.toml", "[ensemble]\nduration_s = 8\ngyros = 1\n");
    ASSERT_EQ(run({"record", "s.toml", "-o", "turns.h5"}).status, 0);
    EXPECT_THAT(refused({"closure", "x.csv", "y.csv"}), AllOf(HasSubstr("x.csv, y.csv"), HasSubstr("--same-chain")));
    EXPECT_THAT(refused({"closure", "--same-chain", "x.csv"}), HasSubstr("two or more records"));
    EXPECT_THAT(refused({"closure", "--same-chain", "x.csv", "./x.csv"}), HasSubstr("same file"));
    EXPECT_THAT(refused({"closure", "--same-chain", "x.csv", "fast.csv"}),
                AllOf(HasSubstr("fast.csv: has 200 samples a second"), HasSubstr("read this one by itself")));
    EXPECT_THAT(refused({"closure", "--same-chain", "x.csv", "turns.h5"}), HasSubstr("turns.h5: is a record of turns"));
    EXPECT_THAT(refused({"closure", "--same-chain", "x.csv", "missing.csv"}), HasSubstr("missing.csv"));
    EXPECT_THAT(refused({"closure", "--same-chain", "x.csv", "y.csv", "-o", "s.toml"}), HasSubstr("s.toml"));
    EXPECT_EQ(left(), (std::set<std::string>{"fast.csv", "s.toml", "turns.h5", "x.csv", "y.csv"}));
}

TEST_F(ChainProgram, TellsWhatTheRecordsShare) {
    const Outcome r = run({"closure", "--same-chain", "x.csv", "y.csv", "--json", "-o", "found"});
    ASSERT_EQ(r.status, 0) << r.err;
    const auto printed = nlohmann::json::parse(r.out);
    const auto& chain = printed.at("chain");
    EXPECT_EQ(chain.at("contradicted"), false);
    EXPECT_EQ(chain.at("tied_hz"), nlohmann::json::array());
    EXPECT_NEAR(chain.at("from_hz").at("value"), 61.8, 1e-6);
    EXPECT_EQ(chain.at("record_rate_hz"), 100.0);
    EXPECT_EQ(chain.at("agreement").at("freedom"), 1);
    EXPECT_EQ(chain.at("rates").at(0).at("sum"), 0.0);
    ASSERT_EQ(chain.at("records").size(), 2U);
    EXPECT_EQ(chain.at("records").at(1).at("record"), "y.csv");
    ASSERT_EQ(printed.at("records").size(), 2U);
    for (const auto& record : printed.at("records")) {
        EXPECT_EQ(record.at("verdict"), "closed");
        EXPECT_EQ(record.at("steps").at(0).at("parameters").at("from_hz"), chain.at("from_hz"));
    }
    EXPECT_EQ(nlohmann::json::parse(read("found/closure.json")), printed);
    EXPECT_EQ(nlohmann::json::parse(read("found/x/closure.json")), printed.at("records").at(0));
    EXPECT_THAT(read("found/report.md"), AllOf(HasSubstr("2 records of one data chain"), HasSubstr("(<y/report.md>)")));
    for (const char* file : {"x/report.md", "x/closed.toml", "y/closure.h5"}) {
        EXPECT_TRUE(has(std::string("found/") + file)) << file;
    }
    EXPECT_EQ(left(), (std::set<std::string>{"found", "x.csv", "y.csv"}));
    // What it wrote itself it replaces; what somebody has changed it keeps, of the chain as of a record.
    for (const std::string name : {"found/report.md", "found/closure.json", "found/y/report.md"}) {
        const std::string own = read(name);
        write(name, "# changed\n" + own);
        const Outcome again = run({"closure", "--same-chain", "x.csv", "y.csv", "-o", "found"});
        EXPECT_EQ(again.status, 2) << name;
        EXPECT_THAT(again.err, HasSubstr("would be replaced")) << name;
        EXPECT_EQ(read(name), "# changed\n" + own);
        write(name, own);
    }
    const Outcome text = run({"closure", "--same-chain", "x.csv", "y.csv", "-o", "found", "-q"});
    EXPECT_EQ(text.status, 0) << text.err;
    EXPECT_EQ(text.err, "");
    EXPECT_THAT(text.out, AllOf(HasSubstr("data chain of 2 records: one source of 61.8"), HasSubstr("y.csv\n=====\n")));
}

}  // namespace
}  // namespace closure_test
}  // namespace ringlock::test
