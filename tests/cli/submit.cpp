#include <gmock/gmock.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/cli/program.hpp"
#include "tests/cli/scenarios.hpp"

// The script of `ringlock submit`, with a program in the place of Slurm's sbatch that runs jobs at once, one after the
// other. tools/slurm-check tries the script on a real Slurm.
namespace ringlock {
namespace submit_test {
namespace {

using test::growing;
using test::Outcome;
using test::with_records;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;
namespace fs = std::filesystem;

/// Tasks that the file `lost` names, a line each, are not run, and leave the file.
constexpr const char* sbatch = R"(#!/bin/bash
set -e
array=""
script=()
for word in "$@"; do
    case $word in
    --array=*) array=${word#--array=} ;;
    --cpus-per-task=*) export SLURM_CPUS_PER_TASK=${word#*=} ;;
    --*) echo "$word" >>options ;;
    *) script+=("$word") ;;
    esac
done
if [[ -z $array ]]; then
    bash "${script[@]}" >>merge.log 2>&1
    exit
fi
echo "array $array" >>options
for range in ${array//,/ }; do
    for ((task = ${range%-*}; task <= ${range#*-}; ++task)); do
        if grep -qx "$task" lost 2>/dev/null; then
            sed -i "0,/^$task\$/{/^$task\$/d}" lost
            continue
        fi
        SLURM_ARRAY_TASK_ID=$task bash "${script[@]}" >>shards.log 2>&1
    done
done
echo "17;cluster"
)";

class Submit : public test::ProgramTest {
   protected:
    void SetUp() override {
        ProgramTest::SetUp();
        fs::create_directory(directory_ / "bin");
        write("bin/sbatch", sbatch);
        chmod((directory_ / "bin/sbatch").c_str(), 0755);
        write(scenario_, with_records);
    }
    /// Writes job.sh, of so many shards at most.
    void submit() {
        // No machine is so fast that a shard of a microsecond has more than a block.
        const Outcome script = run({"submit", "--slurm", scenario_, "-o", result_, "--shards-of", "1e-6s", "--threads",
                                    "1", "--set", "ensemble.seed=7"});
        ASSERT_EQ(script.status, 0) << script.err;
        EXPECT_THAT(script.out, StartsWith("#!/bin/bash\n"));
        EXPECT_THAT(script.err, HasSubstr("6 shards"));
        write("job.sh", script.out);
    }
    int run_script() const {
        const std::string command = "cd '" + directory_.string() + "' && PATH=\"$PWD/bin:$PATH\" bash job.sh >out 2>&1";
        return std::system(command.c_str());
    }

    // Names that a shell would take apart.
    const std::string scenario_ = "it's a $scenario.toml";
    const std::string result_ = "its result.h5";
};

TEST_F(Submit, ShardsAndTheirMergeGiveTheFileOfOneRun) {
    if (!has_h5diff()) GTEST_SKIP() << "h5diff (hdf5-tools) is missing";
    ASSERT_NO_FATAL_FAILURE(submit());
    ASSERT_EQ(run_script(), 0) << read("out") << read("shards.log") << read("merge.log");
    ASSERT_EQ(run({"run", scenario_, "-o", "reference.h5", "--seed", "7"}).status, 0);
    EXPECT_TRUE(same_results("reference.h5", "'" + result_ + "'"));
    EXPECT_THAT(read("options"), AllOf(HasSubstr("array 1-6\n"), HasSubstr("--dependency=afterany:17\n"),
                                       HasSubstr("--mem="), HasSubstr("--time=")));
}

TEST_F(Submit, WhatFailedIsSubmittedAgain) {
    ASSERT_NO_FATAL_FAILURE(submit());
    write("lost", "2\n5\n");
    ASSERT_EQ(run_script(), 0) << read("out") << read("shards.log") << read("merge.log");
    EXPECT_THAT(read("merge.log"), HasSubstr("submitting shards 2,5 of 6 again"));
    EXPECT_THAT(read("options"), HasSubstr("array 2,5\n"));
    EXPECT_TRUE(fs::exists(directory_ / result_));
}

TEST_F(Submit, WhereAllFailTheMergeGivesUpAndNamesThem) {
    ASSERT_NO_FATAL_FAILURE(submit());
    std::string lost;
    for (int round = 0; round < 3; ++round) {
        for (int shard = 1; shard <= 6; ++shard) lost += std::to_string(shard) + "\n";
    }
    write("lost", lost);
    EXPECT_NE(run_script(), 0);
    EXPECT_THAT(read("merge.log"), HasSubstr("shards 1-6 of 6 have failed 3 times"));
    EXPECT_FALSE(fs::exists(directory_ / result_));
}

TEST_F(Submit, RefusesWhatCannotBeDividedOrIsNoTime) {
    write("growing.toml", growing);
    EXPECT_THAT(run({"submit", "--slurm", "growing.toml"}).err, HasSubstr("stopping rule"));
    EXPECT_THAT(run({"submit", scenario_}).err, HasSubstr("--slurm"));
    for (const char* const time : {"20", "0min", "-3min", "long"}) {
        const Outcome outcome = run({"submit", "--slurm", scenario_, "--shards-of", time});
        EXPECT_EQ(outcome.status, 2) << time;
        EXPECT_THAT(outcome.err, HasSubstr("--shards-of")) << time;
        EXPECT_THAT(outcome.out, IsEmpty());
    }
}

}  // namespace
}  // namespace submit_test
}  // namespace ringlock
