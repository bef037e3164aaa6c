#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/digamma.hpp>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "analysis/lot/mean.hpp"
#include "analysis/lot/quantile.hpp"
#include "analysis/lot/share.hpp"
#include "analysis/lot/stopping.hpp"
#include "engine/random/stream.hpp"
#include "tests/bench/lot_coverage.hpp"

namespace ringlock::bench::lot_coverage {

namespace {

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

}  // namespace

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

}  // namespace ringlock::bench::lot_coverage
