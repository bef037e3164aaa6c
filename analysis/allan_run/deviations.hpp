#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "analysis/allan/estimator.hpp"

namespace ringlock::allan_run {

/// Names of all deviations, for help and errors.
std::string known_deviations();

/// The deviations of these names, each once. Throws InputError, naming `option`, where one is not known.
std::vector<allan::Estimator> deviations_named(const std::vector<std::string>& names, std::string_view option);

}  // namespace ringlock::allan_run
