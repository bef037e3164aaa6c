#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "analysis/closure/chain.hpp"

/// Report on several records of one data chain, for programs and for people.
namespace ringlock::closure {

/// The object at the key "chain" (docs/commands.md). Numbers that are not finite are null.
nlohmann::json to_json(const Chain& chain);

/// The result for the chain in one sentence.
std::string verdict_sentence(const Chain& chain);
/// Where records contradict the most likely rate: one line for each contradiction.
std::vector<std::string> contradictions(const Chain& chain);
std::string to_text(const Chain& chain);

}  // namespace ringlock::closure
