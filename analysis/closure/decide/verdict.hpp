#pragma once
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"

/// What is said of a closed model: the verdict, and what would resolve a tie.
namespace ringlock::closure {

/// What would tell two effects apart that this record cannot.
std::string experiment_for(const effects::Effect& effect, const std::vector<const effects::Effect*>& others);

Verdict verdict_of(const Closure& closure);

}  // namespace ringlock::closure
