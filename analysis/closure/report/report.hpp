#pragma once
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/report/closed_scenario.hpp"
#include "analysis/closure/report/predictive.hpp"

namespace ringlock::closure {

/// The JSON object of docs/commands.md, "closure". What is not finite is null.
nlohmann::json to_json(const Closure& closure);
/// What stands at its key "predictive" where the check was made.
nlohmann::json to_json(const Predictive& predictive);
/// What stands at its key "closed".
nlohmann::json to_json(const ClosedScenario& closed);

/// The same for people.
std::string to_text(const Closure& closure);
std::string to_text(const Predictive& predictive);

/// The verdict in one sentence, with where structure is left.
std::string verdict_sentence(const Closure& closure);

/// Writes closure.json, closed.toml and closure.h5 into the folder, which is made where it is missing. Throws
/// InputError where it cannot be.
void write_closure(const std::filesystem::path& folder, const std::string& source, const record::Record& record,
                   const Closure& closure, const Predictive& predictive);

}  // namespace ringlock::closure
