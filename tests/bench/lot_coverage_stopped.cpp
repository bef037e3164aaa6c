#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/digamma.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "analysis/lot/mean.hpp"
#include "analysis/lot/share.hpp"
#include "analysis/lot/stopping.hpp"
#include "engine/random/stream.hpp"
#include "tests/bench/lot_coverage.hpp"

namespace ringlock::bench::lot_coverage {

namespace {

// ---- stopped-yields -------------------------------------------------------------------------------------------------

/// What a rule does at one look, for each number of successes.
struct Look {
    std::int64_t n = 0;
    std::vector<char> stops;
    std::vector<lot::Interval> intervals;
};

std::vector<Look> looks_of(double half_width, std::int64_t most, const lot::Confidence& confidence) {
    const lot::StoppingRule rule({.arw_relative = std::nullopt, .yield_absolute = half_width}, most, confidence.level);
    std::vector<Look> looks;
    for (auto n = rule.next(0); n; n = rule.next(*n)) {
        Look look{.n = *n, .stops = {}, .intervals = {}};
        const auto counts = static_cast<std::size_t>(*n) + 1;
        look.stops.resize(counts);
        look.intervals.resize(counts);
        tbb::parallel_for(std::size_t{0}, counts, [&](std::size_t k) {
            const lot::YieldCount yield{.name = "yield", .k = static_cast<std::int64_t>(k)};
            if (confidence.sampling == lot::Sampling::until_precise) {
                look.stops[k] = rule.decide(*n, {}, {&yield, 1}).stop;
            } else {  // what a rule without any correction would do
                look.stops[k] = *lot::share(yield.k, *n, confidence).half_width() <= half_width || *n == most;
            }
            look.intervals[k] = *lot::share(yield.k, *n, confidence).interval;
        });
        looks.push_back(look);
        if (std::ranges::all_of(look.stops, [](char s) { return s != 0; })) break;
    }
    return looks;
}

struct Stopped {
    double coverage = 0.0;
    double gyros = 0.0;
};

/// Exact, by carrying the probabilities of all counts that went on from look to look.
Stopped stopped_yield(const std::vector<Look>& looks, double p) {
    constexpr double negligible = 1e-14;
    Stopped s;
    std::vector<double> going = {1.0};
    std::int64_t at = 0;
    for (const Look& look : looks) {
        const std::vector<double> added = binomial_probabilities(look.n - at, p);
        const auto first = std::ranges::find_if(added, [](double x) { return x > negligible; });
        const auto last = std::ranges::find_if(added.rbegin(), added.rend(), [](double x) { return x > negligible; });
        std::vector<double> here(static_cast<std::size_t>(look.n) + 1);
        for (std::size_t k = 0; k < going.size(); ++k) {
            if (going[k] <= negligible) continue;
            for (auto a = first; a < last.base(); ++a) {
                here[k + static_cast<std::size_t>(a - added.begin())] += going[k] * *a;
            }
        }
        for (std::size_t k = 0; k < here.size(); ++k) {
            if (look.stops[k] == 0) continue;
            s.gyros += here[k] * static_cast<double>(look.n);
            if (look.intervals[k].holds(p)) s.coverage += here[k];
            here[k] = 0.0;
        }
        going = here;
        at = look.n;
    }
    return s;
}

}  // namespace

void print_stopped_yields() {
    fmt::print(
        "Exact; least over p = 0.001 ... 0.5, beside every end of an interval, and in the middle between two.\n\n");
    head({"+- asked for", "most gyros", "least without correction [%]", "least [%]", "at", "mean gyros at p = 0.1",
          "0.46", "without correction at p = 0.1", "0.46"});
    struct Case {
        double half_width;
        std::int64_t most;
    };
    Least overall;
    for (const Case c :
         {Case{0.02, 10000}, Case{0.02, 1000}, Case{0.025, 10000}, Case{0.03, 10000}, Case{0.0308, 10000},
          Case{0.04, 10000}, Case{0.05, 10000}, Case{0.05, 300}, Case{0.061, 10000}, Case{0.08, 10000},
          Case{0.0946, 10000}, Case{0.1, 10000}, Case{0.1149, 10000}, Case{0.15, 10000}, Case{0.2, 10000}}) {
        std::array<Least, 2> least;
        std::array<std::vector<Look>, 2> all;
        for (const auto sampling : {lot::Sampling::fixed, lot::Sampling::until_precise}) {
            const auto which = static_cast<std::size_t>(sampling);
            all[which] = looks_of(c.half_width, c.most, {.level = 0.95, .sampling = sampling});
            std::vector<lot::Interval> reported;
            for (const Look& look : all[which]) {
                for (std::size_t k = 0; k < look.stops.size(); ++k) {
                    if (look.stops[k] != 0) reported.push_back(look.intervals[k]);
                }
            }
            std::vector<double> p = shares_to_try(reported);
            std::erase_if(p, [](double x) { return x > 0.5; });  // symmetric
            const std::size_t ends = p.size();
            for (std::size_t i = 1; i < ends; ++i) p.push_back(0.5 * (p[i - 1] + p[i]));
            std::vector<double> coverage(p.size());
            tbb::parallel_for(std::size_t{0}, p.size(),
                              [&](std::size_t i) { coverage[i] = stopped_yield(all[which], p[i]).coverage; });
            for (std::size_t i = 0; i < p.size(); ++i) least[which].see(coverage[i], p[i]);
        }
        overall.see(least[1].coverage, least[1].p);
        std::vector<std::string> cells = {fmt::format("{}", c.half_width), fmt::format("{}", c.most),
                                          percent(least[0].coverage), percent(least[1].coverage),
                                          fmt::format("{:.4f}", least[1].p)};
        for (const std::size_t which : {1, 0}) {
            for (const double p : {0.1, 0.46})
                cells.push_back(fmt::format("{:.0f}", stopped_yield(all[which], p).gyros));
        }
        row(cells);
    }
    fmt::print("\nLeast of all: {} % at {:.4f}.\n", percent(overall.coverage), overall.p);
}

namespace {

// ---- stopped-means --------------------------------------------------------------------------------------------------

/// Of a normal sample the mean is independent of all that does not change when a constant is added (Basu, Sankhya 15,
/// 377, 1955), of the rule's stop too. Given where the lot stopped and how wide the interval is, the probability that
/// it holds the truth is erf(half width sqrt(n/2)/sigma). Variances grow by chi-squared from look to look.

}  // namespace

void print_stopped_means() {
    constexpr std::size_t paths = 100000;
    const lot::Confidence stopped{.level = 0.95, .sampling = lot::Sampling::until_precise};
    fmt::print(
        "Normal logarithms; spread over half width asked for from 0.5 to 20 in steps of 6 %; {} paths each, error "
        "below "
        "0.01 %.\n\n",
        paths);
    head({"level", "widened", "least [%]", "at", "mean gyros there", "most [%]", "mean gyros, all",
          "without widening, all"});
    for (const double level : {0.682689492137086, 0.95, 0.99}) {
        std::array<double, 2> all_gyros{};
        std::array<std::vector<std::string>, 2> cells;
        for (const bool widened : {false, true}) {
            std::vector<double> ratios;
            for (double r = 0.5; r < 20.0; r *= 1.06) ratios.push_back(r);
            std::vector<Stopped> found(ratios.size());
            tbb::parallel_for(std::size_t{0}, ratios.size(), [&](std::size_t i) {
                random::Engine engine = random::make_engine({seed, i}, random::Purpose::bootstrap);
                std::map<std::int64_t, double> factor;  // half width over root of the sum of squares
                for (auto n = lot::next_look(0, 1 << 20); n; n = lot::next_look(*n, 1 << 20)) {
                    const auto x = static_cast<double>(*n);
                    const boost::math::students_t_distribution<double> t(x - 1.0);
                    factor[*n] = boost::math::quantile(boost::math::complement(t, 0.5 * (1.0 - level))) /
                                 std::sqrt(x * (x - 1.0)) * (widened ? lot::widening(stopped, *n) : 1.0);
                }
                for (std::size_t path = 0; path < paths; ++path) {
                    double squares = 0.0;
                    std::int64_t before = 1;
                    for (const auto& [n, f] : factor) {
                        const auto more = static_cast<double>(n - before);
                        squares += more * relative_chi_squared(engine, more);
                        before = n;
                        const double half_width = f * std::sqrt(squares);
                        if (half_width * ratios[i] > 1.0) continue;
                        found[i].coverage += std::erf(half_width * std::sqrt(0.5 * static_cast<double>(n))) / paths;
                        found[i].gyros += static_cast<double>(n) / paths;
                        break;
                    }
                }
            });
            Least least;
            double most = 0.0;
            double there = 0.0;
            for (std::size_t i = 0; i < ratios.size(); ++i) {
                if (found[i].coverage < least.coverage) there = found[i].gyros;
                least.see(found[i].coverage, ratios[i]);
                most = std::max(most, found[i].coverage);
                all_gyros[widened ? 1 : 0] += found[i].gyros / static_cast<double>(ratios.size());
            }
            cells[widened ? 1 : 0] = {percent(level),
                                      widened ? "sqrt(1.04 + 2/n)" : "no",
                                      percent(least.coverage),
                                      fmt::format("{:.2f}", least.p),
                                      fmt::format("{:.0f}", there),
                                      percent(most)};
        }
        for (const std::size_t which : {0, 1}) {
            cells[which].push_back(fmt::format("{:.1f}", all_gyros[which]));
            cells[which].push_back(fmt::format("{:.1f}", all_gyros[0]));
            row(cells[which]);
        }
    }
}

}  // namespace ringlock::bench::lot_coverage
