#include "analysis/lot/quantile.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <cmath>
#include <iterator>

#include "engine/core/error.hpp"

namespace ringlock::lot {
namespace {

/// The first x of [begin, end) for which `reached` is true, end if there is no such x; once true it stays true.
template <class Predicate>
std::int64_t first_reached(std::int64_t begin, std::int64_t end, Predicate reached) {
    while (begin < end) {
        const std::int64_t middle = begin + (end - begin) / 2;
        if (reached(middle)) {
            end = middle;
        } else {
            begin = middle + 1;
        }
    }
    return begin;
}

/// Hyndman and Fan's definition 8.
std::optional<double> type_8_of_sorted(const std::vector<double>& sorted, double p) {
    if (sorted.empty()) return std::nullopt;
    const auto n = static_cast<double>(sorted.size());
    const double position = std::clamp((n + 1.0 / 3.0) * p + 1.0 / 3.0, 1.0, n);
    const auto rank = std::min(static_cast<std::size_t>(position), sorted.size());
    const double share = position - static_cast<double>(rank);
    const double below = sorted[rank - 1];
    const double above = sorted[std::min(rank, sorted.size() - 1)];
    if (share == 0.0 || below == above) return below;
    const double value = (1.0 - share) * below + share * above;  // an infinite neighbour makes it infinite
    if (std::isnan(value)) return std::nullopt;
    return value;
}

}  // namespace

QuantileRanks quantile_ranks(std::int64_t n, double p, const Confidence& confidence) {
    const double tail = tail_probability(confidence);
    if (n < 0) throw InputError(fmt::format("quantile of {} gyros: a lot has 0 gyros or more", n));
    if (!(p > 0.0 && p < 1.0)) {
        throw InputError(fmt::format(
            "quantile {} of a lot: must lie between 0 and 1, without them; 0.05 is the quantile of 5 %", p));
    }
    QuantileRanks ranks;
    if (n == 0) return ranks;
    const boost::math::binomial_distribution<double> below(static_cast<double>(n), p);
    // Missing at rank r: B <= r - 1 at the lower end, B >= r at the upper.
    const std::int64_t too_high = first_reached(
        1, n + 1, [&](std::int64_t r) { return boost::math::cdf(below, static_cast<double>(r - 1)) > tail; });
    if (too_high > 1) ranks.lo = too_high - 1;
    const std::int64_t high_enough = first_reached(1, n + 1, [&](std::int64_t r) {
        return boost::math::cdf(boost::math::complement(below, static_cast<double>(r - 1))) <= tail;
    });
    if (high_enough <= n) ranks.hi = high_enough;
    return ranks;
}

std::vector<Quantile> quantiles(std::span<const double> values, std::span<const double> p,
                                const Confidence& confidence) {
    std::vector<double> sorted;
    sorted.reserve(values.size());
    std::ranges::copy_if(values, std::back_inserter(sorted), [](double v) { return !std::isnan(v); });
    std::ranges::sort(sorted);
    const auto n = static_cast<std::int64_t>(sorted.size());
    std::vector<Quantile> found;
    for (const double q : p) {
        const QuantileRanks ranks = quantile_ranks(n, q, confidence);
        Quantile quantile{.p = q,
                          .value = type_8_of_sorted(sorted, q),
                          .lo = std::nullopt,
                          .hi = std::nullopt,
                          .n = n,
                          .missing = static_cast<std::int64_t>(values.size()) - n};
        if (ranks.lo) quantile.lo = sorted[static_cast<std::size_t>(*ranks.lo - 1)];
        if (ranks.hi) quantile.hi = sorted[static_cast<std::size_t>(*ranks.hi - 1)];
        found.push_back(quantile);
    }
    return found;
}

}  // namespace ringlock::lot
