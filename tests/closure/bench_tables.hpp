#pragma once
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "tests/closure/suite.hpp"

/// The tables of the benches of the closed loop.
namespace ringlock::test::closure {

/// What was in a record.
struct TableRow {
    Kind kind = Kind::null;
    std::string truth;
    double multiple = 0.0;
};
using Outcomes = std::vector<std::optional<Outcome>>;

/// How often what came out.
void write_figures(std::ostream& out, const std::vector<TableRow>& truths, const Outcomes& outcomes,
                   const char* record_length);
/// What each truth has been taken for.
void write_confusion(std::ostream& out, std::ostream& matrix, const std::vector<TableRow>& truths,
                     const Outcomes& outcomes);
/// How far estimates are from the truth, in their standard errors.
void write_calibration(std::ostream& out, const Outcomes& outcomes);

}  // namespace ringlock::test::closure
