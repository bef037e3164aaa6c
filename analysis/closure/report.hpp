#pragma once
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "analysis/closure/closure.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::closure {

/// The JSON object of docs/closure.md. What is not finite is null.
nlohmann::json to_json(const Closure& closure);

/// The same for people.
std::string to_text(const Closure& closure);

/// The closed model as a scenario for `ringlock run`: the device as fitted, with the effects that were added.
scenario::Scenario closed_scenario(const record::Record& record, const Closure& closure);

/// Writes closure.json, closed.toml and closure.h5 into the folder, which is made where it is missing. Throws
/// InputError where it cannot be.
void write_closure(const std::filesystem::path& folder, const std::string& source, const record::Record& record,
                   const Closure& closure);

}  // namespace ringlock::closure
