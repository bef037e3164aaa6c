#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "engine/scenario/scenario.hpp"

/// The one place where every key of a scenario stands: section, name, type, default, bounds, allowed words, meaning.
/// The parser, the printed schema, the page docs/scenario.md and the resolved scenario all come from it.
namespace ringlock::scenario {

using Value = std::variant<bool, std::int64_t, double, std::string, std::vector<Arm>, std::vector<double>>;

enum class Type { boolean, integer, real, word, arms, reals };

/// What a number may be. The limits have the type of the key.
struct Bounds {
    Value min;
    Value max;
    bool min_excluded = false;
    bool or_zero = false;  ///< 0 is allowed besides
    std::string why;       ///< the reason, for messages
};

struct Key {
    std::string section;  ///< "ensemble", "effects.NAME"
    std::string name;     ///< with its unit
    Type type;
    Bounds bounds;                   ///< of integers, reals and each of a list of reals
    std::vector<std::string> words;  ///< of Type::word
    std::string doc;                 ///< one line
    std::function<Value(const Scenario&)> get;
    std::function<void(Scenario&, const Value&)> set;  ///< the value must have the type of the key

    std::string path() const { return section + "." + name; }
    Value default_value() const { return get(Scenario{}); }
};

struct Section {
    std::string name;
    std::string doc;
    std::vector<Key> keys;
};

/// All sections in the order in which they are printed.
const std::vector<Section>& schema();

/// True where a number of the key's type lies within its bounds, all of a list do; a real must be finite as well.
bool within_bounds(const Key& key, const Value& value);

/// "between 1 and 10000000", "above 0 and at most 10000", "one of "a", "b"".
std::string range_text(const Key& key);

/// "a whole number between 1 and 10000000", "true or false".
std::string allowed_text(const Key& key);

/// A value as TOML.
std::string to_toml(const Value& value);

}  // namespace ringlock::scenario
