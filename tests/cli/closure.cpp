// ringlock closure from outside: what it prints and what it leaves.
#include <gmock/gmock.h>
#include <stdlib.h>

#include <nlohmann/json.hpp>

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
