#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "engine/scenario/scenario.hpp"

/// The one place where every key of a scenario stands: section, name, type, default, bounds, allowed words, meaning.
/// The parser, the printed schema, the page docs/scenario.md and the resolved scenario all come from it.
namespace ringlock::scenario {

using Value = std::variant<bool, std::int64_t, double, std::string, std::vector<Arm>, std::vector<double>>;

enum class Type { boolean, integer, real, word, text, arms, reals };

/// Allowed values of a number. The limits have the type of the key.
struct Bounds {
    Value min;
    Value max;
    bool min_excluded = false;
    bool or_zero = false;  ///< 0 is allowed as well
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

/// A section that may stand several times, [[NAME]]. Its keys get and set the last of its elements.
struct Elements {
    std::function<std::size_t(const Scenario&)> count;
    std::function<void(Scenario&, std::size_t)> resize;
    std::function<VariationForm(const Scenario&)> form;  ///< which keys the last element has, the first key apart
};

struct Section {
    std::string name;
    std::string doc;
    std::vector<Key> keys;
    std::optional<Elements> elements = {};
};

/// All sections in the order in which they are printed.
const std::vector<Section>& schema();

/// The key of that path, outside of sections that may occur several times; nullptr if there is no such key.
const Key* find_key(std::string_view path);

/// The unit that the name of a key ends in: "deg/h" of "lockin_threshold_deg_h", "1" for a name without unit.
std::string_view unit_of(std::string_view name);

/// True where a number of the key's type lies within its bounds, all of a list do; a real must be finite as well.
bool within_bounds(const Key& key, const Value& value);

/// Whether the key, a number, can be this one; of a whole number also whether it is one.
bool can_take(const Key& key, double number);

/// A number as the key's value; can_take(key, number) holds.
Value value_of(const Key& key, double number);

/// "between 1 and 10000000", "above 0 and at most 10000", "one of "a", "b"".
std::string range_text(const Key& key);

/// "a whole number between 1 and 10000000", "true or false".
std::string allowed_text(const Key& key);

/// A value as TOML.
std::string to_toml(const Value& value);

}  // namespace ringlock::scenario
