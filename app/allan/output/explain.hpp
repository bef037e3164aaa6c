#pragma once
#include <string>
#include <vector>

#include "app/allan/output/allan_output.hpp"

namespace ringlock::app {

/// The result in sentences: the meaning of each coefficient, its value, at which averaging times it makes the largest
/// part of the fitted Allan variance, and why those that are not given are not.
std::vector<std::string> explanation(const AllanOutput& out);

/// The same as text, lines broken at `width`.
std::string explanation_text(const AllanOutput& out, std::size_t width = 100);

}  // namespace ringlock::app
