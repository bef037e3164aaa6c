#pragma once
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/report/closed_scenario.hpp"
#include "analysis/closure/report/predictive.hpp"

namespace ringlock::closure {

/// The JSON object of docs/commands.md, "closure". Values that are not finite are null.
nlohmann::json to_json(const Closure& closure);
/// The object at its key "predictive", if the check was made.
nlohmann::json to_json(const Predictive& predictive);
/// The object at its key "closed".
nlohmann::json to_json(const ClosedScenario& closed);

/// The same for people.
std::string to_text(const Closure& closure);
std::string to_text(const Predictive& predictive);

/// The verdict in one sentence, with the location of the remaining structure.
std::string verdict_sentence(const Closure& closure);
/// That of the verdict `unexplained`: the structure that is left, and its description.
std::string unexplained_sentence(Where where, const std::string& description);

/// Writes closure.json, closed.toml and closure.h5 into the folder, which is created if it is missing. Throws
/// InputError if it cannot be.
void write_closure(const std::filesystem::path& folder, const std::string& source, const record::Record& record,
                   const Closure& closure, const Predictive& predictive);

}  // namespace ringlock::closure
