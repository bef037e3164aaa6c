#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <boost/random/gamma_distribution.hpp>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "analysis/lot/confidence.hpp"
#include "engine/random/stream.hpp"
#include "tests/bench/page.hpp"

/// The blocks of docs/lot.md; each prints its tables to standard output.
namespace ringlock::bench::lot_coverage {

inline constexpr std::uint64_t seed = 20240229;

inline std::string percent(double share, int digits = 2) { return fmt::format("{:.{}f}", 100.0 * share, digits); }

/// Chi-squared of nu degrees over nu.
inline double relative_chi_squared(random::Engine& engine, double nu) {
    boost::random::gamma_distribution<double> gamma(0.5 * nu, 2.0 / nu);
    return gamma(engine);
}

/// Probabilities of 0 ... n successes.
inline std::vector<double> binomial_probabilities(std::int64_t n, double p) {
    std::vector<double> probability(static_cast<std::size_t>(n) + 1);
    const double log_n = std::lgamma(static_cast<double>(n) + 1.0);
    for (std::int64_t k = 0; k <= n; ++k) {
        const auto x = static_cast<double>(k);
        const auto y = static_cast<double>(n - k);
        probability[static_cast<std::size_t>(k)] =
            std::exp(log_n - std::lgamma(x + 1.0) - std::lgamma(y + 1.0) + x * std::log(p) + y * std::log1p(-p));
    }
    return probability;
}

struct Least {
    double coverage = 1.0;
    double p = 0.0;
    void see(double c, double at) {
        if (c < coverage) {
            coverage = c;
            p = at;
        }
    }
};

inline constexpr int grid = 1000;

/// A grid of shares, and, either side of every end within (0, 1), a share just beside it: there the coverage jumps.
/// Between two ends it is smooth.
inline std::vector<double> shares_to_try(const std::vector<lot::Interval>& intervals) {
    std::vector<double> p;
    for (int i = 1; i < grid; ++i) p.push_back(static_cast<double>(i) / grid);
    constexpr double aside = 1e-10;
    for (const lot::Interval& interval : intervals) {
        for (const double end : {interval.lo, interval.hi}) {
            for (const double beside : {end * (1.0 - aside), end * (1.0 + aside)}) {
                if (beside > 0.0 && beside < 1.0) p.push_back(beside);
            }
        }
    }
    std::ranges::sort(p);
    return p;
}

// Lots of fixed size (lot_coverage_fixed.cpp):
void print_ratio();
void print_exact();

// Lots that a rule stopped: exact sums and Basu's theorem (lot_coverage_stopped.cpp), and whole studies
// (lot_coverage_studies.cpp):
void print_stopped_yields();
void print_stopped_means();
void print_stopped_lots();

}  // namespace ringlock::bench::lot_coverage
