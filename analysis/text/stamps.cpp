#include "analysis/text/stamps.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>

#include "analysis/text/numbers.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"

namespace ringlock::text {
namespace {

constexpr double day_s = 86400.0;
constexpr double largest_whole = 9.2e18;

struct NamedUnit {
    std::string_view name;
    double seconds;
    std::array<std::string_view, 8> words;  ///< how headers say it, in small letters
};
constexpr std::array<NamedUnit, 7> named_units = {
    {{"s", 1.0, {"s", "sec", "secs", "second", "seconds"}},
     {"ms", 1e-3, {"ms", "msec", "millis", "millisec", "millisecond", "milliseconds"}},
     {"us", 1e-6, {"us", "usec", "µs", "μs", "micros", "microsec", "microsecond", "microseconds"}},
     {"ns", 1e-9, {"ns", "nsec", "nanos", "nanosec", "nanosecond", "nanoseconds"}},
     {"min", 60.0, {"min", "mins", "minute", "minutes"}},
     {"h", 3600.0, {"h", "hr", "hour", "hours"}},
     {"mjd", day_s, {"d", "day", "days", "mjd"}}}};

std::optional<TimeUnit> unit_by_word(std::string_view word) {
    const std::string small = lowered(trimmed(word));
    for (const NamedUnit& unit : named_units) {
        for (const std::string_view known : unit.words) {
            if (!known.empty() && small == known) return TimeUnit{std::string(unit.name), unit.seconds, false};
        }
    }
    return std::nullopt;
}

/// Takes that many digits off the front.
bool take_digits(std::string_view& text, std::size_t count, int& value) {
    if (text.size() < count) return false;
    value = 0;
    for (std::size_t i = 0; i < count; ++i) {
        if (text[i] < '0' || text[i] > '9') return false;
        value = 10 * value + (text[i] - '0');
    }
    text.remove_prefix(count);
    return true;
}

bool take(std::string_view& text, std::string_view any_of) {
    if (text.empty() || any_of.find(text.front()) == std::string_view::npos) return false;
    text.remove_prefix(1);
    return true;
}

/// Digits behind a point, as a part of one.
double take_fraction(std::string_view& text) {
    double tenths = 0.0;
    double scale = 1.0;
    constexpr int most_digits = 17;
    int digits = 0;
    while (!text.empty() && text.front() >= '0' && text.front() <= '9') {
        if (digits++ < most_digits) {
            tenths = 10.0 * tenths + (text.front() - '0');
            scale *= 10.0;
        }
        text.remove_prefix(1);
    }
    return tenths / scale;
}

bool parse_date(std::string_view& text, std::int64_t& day) {
    int year = 0, month = 0, of_month = 0;
    if (!take_digits(text, 4, year) || !take(text, "-/")) return false;
    if (!take_digits(text, 2, month) || !take(text, "-/") || !take_digits(text, 2, of_month)) return false;
    const std::chrono::year_month_day date(std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                           std::chrono::day(static_cast<unsigned>(of_month)));
    if (!date.ok()) return false;
    day = std::chrono::sys_days(date).time_since_epoch().count();
    return true;
}

/// Behind "T" or a blank: hh:mm[:ss[.f]], then Z, an offset or nothing.
bool parse_time_of_day(std::string_view text, Stamp& stamp) {
    int hour = 0, minute = 0, second = 0;
    if (!take_digits(text, 2, hour) || !take(text, ":") || !take_digits(text, 2, minute)) return false;
    if (take(text, ":")) {
        if (!take_digits(text, 2, second)) return false;
        if (take(text, ".,")) stamp.part = take_fraction(text);
    }
    if (hour > 24 || minute > 59 || second > 60) return false;  // 60: a leap second
    stamp.whole += hour * 3600 + minute * 60 + second;
    text = trimmed(text);
    if (text == "Z" || text == "z" || text == "UTC" || text.empty()) return true;
    const bool east = text.front() == '+';
    int offset_h = 0, offset_min = 0;
    if (!take(text, "+-") || !take_digits(text, 2, offset_h)) return false;
    take(text, ":");
    if (!text.empty() && !take_digits(text, 2, offset_min)) return false;
    const int offset_s = offset_h * 3600 + offset_min * 60;
    stamp.whole += east ? -offset_s : offset_s;
    return text.empty();
}

bool parse_iso(std::string_view text, Stamp& stamp) {
    std::int64_t day = 0;
    stamp = {};
    if (!parse_date(text, day)) return false;
    stamp.whole = day * static_cast<std::int64_t>(day_s);
    if (text.empty()) return true;
    if (!take(text, "Tt ")) return false;
    return parse_time_of_day(trimmed(text), stamp);
}

/// "1403636579.758555392" keeps its digits; a number with an exponent, and a word, are read as a double.
bool parse_decimal(std::string_view field, bool decimal_comma, Stamp& stamp) {
    std::string_view text = field;
    const bool negative = text.starts_with('-');
    if (negative || text.starts_with('+')) text.remove_prefix(1);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), stamp.whole);
    const auto used = static_cast<std::size_t>(end - text.data());
    if (error == std::errc() && used > 0 && text[0] != '-') {
        std::string_view rest = text.substr(used);
        stamp.part = 0.0;
        if (take(rest, decimal_comma ? "," : ".")) stamp.part = take_fraction(rest);
        if (rest.empty()) {
            if (negative) stamp = {-stamp.whole, -stamp.part};
            return true;
        }
    }
    double value = 0.0;
    if (!parse_value(field, value, decimal_comma)) return false;
    stamp = Stamp::of(value);
    return true;
}

