#pragma once
#include <string>
#include <vector>

#include "analysis/record/series/series.hpp"
#include "tests/fuzz/fuzz.hpp"

/// Texts of the field for the programs of this room.
namespace ringlock::fuzz {

/// Small logs in different dialects.
extern const std::vector<std::string> logs;

/// A text with faults that texts have: words of numbers, quotes, delimiters and marks in the wrong place.
std::string damaged_text(std::string text, std::size_t faults, Chance& chance);

/// A request for one column, with options that a command line could give.
record::SeriesRequest text_request(const std::string& path, Chance& chance);

/// Reads the file as a series and as a record.
void read_text(const InputFile& file, Chance& chance, Tally& tally);

}  // namespace ringlock::fuzz
