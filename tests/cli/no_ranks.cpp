#include <gmock/gmock.h>

#include <cstdlib>

#include "tests/cli/program.hpp"

// A program without MPI that mpirun starts several times: each would simulate all of the run.
namespace ringlock {
namespace no_ranks_test {
namespace {

using testing::HasSubstr;

class NoRanks : public test::ProgramTest {};

TEST_F(NoRanks, AreToldOfMpi) {
    write("s.toml", "");
    const auto outcome = run({"run", "s.toml"}, [] { setenv("OMPI_COMM_WORLD_SIZE", "2", 1); });
    EXPECT_EQ(outcome.status, 2);
    EXPECT_THAT(outcome.err, HasSubstr("one of 2 processes of mpirun"));
    EXPECT_THAT(outcome.err, HasSubstr("-DRINGLOCK_MPI=ON"));
    EXPECT_EQ(left(), std::set<std::string>{"s.toml"});
}

TEST_F(NoRanks, OneAloneIsARun) {
    write("s.toml", "[ensemble]\ngyros = 4\nduration_s = 10.0\n");
    EXPECT_EQ(run({"run", "s.toml"}, [] { setenv("OMPI_COMM_WORLD_SIZE", "1", 1); }).status, 0);
}

}  // namespace
}  // namespace no_ranks_test
}  // namespace ringlock
