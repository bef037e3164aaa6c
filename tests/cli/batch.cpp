#include <gmock/gmock.h>
#include <signal.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "tests/cli/program.hpp"

namespace ringlock {
namespace batch_test {
namespace {

using nlohmann::json;
using test::Outcome;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
namespace fs = std::filesystem;

class BatchCommand : public test::ProgramTest {
   protected:
    void SetUp() override {
        ProgramTest::SetUp();
        write("a.toml", "[ensemble]\ngyros = 3\nduration_s = 10.0\n");
        write("b.toml", "[ensemble]\ngyros = 20\nduration_s = 10.0\n[output]\nangle_record = false\n");
        write("wrong.toml", "[ensemble]\ngyros = -3\n");
    }
    json summary(const std::string& file = "out/batch.json") const { return json::parse(read(file)); }
};

TEST_F(BatchCommand, RunsAllAndASecondTimeNone) {
    const Outcome r = run({"run", "a.toml", "b.toml", "-o", "out"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, AllOf(HasSubstr("a.toml"), HasSubstr("out/b.h5"), HasSubstr("done")));
    EXPECT_THAT(r.err, AllOf(HasSubstr("batch: 2 scenarios, 2 to run; about "), HasSubstr("batch: 2 of 2, b.toml")));
    EXPECT_EQ(run({"validate", "out/a.h5"}).status, 0);
    ASSERT_EQ(summary()["runs"].size(), 2U);
    EXPECT_EQ(summary()["runs"][1]["state"], "done");
    EXPECT_EQ(summary()["runs"][1]["gyros"], 20);
    EXPECT_TRUE(summary()["runs"][0]["arw_deg_rt_h"].contains("noise_injected"));

    const std::string before = read("out/a.h5");
    const Outcome again = run({"run", "a.toml", "b.toml", "-o", "out"});
    EXPECT_EQ(again.status, 0);
    EXPECT_THAT(again.out, AllOf(HasSubstr("finished before"), Not(HasSubstr("done"))));
    EXPECT_EQ(read("out/a.h5"), before);
}

TEST_F(BatchCommand, ResultsAreThoseOfSingleRuns) {
    ASSERT_EQ(run({"run", "a.toml", "b.toml", "-o", "out", "-q", "--seed", "4"}).status, 0);
    ASSERT_EQ(run({"run", "b.toml", "-o", "single.h5", "-q", "--seed", "4"}).status, 0);
    EXPECT_TRUE(same_results("out/b.h5", "single.h5"));
}

TEST_F(BatchCommand, AFailureStopsNoOther) {
    write("other.h5", "somebody's");
    fs::create_directory(directory_ / "out");
    write("out/a.h5", "somebody's, too");
    const Outcome r = run({"run", "wrong.toml", "missing.toml", "a.toml", "b.toml", "-o", "out"});
    EXPECT_EQ(r.status, 1);
    EXPECT_THAT(r.err,
                AllOf(HasSubstr("wrong.toml:2:9"), HasSubstr("missing.toml"), HasSubstr("3 of 4 scenarios failed")));
    EXPECT_THAT(r.out, AllOf(HasSubstr("failed"), HasSubstr("out/b.h5")));
    EXPECT_EQ(read("out/a.h5"), "somebody's, too");
    EXPECT_EQ(run({"validate", "out/b.h5"}).status, 0);
    EXPECT_EQ(summary()["runs"][0]["state"], "failed");
    EXPECT_THAT(summary()["runs"][0]["error"].get<std::string>(), HasSubstr("ensemble.gyros"));
    EXPECT_EQ(summary()["runs"][3]["state"], "done");
}

TEST_F(BatchCommand, PrintsOneJsonObject) {
    const Outcome r = run({"run", "a.toml", "b.toml", "-o", "out", "--json", "-q"});
    EXPECT_EQ(r.status, 0);
    EXPECT_EQ(r.err, "");
    EXPECT_EQ(json::parse(r.out), summary());
}

TEST_F(BatchCommand, OfOneScenarioIsAskedForByTheFolder) {
    EXPECT_EQ(run({"run", "a.toml", "-o", "new/", "-q"}).status, 0);
    EXPECT_TRUE(fs::is_regular_file(directory_ / "new" / "a.h5"));
    EXPECT_TRUE(fs::is_regular_file(directory_ / "new" / "batch.json"));
}

TEST_F(BatchCommand, InterruptedItKeepsWhatIsDoneAndGoesOn) {
    write("long.toml", "[ensemble]\ngyros = 64\nduration_s = 20000.0\n[output]\nangle_record = false\n");
    const pid_t child = start({"run", "a.toml", "long.toml", "b.toml", "-o", "out"});
    EXPECT_TRUE(soon([&] { return contents(streams_ / "err").find("batch: 2 of 3") != std::string::npos; }));
    kill(child, SIGTERM);
    const Outcome r = finish(child);
    EXPECT_EQ(r.signal, SIGTERM);
    EXPECT_EQ(summary()["runs"][0]["state"], "done");
    EXPECT_EQ(summary()["runs"][1]["state"], "not run");
    EXPECT_EQ(summary()["runs"][2]["state"], "not run");
    EXPECT_FALSE(fs::exists(directory_ / "out" / "long.h5"));
    const Outcome again = run({"run", "a.toml", "b.toml", "-o", "out"});
    EXPECT_EQ(again.status, 0) << again.err;
    EXPECT_THAT(again.out, AllOf(HasSubstr("finished before"), HasSubstr("done")));
}

TEST_F(BatchCommand, WhatMakesNoSenseIsRefusedBeforeAnything) {
    fs::create_directory(directory_ / "twice");
    write("twice/a.toml", "");
    EXPECT_THAT(run({"run", "a.toml", "twice/a.toml", "-o", "out"}).err,
                HasSubstr("the results of both would be written"));
    EXPECT_EQ(run({"run", "a.toml", "b.toml", "-o", "out", "--shard", "1/2"}).status, 2);
    EXPECT_EQ(run({"run", "a.toml", "b.toml", "-o", "out", "--plot", "a.svg"}).status, 2);
    EXPECT_FALSE(fs::exists(directory_ / "out"));
    write("file", "");
    EXPECT_EQ(run({"run", "a.toml", "b.toml", "-o", "file"}).status, 2);
}

}  // namespace
}  // namespace batch_test
}  // namespace ringlock
