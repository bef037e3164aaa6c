// ringlock closure from outside: what it prints and what it leaves.
#include <gmock/gmock.h>
#include <stdlib.h>

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

}  // namespace
}  // namespace ringlock::test
