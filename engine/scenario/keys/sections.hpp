#pragma once
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/scenario/keys/schema.hpp"

/// How keys are bound to fields of a scenario; for the tables of sections only.
namespace ringlock::scenario {

/// Words of each enumeration, in the order of its values.
inline std::vector<std::string> words_of(ReadoutModel) { return {"ideal", "latched", "instrument"}; }
inline std::vector<std::string> words_of(NoiseModel) { return {"turns", "drive"}; }
inline std::vector<std::string> words_of(gyro::NoiseForm) { return {"held", "white", "sinusoidal"}; }
inline std::vector<std::string> words_of(gyro::NoiseDistribution) { return {"gaussian", "uniform", "binary"}; }
inline std::vector<std::string> words_of(PhaseFrom) { return {"detectors", "detectors_and_pulses"}; }
inline std::vector<std::string> words_of(AngleOutput) { return {"interpolated", "quarter_fringe"}; }
inline std::vector<std::string> words_of(PropagationMethod) { return {"turn_map", "direct"}; }
inline std::vector<std::string> words_of(DesignKind) { return {"none", "grid", "list", "latin_hypercube", "sobol"}; }
inline std::vector<std::string> words_of(LevelScale) { return {"linear", "log"}; }
inline std::vector<std::string> words_of(LotDistribution) {
    return {"none", "normal", "uniform", "lognormal", "triangular"};
}
inline std::vector<std::string> words_of(RecordKind) { return {"turns", "samples"}; }
inline std::vector<std::string> words_of(reader::Stripping) {
    return {reader::stripping_names.begin(), reader::stripping_names.end()};
}
inline std::vector<std::string> words_of(reader::Fraction) {
    return {reader::fraction_names.begin(), reader::fraction_names.end()};
}

template <class Number>
Bounds between(Number min, Number max, std::string why) {
    return {.min = min, .max = max, .why = std::move(why)};
}
inline Bounds above(double min, double max, std::string why) {
    return {.min = min, .max = max, .min_excluded = true, .why = std::move(why)};
}
inline Bounds zero_or(double min, double max, std::string why) {
    return {.min = min, .max = max, .or_zero = true, .why = std::move(why)};
}

inline Bounds zero_or_whole(std::int64_t min, std::int64_t max, std::string why) {
    return {.min = min, .max = max, .or_zero = true, .why = std::move(why)};
}

/// A key bound to a field; its type follows from the field's.
template <class Access>
Key key(std::string section, std::string name, Access access, Bounds bounds, std::string doc) {
    using Field = std::remove_cvref_t<decltype(access(std::declval<Scenario&>()))>;
    Key k{.section = std::move(section),
          .name = std::move(name),
          .type{},
          .bounds = std::move(bounds),
          .words{},
          .doc = std::move(doc),
          .get{},
          .set{}};
    if constexpr (std::is_enum_v<Field>) {
        k.type = Type::word;
        k.words = words_of(Field{});
        k.get = [access, words = k.words](const Scenario& s) { return words.at(static_cast<std::size_t>(access(s))); };
        k.set = [access, words = k.words](Scenario& s, const Value& v) {
            for (std::size_t i = 0; i < words.size(); ++i) {
                if (words[i] == std::get<std::string>(v)) access(s) = static_cast<Field>(i);
            }
        };
    } else if constexpr (std::is_same_v<Field, Arm>) {
        k.type = Type::word;
        k.words = arm_names();
        k.get = [access](const Scenario& s) -> Value { return access(s).name; };
        k.set = [access](Scenario& s, const Value& v) { access(s) = parse_arm(std::get<std::string>(v)); };
    } else if constexpr (std::is_same_v<Field, std::string>) {
        k.type = Type::text;
        k.get = [access](const Scenario& s) -> Value { return access(s); };
        k.set = [access](Scenario& s, const Value& v) { access(s) = std::get<std::string>(v); };
    } else if constexpr (std::is_same_v<Field, std::vector<Arm>>) {
        k.type = Type::arms;
        k.get = [access](const Scenario& s) -> Value { return access(s); };
        k.set = [access](Scenario& s, const Value& v) { access(s) = std::get<Field>(v); };
    } else if constexpr (std::is_same_v<Field, std::vector<double>>) {
        k.type = Type::reals;
        k.get = [access](const Scenario& s) -> Value { return access(s); };
        k.set = [access](Scenario& s, const Value& v) { access(s) = std::get<Field>(v); };
    } else {
        // Unsigned fields are signed in TOML.
        using Plain = std::conditional_t<std::is_same_v<Field, std::uint64_t>, std::int64_t, Field>;
        k.type = std::is_same_v<Plain, bool>     ? Type::boolean
                 : std::is_same_v<Plain, double> ? Type::real
                                                 : Type::integer;
        k.get = [access](const Scenario& s) -> Value { return static_cast<Plain>(access(s)); };
        k.set = [access](Scenario& s, const Value& v) { access(s) = static_cast<Field>(std::get<Plain>(v)); };
    }
    return k;
}

/// Key NAME of section SECTION, bound to the field of the same name.
#define RINGLOCK_KEY(section, name) \
#section, #name, [](auto& s) -> auto& { return s.section.name; }

/// Sections of the study itself, and those of its design.
std::vector<Section> base_sections();
std::vector<Section> design_sections();

}  // namespace ringlock::scenario
