#include "app/allan/taus.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/core/error.hpp"

namespace ringlock::app {
namespace {

/// Averaging factor of a time, which must be a whole number of samples.
std::int64_t samples_in(const AveragingTime& time, double tau0_s) {
    if (!time.time_s) return time.samples;
    constexpr double rounding = 1e-9;
    constexpr double most = 9e15;  // doubles have every whole number up to there
    const double intervals = *time.time_s / tau0_s;
    const double nearest = std::round(intervals);
    if (nearest >= 1.0 && nearest < most && std::abs(intervals - nearest) <= rounding * nearest) {
        return static_cast<std::int64_t>(nearest);
    }
    const std::string found =
        fmt::format("--tau {}: is {:.10g} sampling intervals of {:.10g} s", time.text, intervals, tau0_s);
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

TauChoice parse_tau(const std::string& tau) {
    if (tau == "octave" || tau == "decade" || tau == "all") return {tau, {}};
    TauChoice out;
    for (const std::string& part : split(tau)) {
        const auto time = averaging_time(part);
        if (!time) {
            throw InputError(
                fmt::format("--tau '{}': must be octave, decade, all, averaging factors from 1 (whole numbers of "
                            "samples, not seconds) or times with a unit: ms, s, min or h, as in 0.5s,10min",
                            part));
        }
        out.list.push_back(*time);
    }
    return out;
}

std::vector<std::int64_t> factors_for(const TauChoice& choice, allan::Estimator estimator, std::int64_t points,
                                      double tau0_s) {
    const std::int64_t largest = allan::largest_factor(estimator, points);
    if (choice.word == "octave") return allan::octave_factors(largest);
    if (choice.word == "decade") return allan::decade_factors(largest);
    if (choice.word == "all") return allan::all_factors(largest);
    std::vector<std::int64_t> factors;
    for (const AveragingTime& time : choice.list) factors.push_back(samples_in(time, tau0_s));
    const auto longest = std::max_element(factors.begin(), factors.end());
    if (*longest > largest) {
        const AveragingTime& asked = choice.list[static_cast<std::size_t>(longest - factors.begin())];
        const std::string times =
            asked.time_s ? fmt::format(", {:.10g}s to {:.10g}s", tau0_s, static_cast<double>(largest) * tau0_s) : "";
        throw InputError(fmt::format("--tau {}: for {} this record allows averaging factors 1 to {}{}",
                                     asked.time_s ? asked.text : std::to_string(*longest), allan::name(estimator),
                                     largest, times));
    }
    std::sort(factors.begin(), factors.end());
    factors.erase(std::unique(factors.begin(), factors.end()), factors.end());
    return factors;
}

}  // namespace ringlock::app
