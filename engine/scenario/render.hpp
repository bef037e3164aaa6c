#pragma once
#include <string>

#include "engine/scenario/scenario.hpp"

/// Scenarios and their schema as text.
namespace ringlock::scenario {

/// The whole scenario as TOML, canonical: equal scenarios give equal text, and the text parses back to an equal
/// scenario.
std::string to_toml(const Scenario& scenario);

/// A commented TOML file with every key at its default.
std::string schema_text();

/// The page docs/scenario.md.
std::string schema_markdown();

/// The schema as one JSON object: {"sections": [{"name", "doc", "keys": [{"name", "type", "default", ...}]}]}.
std::string schema_json();

}  // namespace ringlock::scenario
