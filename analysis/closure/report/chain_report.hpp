#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "analysis/closure/chain.hpp"

/// What several records of one data chain say together, for programs and for people.
namespace ringlock::closure {

/// The object at the key "chain" (docs/commands.md). Numbers that are not finite are null.
nlohmann::json to_json(const Chain& chain);

/// What they say, in one sentence.
std::string verdict_sentence(const Chain& chain);
/// Where records contradict the likeliest rate, a line for each way in which they do.
std::vector<std::string> contradictions(const Chain& chain);
std::string to_text(const Chain& chain);

}  // namespace ringlock::closure
