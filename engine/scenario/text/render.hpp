#pragma once
#include <map>
#include <string>
#include <string_view>

#include "engine/scenario/scenario.hpp"

/// Scenarios and their schema as text.
namespace ringlock::scenario {

/// The whole scenario as TOML, canonical: equal scenarios give equal text, and the text parses back to an equal
/// scenario.
std::string to_toml(const Scenario& scenario);

/// The same with comments before keys: a remark on each "section.key", wrapped to lines of 120 characters.
std::string to_toml(const Scenario& scenario, const std::map<std::string, std::string>& remarks);

/// Text as comment lines of TOML, at most 120 characters each; control characters are escaped.
std::string toml_comment(std::string_view text);

/// A commented TOML file with every key at its default.
std::string schema_text();

/// The page docs/scenario.md.
std::string schema_markdown();

/// The schema as one JSON object: {"sections": [{"name", "doc", "keys": [{"name", "type", "default", ...}]}]}.
std::string schema_json();

}  // namespace ringlock::scenario
