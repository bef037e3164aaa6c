#pragma once
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/record/record.hpp"

/// The closed loop on a record of turns.
namespace ringlock::closure {

/// Runs the loop. Throws InputError where the record does not suffice.
Closure close_turns(const record::Record& record);

/// The model with these effects fitted, without any search: what a loop that knows the true effects reaches. Effects
/// start from the values given.
Closure fit_turns(const record::Record& record, const std::vector<ActiveEffect>& effects);

/// Standard errors of the parameters of effects at the values given, those of the true model: by Fisher's information
/// in the whole record.
std::vector<Estimate> information_on_turns(const record::Record& record, const std::vector<ActiveEffect>& effects);

}  // namespace ringlock::closure
