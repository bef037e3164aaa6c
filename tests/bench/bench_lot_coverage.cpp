// How often the intervals of analysis/lot hold the truth. `bench_lot_coverage [BLOCK]` prints the tables of
// docs/lot.md, or one of them: ratio, exact, stopped-yields, stopped-means, stopped-lots; `--list` names them.
// LOT_STUDIES=N in the environment sets the number of simulated studies a rule of stopped-lots, 5000 unless told.
//
// exact and stopped-yields are sums over binomial probabilities without any simulation. stopped-means draws variances
// only, and integrates over the mean.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/digamma.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <boost/random/gamma_distribution.hpp>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "analysis/lot/mean.hpp"
#include "analysis/lot/pairs.hpp"
#include "analysis/lot/quantile.hpp"
#include "analysis/lot/share.hpp"
#include "analysis/lot/stopping.hpp"
#include "engine/random/stream.hpp"
#include "tests/bench/page.hpp"

namespace {

using namespace ringlock;
using bench::head;
using bench::row;

constexpr std::uint64_t seed = 20240229;

std::string percent(double share, int digits = 2) { return fmt::format("{:.{}f}", 100.0 * share, digits); }

/// Chi-squared of nu degrees over nu.
double relative_chi_squared(random::Engine& engine, double nu) {
    boost::random::gamma_distribution<double> gamma(0.5 * nu, 2.0 / nu);
    return gamma(engine);
}

// ---- ratio ----------------------------------------------------------------------------------------------------------

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

// ---- exact ----------------------------------------------------------------------------------------------------------

/// Probabilities of 0 ... n successes.
std::vector<double> binomial_probabilities(std::int64_t n, double p) {
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

constexpr int grid = 1000;

/// A grid of shares, and, either side of every end within (0, 1), a share just beside it: there the coverage jumps.
/// Between two ends it is smooth.
std::vector<double> shares_to_try(const std::vector<lot::Interval>& intervals) {
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

// ---- stopped-means --------------------------------------------------------------------------------------------------

/// Of a normal sample the mean is independent of all that does not change when a constant is added (Basu, Sankhya 15,
/// 377, 1955), of the rule's stop too. Given where the lot stopped and how wide the interval is, the probability that
/// it holds the truth is erf(half width sqrt(n/2)/sigma). Variances grow by chi-squared from look to look.
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

// ---- stopped-lots ---------------------------------------------------------------------------------------------------

/// Scatter of log N.
enum class Shape { normal, heavy, skewed };

struct Study {
    std::optional<double> arw_relative;
    std::optional<double> yield_absolute;
    double spread = 0.05;
    double share = 0.79;  ///< of the population within the limit of N
    Shape shape = Shape::normal;
    bool limit_on_arw = true;  ///< the yield counts N itself, or a figure that has nothing to do with it
};

constexpr std::array<double, 3> quantile_p = {0.05, 0.5, 0.95};

struct Seen {
    std::int64_t n = 0;
    bool mean = false;
    bool yield = false;
    std::array<bool, 3> quantile{};
    std::array<bool, 3> bounded{};
};

/// Mean 0, standard deviation 1.
struct Deviate {
    Shape shape = Shape::normal;
    static constexpr double nu = 4.0;  // of the estimates that make the logarithms skewed, -0.8
    static constexpr double tail_freedom = 5.0;

    double operator()(random::Engine& engine) const {
        boost::random::normal_distribution<double> normal;
        switch (shape) {
            case Shape::normal:
                return normal(engine);
            case Shape::heavy:
                return std::sqrt((tail_freedom - 2.0) / tail_freedom) * normal(engine) /
                       std::sqrt(relative_chi_squared(engine, tail_freedom));
            case Shape::skewed:
                break;
        }
        return (std::log(relative_chi_squared(engine, nu)) - log_mean()) / log_deviation();
    }
    double quantile(double p) const {
        switch (shape) {
            case Shape::normal:
                return boost::math::quantile(boost::math::normal(), p);
            case Shape::heavy:
                return std::sqrt((tail_freedom - 2.0) / tail_freedom) *
                       boost::math::quantile(boost::math::students_t(tail_freedom), p);
            case Shape::skewed:
                break;
        }
        return (std::log(boost::math::gamma_p_inv(0.5 * nu, p) * 2.0 / nu) - log_mean()) / log_deviation();
    }

   private:
    static double log_mean() { return boost::math::digamma(0.5 * nu) - std::log(0.5 * nu); }
    static double log_deviation() { return std::sqrt(boost::math::trigamma(0.5 * nu)); }
};

constexpr std::int64_t most_gyros = 10000;

struct LookRanks {
    std::int64_t n = 0;
    std::array<lot::QuantileRanks, 3> ranks;
};

/// One study from its first gyro to its stop.
Seen run(const Study& study, const lot::StoppingRule& rule, const std::vector<LookRanks>& looks, std::size_t number) {
    random::Engine engine = random::make_engine({seed, number}, random::Purpose::initial_phase);
    const Deviate deviate{study.shape};
    const double limit = deviate.quantile(study.share);
    boost::random::uniform_real_distribution<double> uniform;
    std::vector<double> z;
    std::vector<double> n_of_gyro;
    std::int64_t within = 0;
    for (const LookRanks& look : looks) {
        while (static_cast<std::int64_t>(z.size()) < look.n) {
            z.push_back(deviate(engine));
            n_of_gyro.push_back(std::exp(study.spread * z.back()));
            within += (study.limit_on_arw ? z.back() <= limit : uniform(engine) <= study.share) ? 1 : 0;
        }
        const lot::ArwColumn arw{.name = "arm", .values = n_of_gyro};
        const lot::YieldCount yield{.name = "yield", .k = within};
        if (!rule.decide(look.n, {&arw, 1}, {&yield, 1}).stop) continue;
        Seen seen;
        seen.n = look.n;
        seen.mean = lot::geometric_mean(n_of_gyro, rule.confidence()).interval->holds(1.0);
        seen.yield = lot::share(within, look.n, rule.confidence()).interval->holds(study.share);
        for (std::size_t q = 0; q < quantile_p.size(); ++q) {
            // The value of rank r is above the truth where fewer than r are below.
            const double truth = deviate.quantile(quantile_p[q]);
            const auto below = std::ranges::count_if(z, [truth](double x) { return x < truth; });
            const lot::QuantileRanks& ranks = look.ranks[q];
            seen.quantile[q] = (!ranks.lo || below >= *ranks.lo) && (!ranks.hi || below < *ranks.hi);
            seen.bounded[q] = ranks.lo && ranks.hi;
        }
        return seen;
    }
    return {};
}

struct Extremes {
    double least = 1.0;
    double most = 0.0;
    void see(double share) {
        least = std::min(least, share);
        most = std::max(most, share);
    }
    std::string text() const { return fmt::format("{} to {}", percent(least), percent(most)); }
};

void print_stopped_lots() {
    std::size_t studies = 5000;
    if (const char* told = std::getenv("LOT_STUDIES")) studies = std::stoul(told);
    fmt::print(
        "{} studies a rule; counting error {} %. An absent end bounds nothing; in brackets the percentage of studies "
        "with both.\n\n",
        studies, percent(std::sqrt(0.95 * 0.05 / static_cast<double>(studies))));
    head({"arw_relative", "yield_absolute", "log N", "share", "mean gyros", "mean of log N [%]", "yield [%]", "5 % [%]",
          "median [%]", "95 % [%]"});
    constexpr std::array<double, 4> shares = {0.1, 0.46, 0.79, 0.97};
    std::vector<Study> cases;
    const std::optional<double> none;
    for (const double r : {0.01, 0.05}) {
        for (const double spread : {0.02, 0.05, 0.2}) {
            for (const double share : {0.46, 0.97}) cases.push_back({r, none, spread, share});
        }
    }
    for (const double h : {0.02, 0.05}) {
        for (const double share : shares) cases.push_back({none, h, 0.05, share});
    }
    // Where a grid of shares and half widths has the mean held least often.
    cases.push_back({none, 0.061, 0.05, 0.14});
    cases.push_back({none, 0.115, 0.05, 0.74});
    // Both, where either can be what a lot waits for.
    struct Both {
        double arw_relative, yield_absolute, spread;
    };
    for (const Both b : {Both{0.01, 0.05, 0.05}, Both{0.05, 0.05, 0.2}, Both{0.01, 0.02, 0.2}, Both{0.05, 0.02, 0.2}}) {
        for (const double share : shares) cases.push_back({b.arw_relative, b.yield_absolute, b.spread, share});
    }
    for (const double share : shares) cases.push_back({0.05, 0.05, 0.2, share, Shape::normal, false});
    for (const Shape shape : {Shape::heavy, Shape::skewed}) {
        for (const double r : {0.01, 0.05}) cases.push_back({r, none, 0.2, 0.79, shape});
        for (const double share : {0.46, 0.97}) cases.push_back({0.05, 0.05, 0.2, share, shape});
    }
    std::array<Extremes, 5> of_normal;
    std::array<Extremes, 5> of_others;
    for (const Study& study : cases) {
        const lot::StoppingRule rule({.arw_relative = study.arw_relative, .yield_absolute = study.yield_absolute},
                                     most_gyros);
        std::vector<LookRanks> looks;
        for (auto n = rule.next(0); n; n = rule.next(*n)) {
            LookRanks look{.n = *n, .ranks = {}};
            for (std::size_t q = 0; q < quantile_p.size(); ++q) {
                look.ranks[q] = lot::quantile_ranks(*n, quantile_p[q], rule.confidence());
            }
            looks.push_back(look);
        }
        std::vector<Seen> seen(studies);
        const std::size_t first = static_cast<std::size_t>(&study - cases.data()) * studies;  // other gyros each time
        tbb::parallel_for(std::size_t{0}, studies,
                          [&](std::size_t i) { seen[i] = run(study, rule, looks, first + i); });
        const auto share_of = [&](auto member) {
            return static_cast<double>(std::ranges::count_if(seen, member)) / static_cast<double>(studies);
        };
        double gyros = 0.0;
        for (const Seen& s : seen) gyros += static_cast<double>(s.n) / static_cast<double>(studies);
        std::array<double, 5> held = {share_of([](const Seen& s) { return s.mean; }),
                                      share_of([](const Seen& s) { return s.yield; })};
        std::vector<std::string> cells = {
            study.arw_relative ? fmt::format("{}", *study.arw_relative) : "-",
            study.yield_absolute ? fmt::format("{}", *study.yield_absolute) : "-",
            fmt::format("{:.0f} %{}", 100.0 * study.spread,
                        study.shape == Shape::heavy    ? ", t of 5"
                        : study.shape == Shape::skewed ? ", skew -0.8"
                                                       : ""),
            fmt::format("{}{}", study.share, study.limit_on_arw ? "" : " of another figure"),
            fmt::format("{:.0f}", gyros),
            percent(held[0]),
            percent(held[1])};
        for (std::size_t q = 0; q < quantile_p.size(); ++q) {
            held[2 + q] = share_of([&](const Seen& s) { return s.quantile[q]; });
            const double bounded = share_of([&](const Seen& s) { return s.bounded[q]; });
            cells.push_back(percent(held[2 + q]) + (bounded < 1.0 ? fmt::format(" ({})", percent(bounded, 0)) : ""));
        }
        row(cells);
        for (std::size_t f = 0; f < held.size(); ++f) {
            (study.shape == Shape::normal ? of_normal : of_others)[f].see(held[f]);
        }
    }
    fmt::print("\n");
    head({"least and most", "mean of log N", "yield", "5 %", "median", "95 %"});
    for (const auto& [name, of] : {std::pair{"normal log N", of_normal}, {"t of 5, skew -0.8", of_others}}) {
        std::vector<std::string> cells = {name};
        for (const Extremes& e : of) cells.push_back(e.text());
        row(cells);
    }
}

}  // namespace

int main(int argc, char** argv) {
    const std::array<bench::Block, 5> blocks = {{{"ratio", print_ratio},
                                                 {"exact", print_exact},
                                                 {"stopped-yields", print_stopped_yields},
                                                 {"stopped-means", print_stopped_means},
                                                 {"stopped-lots", print_stopped_lots}}};
    return bench::print_blocks("bench_lot_coverage", argc > 1 ? argv[1] : "", blocks);
}
