#include "analysis/text/layout/units.hpp"

#include <algorithm>
#include <array>

#include "analysis/text/words.hpp"

namespace ringlock::text {
namespace {

using namespace std::string_view_literals;

// Times, angles, accelerations, lengths, temperatures, electricity, pressure, counts, and the words that join them.
constexpr std::array symbols = std::to_array<std::string_view>({"s",           "sec",         "secs",
                                                                "second",      "seconds",     "ms",
                                                                "msec",        "millisecond", "milliseconds",
                                                                "us",          "usec",        "µs",
                                                                "μs",          "microsecond", "microseconds",
                                                                "ns",          "nsec",        "nanosecond",
                                                                "nanoseconds", "min",         "mins",
                                                                "minute",      "minutes",     "h",
                                                                "hr",          "hour",        "hours",
                                                                "d",           "day",         "days",
                                                                "deg",         "degree",      "degrees",
                                                                "°",           "rad",         "radian",
                                                                "radians",     "mrad",        "urad",
                                                                "µrad",        "μrad",        "nrad",
                                                                "arcsec",      "arcmin",      "mdeg",
                                                                "dps",         "mdps",        "rps",
                                                                "rpm",         "rev",         "g",
                                                                "mg",          "ug",          "µg",
                                                                "μg",          "gn",          "m",
                                                                "mm",          "cm",          "km",
                                                                "um",          "µm",          "nm",
                                                                "K",           "C",           "F",
                                                                "degC",        "°C",          "℃",
                                                                "degF",        "Hz",          "kHz",
                                                                "MHz",         "V",           "mV",
                                                                "uV",          "A",           "mA",
                                                                "T",           "mT",          "uT",
                                                                "µT",          "nT",          "G",
                                                                "mG",          "Gauss",       "gauss",
                                                                "Pa",          "hPa",         "kPa",
                                                                "mbar",        "bar",         "lsb",
                                                                "LSB",         "count",       "counts",
                                                                "cnt",         "ticks",       "pulses",
                                                                "pulse",       "fringe",      "fringes",
                                                                "rt",          "sqrt",        "per",
                                                                "%",           "ppm",         "N",
                                                                "kg",          "celsius",     "Celsius",
                                                                "MJD",         "mjd"});

bool joins(char c) {
    return c == '/' || c == '*' || c == ' ' || c == '^' || c == '.' || c == '-' || c == '+' || c == '(' || c == ')' ||
           (c >= '0' && c <= '9');
}

}  // namespace

bool is_unit(std::string_view text) {
    text = trimmed(text);
    bool any = false;
    while (!text.empty()) {
        // Dots between (U+00B7, U+22C5) and raised digits (U+00B2, U+00B9, U+00B3, U+207B) join as their plain forms
        // do.
        bool raised = false;
        for (const std::string_view sign : {"·"sv, "⋅"sv, "²"sv, "³"sv, "¹"sv, "⁻"sv, "√"sv}) {
            if (!text.starts_with(sign)) continue;
            text.remove_prefix(sign.size());
            raised = true;
            break;
        }
        if (raised) continue;
        if (joins(text.front())) {
            text.remove_prefix(1);
            continue;
        }
        std::size_t longest = 0;
        for (const std::string_view symbol : symbols) {
            if (!text.starts_with(symbol) || symbol.size() <= longest) continue;
            const std::string_view rest = text.substr(symbol.size());
            const bool ends = rest.empty() || joins(rest.front()) || (rest.front() & 0x80) != 0;
            if (ends) longest = symbol.size();
        }
        if (longest == 0) return false;
        text.remove_prefix(longest);
        any = true;
    }
    return any;
}

NameAndUnit split_unit(std::string_view heading) {
    heading = trimmed(heading);
    for (const auto& [open, close] : {std::pair{'(', ')'}, {'[', ']'}, {'{', '}'}}) {
        if (heading.empty() || heading.back() != close) continue;
        int depth = 0;
        for (std::size_t i = heading.size(); i-- > 0;) {
            if (heading[i] == close) ++depth;
            if (heading[i] != open || --depth > 0) continue;
            const std::string_view name = trimmed(heading.substr(0, i));
            const std::string_view unit = trimmed(heading.substr(i + 1, heading.size() - i - 2));
            if (name.empty() || !is_unit(unit)) break;
            return {std::string(name), std::string(unit)};
        }
    }
    return {std::string(heading), ""};
}

std::optional<std::string> unit_cell(std::string_view cell) {
    cell = trimmed(cell);
    for (const auto& [open, close] : {std::pair{'(', ')'}, {'[', ']'}, {'{', '}'}, {'<', '>'}}) {
        if (cell.size() < 2 || cell.front() != open || cell.back() != close) continue;
        const std::string_view within = trimmed(cell.substr(1, cell.size() - 2));
        if (within.empty() || within == "-" || within == "1") return "";
        if (is_unit(within)) return std::string(within);
    }
    if (cell.empty() || cell == "-" || cell == "1") return "";
    if (is_unit(cell)) return std::string(cell);
    return std::nullopt;
}

}  // namespace ringlock::text
