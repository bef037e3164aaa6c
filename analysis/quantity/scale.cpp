#include "analysis/quantity/scale.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <string_view>

#include "engine/core/error.hpp"

namespace ringlock::quantity {
namespace {

struct Size {
    double number = 0.0;
    std::string_view unit;  ///< empty where there is none
};

Size parse_size(const std::string& scale) {
    Size size;
    const char* const last = scale.data() + scale.size();
    const auto [end, error] = std::from_chars(scale.data(), last, size.number);
    if (error != std::errc() || !(size.number > 0.0) || !std::isfinite(size.number)) {
        throw InputError(
            fmt::format("--scale '{}': must be a positive number, with its unit where the data are counts, "
                        "such as 0.25arcsec",
                        scale));
    }
    size.unit = std::string_view(end, static_cast<std::size_t>(last - end));
    while (size.unit.starts_with(' ')) size.unit.remove_prefix(1);
    return size;
}

Unit times(Unit unit, double number) {
    unit.factor *= number;
    unit.name = fmt::format("{:g} {}", number, unit.name);
    return unit;
}

}  // namespace

Unit unit_of_counts(const std::string& scale, bool is_rate) {
    if (scale.empty()) {
        throw InputError(fmt::format("--unit counts: needs --scale, the size of one count with its unit, such as {}",
                                     is_rate ? "6.1e-5deg/s" : "0.25arcsec"));
    }
    const Size size = parse_size(scale);
    if (size.unit.empty()) {
        throw InputError(fmt::format("--scale {}: the size of a count needs its unit, such as {}{}", scale, scale,
                                     is_rate ? "deg/s" : "arcsec"));
    }
    return times(unit_for(size.unit, is_rate, "--scale: the unit"), size.number);
}

Unit scaled(const Unit& unit, const std::string& scale) {
    const Size size = parse_size(scale);
    if (!size.unit.empty()) {
        throw InputError(fmt::format(
            "--scale {}: with --unit {} it is a number without a unit; a size of a count has one, with --unit counts",
            scale, unit.name));
    }
    return times(unit, size.number);
}

}  // namespace ringlock::quantity
