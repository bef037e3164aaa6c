#pragma once
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace ringlock::bench {

/// Lines of a Markdown table, to standard output.
void row(const std::vector<std::string>& cells);
void head(const std::vector<std::string>& cells);

std::string number(double value, int digits = 3);
/// With its sign, but for a zero, whose sign is of rounding.
std::string signed_number(double value, int digits);

/// A part of a page of docs/ that a program prints.
using Block = std::pair<const char*, std::function<void()>>;

/// The main of a program that prints blocks: the one that is named, all of them without a name, their names with
/// `--list`. Returns the exit status.
int print_blocks(const char* program, const std::string& wanted, std::span<const Block> blocks);

}  // namespace ringlock::bench
