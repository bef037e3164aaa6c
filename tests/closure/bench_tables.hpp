#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tests/closure/suite.hpp"

/// The tables of the benches of the closed loop.
namespace ringlock::test::closure {

/// What the command line of a bench says.
struct Command {
    std::string folder;
    double share = 1.0;  ///< of the records
    std::string only;    ///< one kind of them, by name
    std::string seed;    ///< the one record of that seed

    bool wants(Kind kind) const { return only.empty() || only == name_of(kind); }
    std::size_t scaled(double count) const;
};
/// Makes the folder. Ends the program with status 2 where the command line is wrong.
Command command_of(int argc, char** argv, const char* program);

/// What was in a record, and how it was made.
struct TableRow {
    Kind kind = Kind::null;
    std::string truth;
    double multiple = 0.0;
    std::string condition, by;
    std::uint64_t seed = 0;
    std::string values;
    std::string expected;  ///< where, of what the library does not have
};
std::string values_of(const std::vector<Added>& truth);

using Outcomes = std::vector<std::optional<Outcome>>;

/// Everything that a bench leaves in its folder. `unit` is that of the errors.
void write_tables(const std::string& folder, const std::vector<TableRow>& truths, const Outcomes& outcomes,
                  const char* unit, const char* record_length);

}  // namespace ringlock::test::closure
