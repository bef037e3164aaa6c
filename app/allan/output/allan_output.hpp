#pragma once
#include <string>

#include "analysis/allan_run/outcome.hpp"

namespace ringlock::app {

using allan_run::AllanOutput;
using allan_run::CoefficientName;
using allan_run::DeviationOutput;
using allan_run::InstrumentNames;
using allan_run::names_of;

/// Tables for people.
std::string allan_text(const AllanOutput& out);

}  // namespace ringlock::app
