#include "analysis/allan_run/taus.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <system_error>
#include <utility>

#include "engine/core/error.hpp"

namespace ringlock::allan_run {
namespace {

/// The number at the beginning of a text and the rest of the text; nothing where the text does not begin with a number.
template <class T>
std::optional<std::pair<T, std::string_view>> leading_number(std::string_view text) {
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc()) return std::nullopt;
    return std::pair{value, text.substr(static_cast<std::size_t>(end - text.data()))};
}

/// Seconds in a unit of time; 0 if the text names no unit of time.
double seconds_in(std::string_view unit) {
    if (unit == "ms") return 1e-3;
    if (unit == "s") return 1.0;
    if (unit == "min") return 60.0;
    return unit == "h" ? 3600.0 : 0.0;
}

/// Averaging factor of a time, which must be a whole number of samples.
std::int64_t samples_in(const AveragingTime& time, double tau0_s, std::string_view option) {
    if (!time.time_s) return time.samples;
    constexpr double rounding = 1e-9;
    constexpr double most = 9e15;  // doubles have every whole number up to there
    const double intervals = *time.time_s / tau0_s;
    const double nearest = std::round(intervals);
    if (nearest >= 1.0 && nearest < most && std::abs(intervals - nearest) <= rounding * nearest) {
        return static_cast<std::int64_t>(nearest);
    }
    const std::string found =
        fmt::format("{} {}: is {:.10g} sampling intervals of {:.10g} s", option, time.text, intervals, tau0_s);
    if (intervals < 1.0)
        throw InputError(fmt::format("{}; the shortest averaging time is one, {:.10g}s", found, tau0_s));
    if (!(intervals < most)) throw InputError(fmt::format("{}; no record has as many samples", found));
    const double below = std::floor(intervals);
    throw InputError(
        fmt::format("{}; an averaging time is a whole number of them. The nearest are {:.10g}s and {:.10g}s "
                    "(averaging factors {:.0f} and {:.0f})",
                    found, below * tau0_s, (below + 1.0) * tau0_s, below, below + 1.0));
}

}  // namespace

std::vector<std::string> split(const std::string& text) {
    std::vector<std::string> parts;
    std::size_t begin = 0;
    for (;;) {
        const std::size_t comma = text.find(',', begin);
        std::string part = text.substr(begin, comma == std::string::npos ? comma : comma - begin);
        part.erase(0, part.find_first_not_of(' '));
        part.erase(part.find_last_not_of(' ') + 1);
        parts.push_back(part);
        if (comma == std::string::npos) return parts;
        begin = comma + 1;
    }
}

std::optional<AveragingTime> averaging_time(const std::string& text) {
    if (const auto factor = leading_number<std::int64_t>(text); factor && factor->second.empty()) {
        if (factor->first < 1) return std::nullopt;
        return AveragingTime{text, std::nullopt, factor->first};
    }
    const auto number = leading_number<double>(text);
    if (!number) return std::nullopt;
    const double time_s = number->first * seconds_in(number->second);
    if (!(time_s > 0.0) || !std::isfinite(time_s)) return std::nullopt;
    return AveragingTime{text, time_s, 0};
}

TauChoice parse_tau(const std::string& tau, std::string_view option) {
    if (tau == "octave" || tau == "decade" || tau == "all") return {tau, {}};
    TauChoice out;
    for (const std::string& part : split(tau)) {
        const auto time = averaging_time(part);
        if (!time) {
            throw InputError(
                fmt::format("{} '{}': must be octave, decade, all, averaging factors from 1 (whole numbers of "
                            "samples, not seconds) or times with a unit: ms, s, min or h, as in 0.5s,10min",
                            option, part));
        }
        out.list.push_back(*time);
    }
    return out;
}

std::vector<std::int64_t> factors_for(const TauChoice& choice, allan::Estimator estimator, std::int64_t points,
                                      double tau0_s, std::string_view option) {
    const std::int64_t largest = allan::largest_factor(estimator, points);
    if (choice.word == "octave") return allan::octave_factors(largest);
    if (choice.word == "decade") return allan::decade_factors(largest);
    if (choice.word == "all") return allan::all_factors(largest);
    std::vector<std::int64_t> factors;
    for (const AveragingTime& time : choice.list) factors.push_back(samples_in(time, tau0_s, option));
    const auto longest = std::max_element(factors.begin(), factors.end());
    if (*longest > largest) {
        const AveragingTime& asked = choice.list[static_cast<std::size_t>(longest - factors.begin())];
        const std::string times =
            asked.time_s ? fmt::format(", {:.10g}s to {:.10g}s", tau0_s, static_cast<double>(largest) * tau0_s) : "";
        throw InputError(fmt::format("{} {}: for {} this record allows averaging factors 1 to {}{}", option,
                                     asked.time_s ? asked.text : std::to_string(*longest), allan::name(estimator),
                                     largest, times));
    }
    std::sort(factors.begin(), factors.end());
    factors.erase(std::unique(factors.begin(), factors.end()), factors.end());
    return factors;
}

}  // namespace ringlock::allan_run
