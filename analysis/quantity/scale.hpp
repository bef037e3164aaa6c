#pragma once
#include <string>

#include "analysis/quantity/unit.hpp"

namespace ringlock::quantity {

/// The unit of numbers that are counts: `scale` is the size of one count, a number and a unit ("0.25arcsec",
/// "6.1e-5 deg/s"). Throws InputError, naming --scale, where it is no positive number with a unit of that kind.
Unit unit_of_counts(const std::string& scale, bool is_rate);

/// The unit in which `scale` times the numbers of a file are: one that is `scale` times as large. Throws InputError,
/// naming --scale, where it is no positive number.
Unit scaled(const Unit& unit, const std::string& scale);

}  // namespace ringlock::quantity
