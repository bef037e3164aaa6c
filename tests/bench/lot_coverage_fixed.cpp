#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/random/gamma_distribution.hpp>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "analysis/lot/pairs.hpp"
#include "analysis/lot/quantile.hpp"
#include "analysis/lot/share.hpp"
#include "engine/random/stream.hpp"
#include "tests/bench/lot_coverage.hpp"

namespace ringlock::bench::lot_coverage {

namespace {

struct Gyro {
    double a = 1.0;
    double b = 1.0;
};

struct Population {
    std::string name;
    std::function<Gyro(random::Engine&)> draw;
    double log_ratio = 0.0;            ///< true mean
    std::optional<double> difference;  ///< true mean of a - b, where it has one
};

std::vector<Population> populations() {
    using Normal = boost::random::normal_distribution<double>;
    constexpr double spread = 0.05;
    constexpr double ratio = 1.3;
    const auto student = [](random::Engine& e, double nu) {
        return Normal()(e) / std::sqrt(relative_chi_squared(e, nu));
    };
    // E log(chi-squared/nu) = digamma(nu/2) - log(nu/2); E sqrt(chi-squared/nu) = Gamma((nu + 1)/2)/Gamma(nu/2)
    // sqrt(2/nu).
    constexpr double nu = 4.0;
    const double log_of_estimate = 0.5 * (boost::math::digamma(0.5 * nu) - std::log(0.5 * nu));
    const double mean_estimate =
        boost::math::tgamma(0.5 * (nu + 1.0)) / boost::math::tgamma(0.5 * nu) * std::sqrt(2.0 / nu);
    return {
        {"lognormal ratio 1.3, 5 %",
         [](random::Engine& e) {
             return Gyro{ratio * std::exp(spread * Normal()(e)), 1.0};
         },
         std::log(ratio), ratio * std::exp(0.5 * spread * spread) - 1.0},
        {"gyros 20 % apart, both arms estimated with 10 degrees of freedom",
         [](random::Engine& e) {
             const double n = std::exp(0.2 * Normal()(e));
             const double a = n * std::sqrt(relative_chi_squared(e, 10.0));
             return Gyro{a, n * std::sqrt(relative_chi_squared(e, 10.0))};
         },
         0.0, 0.0},
        {"log ratio 5 % times Student's t of 4",
         [student](random::Engine& e) {
             return Gyro{ratio * std::exp(spread * student(e, 4.0)), 1.0};
         },
         std::log(ratio), std::nullopt},
        {"one arm estimated with 4 degrees of freedom, the other known (skew -0.8)",
         [](random::Engine& e) {
             return Gyro{std::sqrt(relative_chi_squared(e, nu)), 1.0};
         },
         log_of_estimate, mean_estimate - 1.0},
    };
}

}  // namespace

void print_ratio() {
    constexpr std::size_t lots = 20000;
    fmt::print("{} lots a line; counting error {} %.\n\n", lots, percent(std::sqrt(0.95 * 0.05 / lots)));
    head({"gyros", "pairs of arms", "ratio held [%]", "difference held [%]"});
    for (const Population& population : populations()) {
        for (const std::size_t n : {16, 64, 1000}) {
            std::vector<std::array<bool, 2>> held(lots);
            tbb::parallel_for(std::size_t{0}, lots, [&](std::size_t lot) {
                random::Engine engine = random::make_engine({seed + n, lot}, random::Purpose::initial_phase);
                std::vector<double> a(n);
                std::vector<double> b(n);
                for (std::size_t i = 0; i < n; ++i) {
                    const Gyro g = population.draw(engine);
                    a[i] = g.a;
                    b[i] = g.b;
                }
                const lot::Comparison c = lot::compare(a, b);
                held[lot] = {c.ratio.interval->holds(std::exp(population.log_ratio)),
                             c.difference.interval->holds(population.difference.value_or(0.0))};
            });
            const auto share = [&](std::size_t figure) {
                const auto count = std::ranges::count_if(held, [&](const auto& h) { return h[figure]; });
                return static_cast<double>(count) / lots;
            };
            row({fmt::format("{}", n), population.name, percent(share(0)),
                 population.difference ? percent(share(1)) : "no mean"});
        }
    }
}

namespace {

Least least_coverage_of_share(std::int64_t n, const lot::Confidence& confidence) {
    std::vector<lot::Interval> intervals;
    for (std::int64_t k = 0; k <= n; ++k) intervals.push_back(*lot::share(k, n, confidence).interval);
    const std::vector<double> p = shares_to_try(intervals);
    std::vector<double> coverage(p.size());
    tbb::parallel_for(std::size_t{0}, p.size(), [&](std::size_t i) {
        const std::vector<double> probability = binomial_probabilities(n, p[i]);
        for (std::size_t k = 0; k < probability.size(); ++k) {
            if (intervals[k].holds(p[i])) coverage[i] += probability[k];
        }
    });
    Least least;
    for (std::size_t i = 0; i < p.size(); ++i) least.see(coverage[i], p[i]);
    return least;
}

/// Coverage of an interval of order statistics: lo <= B < hi for B values below the quantile.
double coverage_of_quantile(std::int64_t n, double p, const lot::QuantileRanks& ranks) {
    const std::vector<double> probability = binomial_probabilities(n, p);
    double held = 0.0;
    for (std::int64_t b = ranks.lo.value_or(0); b < ranks.hi.value_or(n + 1); ++b) {
        held += probability[static_cast<std::size_t>(b)];
    }
    return held;
}

}  // namespace

void print_exact() {
    fmt::print(
        "Least coverage over p = 0.001 ... 0.999; for shares also beside every end of an interval, where it is least. "
        "An "
        "absent end bounds nothing.\n\n");
    head({"gyros", "share: least [%]", "at", "quantile: least [%]", "at", "both ends from p = ... on", "5 % [%]",
          "median [%]", "95 % [%]"});
    for (const std::int64_t n : {1, 16, 64, 72, 200, 1000}) {
        const Least share = least_coverage_of_share(n, {});
        Least quantile;
        std::optional<double> bounded_from;
        for (int i = 1; i < grid; ++i) {
            const double p = static_cast<double>(i) / grid;
            const lot::QuantileRanks ranks = lot::quantile_ranks(n, p);
            quantile.see(coverage_of_quantile(n, p, ranks), p);
            if (!bounded_from && ranks.lo && ranks.hi) bounded_from = p;
        }
        std::vector<std::string> cells = {
            fmt::format("{}", n),           percent(share.coverage),
            fmt::format("{:.4f}", share.p), percent(quantile.coverage),
            fmt::format("{}", quantile.p),  bounded_from ? fmt::format("{}", *bounded_from) : "none"};
        for (const double p : {0.05, 0.5, 0.95}) {
            const lot::QuantileRanks ranks = lot::quantile_ranks(n, p);
            const std::string ends = !ranks.lo && !ranks.hi ? ", no end"
                                     : !ranks.lo            ? ", upper end only"
                                     : !ranks.hi            ? ", lower end only"
                                                            : "";
            cells.push_back(percent(coverage_of_quantile(n, p, ranks)) + ends);
        }
        row(cells);
    }
}

}  // namespace ringlock::bench::lot_coverage