std::string iso_text(const Stamp& stamp) {
    const double carry = std::floor(stamp.part);
    const std::int64_t seconds = stamp.whole + static_cast<std::int64_t>(carry);
    const std::chrono::sys_seconds time{std::chrono::seconds(seconds)};
    const auto day = std::chrono::floor<std::chrono::days>(time);
    const std::chrono::year_month_day date(day);
    const auto of_day = (time - day).count();
    std::string part = fmt::format("{:.9f}", stamp.part - carry).substr(1);
    while (part.ends_with('0')) part.pop_back();
    if (part == ".") part.clear();
    return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}{}Z", static_cast<int>(date.year()),
                       static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()), of_day / 3600,
                       of_day / 60 % 60, of_day % 60, part);
}

}  // namespace

TimeUnit time_unit(const std::string& name) {
    if (name == "iso") return {"iso", 1.0, true};
    for (const NamedUnit& unit : named_units) {
        if (name == unit.name && name != "min" && name != "h") return {name, unit.seconds, false};
    }
    throw InputError(fmt::format("--time-unit {}: must be one of {}", shown(name), known_time_units));
}

std::optional<TimeUnit> declared_time_unit(std::string_view name, std::string_view unit) {
    if (!unit.empty()) return unit_by_word(unit);
    const std::size_t last = name.find_last_of('_');
    if (last == std::string_view::npos || last == 0) return std::nullopt;
    return unit_by_word(name.substr(last + 1));
}

Stamp Stamp::of(double time) {
    if (!(std::abs(time) < largest_whole)) return {0, time};
    const double whole = std::trunc(time);
    return {static_cast<std::int64_t>(whole), time - whole};
}

double Stamp::since(const Stamp& other) const {
    std::int64_t difference = 0;
    const bool overflow = __builtin_sub_overflow(whole, other.whole, &difference);
    const double wholes =
        overflow ? static_cast<double>(whole) - static_cast<double>(other.whole) : static_cast<double>(difference);
    return wholes + (part - other.part);
}

bool parse_stamp(std::string_view field, bool iso, bool decimal_comma, Stamp& stamp) {
    if (!iso) return parse_decimal(field, decimal_comma, stamp);
    if (parse_iso(field, stamp)) return true;
    double value = 0.0;
    if (!parse_value(field, value) || !std::isnan(value)) return false;
    stamp = {0, value};
    return true;
}

bool is_iso_date(std::string_view field) {
    Stamp ignored;
    return parse_iso(field, ignored);
}

std::string text_of(const Stamp& stamp, const TimeUnit& unit) {
    constexpr std::int64_t sane_s = 100'000'000'000;  // of the years that can be written in four digits
    if (unit.iso && std::abs(stamp.whole) < sane_s) return iso_text(stamp);
    if (stamp.part == 0.0) return fmt::format("{} {}", stamp.whole, unit.iso ? "s" : unit.name);
    return fmt::format("{} {}", stamp.value(), unit.iso ? "s" : unit.name);
}

}  // namespace ringlock::text
