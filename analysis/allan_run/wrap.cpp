#include "analysis/allan_run/wrap.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <string_view>

#include "engine/core/error.hpp"

namespace ringlock::allan_run {
namespace {

std::optional<double> finite_number(std::string_view text) {
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
    return value;
}

std::optional<double> modulus_of(std::string_view text) {
    const std::size_t power = text.find('^');
    if (power == std::string_view::npos) return finite_number(text);
    const auto base = finite_number(text.substr(0, power));
    const auto exponent = finite_number(text.substr(power + 1));
    if (!base || !exponent) return std::nullopt;
    return std::pow(*base, *exponent);
}

}  // namespace

WrapChoice parse_wrap(const std::string& text, std::string_view option) {
    if (text == "off") return {};
    if (text == "auto") return {true, std::nullopt};
    const std::optional<double> modulus = modulus_of(text);
    if (!modulus || !(*modulus > 0.0) || !std::isfinite(*modulus)) {
        throw InputError(fmt::format(
            "{} {}: must be off, auto, or the range of the counter in the unit of the data, such as 2^16 or 360",
            option, text));
    }
    return {true, modulus};
}

}  // namespace ringlock::allan_run
