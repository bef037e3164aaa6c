#include "analysis/quantity/declared.hpp"

#include <fmt/format.h>

#include <cmath>

#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::quantity {
namespace {

/// The text in the last brackets, where the name ends with them.
std::optional<std::string_view> bracketed(std::string_view name) {
    while (!name.empty() && name.back() == ' ') name.remove_suffix(1);
    if (name.empty()) return std::nullopt;
    const char opening = name.back() == ']' ? '[' : name.back() == ')' ? '(' : '\0';
    if (opening == '\0') return std::nullopt;
    const std::size_t at = name.find_last_of(opening);
    if (at == std::string_view::npos) return std::nullopt;
    return name.substr(at + 1, name.size() - at - 2);
}

}  // namespace

std::optional<Unit> unit_in_name(std::string_view name) {
    if (const auto text = bracketed(name)) return find_unit(*text);
    // Names of more than one unit come first, or "rate_deg_h" would end with nothing that is known.
    for (const auto& [ending, unit] : {std::pair{"_arcsec", "arcsec"},
                                       {"_deg_h", "deg/h"},
                                       {"_deg_s", "deg/s"},
                                       {"_rad_s", "rad/s"},
                                       {"_urad_s", "urad/s"},
                                       {"_dps", "deg/s"},
                                       {"_dph", "deg/h"},
                                       {"_m_s2", "m/s^2"},
                                       {"_deg", "deg"},
                                       {"_rad", "rad"}}) {
        if (name.ends_with(ending)) return find_unit(unit);
    }
    return std::nullopt;
}

bool are_same(const Unit& one, const Unit& other) {
    constexpr double rounding = 1e-12;
    return one.instrument == other.instrument && one.is_rate == other.is_rate &&
           std::abs(one.factor - other.factor) <= rounding * one.factor;
}

void refuse_contradiction(const std::string& file, const std::string& column,
                          const std::optional<std::string>& unit_text, const Unit& given, std::string_view option) {
    const std::optional<Unit> declared = unit_text ? find_unit(*unit_text) : unit_in_name(column);
    if (!declared || are_same(*declared, given)) return;
    throw InputError(
        fmt::format("{}: column {} is declared to be in {}, which contradicts {} {}; correct the option, "
                    "or the file where it is wrong",
                    printable(file), printable(column), declared->name, option, given.name));
}

}  // namespace ringlock::quantity
