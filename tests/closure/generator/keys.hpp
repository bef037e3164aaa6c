#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "tests/closure/generator/generator.hpp"
#include "tests/closure/generator/samples.hpp"

/// Truths by the names of their parameters, "lockin_second_harmonic.ratio" = "0.03", for the command line.
namespace ringlock::test::closure {

/// Names that set() knows.
std::vector<std::string> turn_keys();
std::vector<std::string> sample_keys();

/// Throws InputError for a name that is not known and for a value that is none. `input_profile_deg_h` is a list
/// time:rate,time:rate,...; with a `declared.NAME` only what is named so is declared.
void set(Truth& truth, std::string_view key, std::string_view value);
void set(SampleTruth& truth, std::string_view key, std::string_view value);

}  // namespace ringlock::test::closure
