#pragma once
#include "analysis/record/record.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::instrument {

/// The scenario supplies the values that the record does not declare: scale factor, threshold and dither.
void declare(record::Declared& declared, const scenario::Scenario& model);

}  // namespace ringlock::instrument
