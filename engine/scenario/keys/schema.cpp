#include "engine/scenario/keys/schema.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "engine/effects/effect.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/keys/sections.hpp"
#include "engine/scenario/text/text.hpp"

namespace ringlock::scenario {
namespace {
Section effect_section(const effects::Effect& effect) {
    const std::string name(effect.name());
    const auto sentence = [](std::string_view text) {
        std::string out(text);
        out[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(out[0])));
        return out + ".";
    };
    Section section{"effects." + name, fmt::format("{} {}", effect.summary(), effect.equation()), {}};
    for (const effects::Parameter& p : effect.parameters()) {
        const auto access = [ name, parameter = std::string(p.name) ](auto& s) -> auto& {
            return s.effects.at(name).at(parameter);
        };
        section.keys.push_back(
            key(section.name, std::string(p.name), access, between(p.min, p.max, ""), sentence(p.doc)));
    }
    return section;
}

template <class Number>
bool number_within(const Bounds& bounds, Number value) {
    if (bounds.or_zero && value == Number{0}) return true;
    const Number min = std::get<Number>(bounds.min);
    return (bounds.min_excluded ? value > min : value >= min) && value <= std::get<Number>(bounds.max);
}

/// A bound as one would write it: 0.5, 100000, 1e12.
std::string number_text(const Value& value) {
    if (!std::holds_alternative<double>(value)) return to_toml(value);
    const double real = std::get<double>(value);
    if (std::abs(real) < 1e6) return fmt::format("{}", real);
    const int exponent = static_cast<int>(std::floor(std::log10(std::abs(real))));
    return fmt::format("{}e{}", real / std::pow(10.0, exponent), exponent);
}

std::string list_text(const std::vector<std::string>& words) {
    std::vector<std::string> items;
    for (const std::string& word : words) items.push_back(in_quotes(word));
    return fmt::format("{}", fmt::join(items, ", "));
}

}  // namespace

const std::vector<Section>& schema() {
    static const std::vector<Section> all = [] {
        std::vector<Section> sections = base_sections();
        for (Section& section : design_sections()) sections.push_back(std::move(section));
        for (const effects::Effect* effect : effects::registry()) sections.push_back(effect_section(*effect));
        return sections;
    }();
    return all;
}

const Key* find_key(std::string_view path) {
    for (const Section& section : schema()) {
        if (section.elements || !path.starts_with(section.name)) continue;
        for (const Key& key : section.keys) {
            if (key.path() == path) return &key;
        }
    }
    return nullptr;
}

std::string_view unit_of(std::string_view name) {
    // Longer endings before those that they end in.
    constexpr std::array<std::pair<std::string_view, std::string_view>, 22> endings{{
        {"relative_rt_s", "1/sqrt(s)"},
        {"relative_per_h", "1/h"},
        {"relative_per_k", "1/K"},
        {"deg_h_per_k_h", "deg/h/(K/h)"},
        {"deg_h_per_h", "deg/h/h"},
        {"deg_h_per_k", "deg/h/K"},
        {"deg_h_rt_h", "deg/h/sqrt(h)"},
        {"deg_rt_h", "deg/sqrt(h)"},
        {"k_per_h", "K/h"},
        {"hz_per_s2", "Hz/s^2"},
        {"hz_per_s3", "Hz/s^3"},
        {"hz_per_s4", "Hz/s^4"},
        {"hz_per_s5", "Hz/s^5"},
        {"hz_per_s", "Hz/s"},
        {"deg_h", "deg/h"},
        {"deg_s", "deg/s"},
        {"arcsec", "arcsec"},
        {"hz", "Hz"},
        {"rad", "rad"},
        {"_k", "K"},
        {"_s", "s"},
        {"", "1"},
    }};
    return std::find_if(endings.begin(), endings.end(), [&](const auto& e) { return name.ends_with(e.first); })->second;
}

bool within_bounds(const Key& key, const Value& value) {
    if (key.type == Type::integer) return number_within(key.bounds, std::get<std::int64_t>(value));
    if (key.type == Type::reals) {
        for (const double real : std::get<std::vector<double>>(value)) {
            if (!std::isfinite(real) || !number_within(key.bounds, real)) return false;
        }
        return true;
    }
    const double real = std::get<double>(value);
    return std::isfinite(real) && number_within(key.bounds, real);
}

Value value_of(const Key& key, double number) {
    if (key.type == Type::integer) return static_cast<std::int64_t>(std::llround(number));
    return number;
}

bool can_take(const Key& key, double number) {
    constexpr double largest_exact = 9007199254740992.0;  // 2^53
    if (key.type == Type::real) return within_bounds(key, number);
    const bool whole = std::abs(number) <= largest_exact && number == std::round(number);
    return whole && within_bounds(key, value_of(key, number));
}

std::string range_text(const Key& key) {
    switch (key.type) {
        case Type::boolean:
            return "true or false";
        case Type::word:
            return fmt::format("one of {}", list_text(key.words));
        case Type::arms:
            return fmt::format("a list of different arms of {}", list_text(arm_names()));
        case Type::text:
            return "a string";
        case Type::integer:
        case Type::real:
        case Type::reals:
            break;
    }
    return fmt::format("{}{} {} and {}{}", key.bounds.or_zero ? "0 or " : "",
                       key.bounds.min_excluded ? "above" : "between", number_text(key.bounds.min),
                       key.bounds.min_excluded ? "at most " : "", number_text(key.bounds.max));
}

std::string allowed_text(const Key& key) {
    if (key.type == Type::integer) return "a whole number " + range_text(key);
    if (key.type == Type::reals) return "a list of numbers " + range_text(key);
    if (key.type == Type::real) return (key.bounds.or_zero ? "a number, " : "a number ") + range_text(key);
    return range_text(key);
}

std::string to_toml(const Value& value) {
    struct Writer {
        std::string operator()(bool v) const { return v ? "true" : "false"; }
        std::string operator()(std::int64_t v) const { return fmt::format("{}", v); }
        std::string operator()(double v) const { return format_real(v); }
        std::string operator()(const std::string& v) const { return in_quotes(v); }
        std::string operator()(const std::vector<Arm>& arms) const {
            std::vector<std::string> names;
            for (const Arm& arm : arms) names.push_back(arm.name);
            return fmt::format("[{}]", list_text(names));
        }
        std::string operator()(const std::vector<double>& v) const {
            std::vector<std::string> items;
            for (const double value : v) items.push_back(format_real(value));
            return fmt::format("[{}]", fmt::join(items, ", "));
        }
    };
    return std::visit(Writer{}, value);
}

}  // namespace ringlock::scenario
