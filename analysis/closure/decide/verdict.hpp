#pragma once
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"

/// The verdict on a closed model, and the record that would resolve a tie.
namespace ringlock::closure {

/// A record that would distinguish effects that this one does not.
std::string experiment_for(const effects::Effect& effect, const std::vector<const effects::Effect*>& others);

Verdict verdict_of(const Closure& closure);

}  // namespace ringlock::closure
