// How often the intervals of the Allan family hold the truth, over simulated records of one kind of noise each and of
// two that change places in the middle. `bench_allan_coverage [--records N]` prints a page; 5000 records unless told.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/uncertainty.hpp"
#include "tests/unit/allan_support.hpp"

namespace {

using namespace ringlock;
using allan::Estimator;

constexpr std::size_t increments = 1024;
constexpr double confidence = 0.682689492137;

struct Noise {
    std::string_view name;
    int alpha;
    test::Truth truth;
};

constexpr std::array<Noise, 4> noises = {{{"white rate noise", 0, {.n = 1.0}},
                                          {"flicker rate noise", -1, {.b = 1.0}},
                                          {"rate random walk", -2, {.k = 1.0}},
                                          {"white angle noise", 2, {.q = 1.0}}}};

/// Two noises whose Allan variances are equal at m = 16.
struct Mixture {
    std::string_view name;
    test::Truth truth;
    std::array<int, 2> alpha;  ///< at short tau, at long
};

constexpr double middle = 16.0;
constexpr double flicker_floor = 2.0 * std::numbers::ln2 / std::numbers::pi;  // of B = 1

/// Angle white noise 3 Q^2/tau^2, white rate noise N^2/tau, flicker 2 ln 2 B^2/pi, random walk K^2 tau/3.
const std::array<Mixture, 4> mixtures = {
    {{"white angle and white rate noise", {.q = std::sqrt(middle / 3.0), .n = 1.0}, {2, 0}},
     {"white and flicker rate noise", {.n = 1.0, .b = std::sqrt(1.0 / (flicker_floor * middle))}, {0, -1}},
     {"white rate noise and rate random walk", {.n = 1.0, .k = std::sqrt(3.0) / middle}, {0, -2}},
     {"flicker rate noise and rate random walk", {.b = 1.0, .k = std::sqrt(3.0 * flicker_floor / middle)}, {-1, -2}}}};

/// One point of one record.
struct Seen {
    double variance = 0.0;  ///< bias not corrected
    double lo = 0.0;
    double hi = 0.0;
    int alpha = 0;
};

/// The points of all records at one averaging factor.
struct Column {
    Estimator estimator;
    std::int64_t m;
    std::vector<Seen> seen;
    double truth = 0.0;
};

/// The estimator without reflections whose ensemble mean is the truth.
Estimator plain(Estimator e) {
    switch (allan::traits(e).family) {
        case allan::Family::modified:
        case allan::Family::modified_total:
            return Estimator::mdev;
        default:
            return allan::traits(e).differences == 3 ? Estimator::ohdev : Estimator::oadev;
    }
}

/// Deviations of time carry a factor that an interval does not see.
constexpr std::array<Estimator, 8> examined = {Estimator::adev,    Estimator::oadev,  Estimator::mdev,
                                               Estimator::hdev,    Estimator::ohdev,  Estimator::totdev,
                                               Estimator::mtotdev, Estimator::htotdev};

std::vector<Column> simulate(const test::Truth& truth, std::size_t records) {
    std::vector<Column> columns;
    for (const Estimator e : examined) {
        for (const std::int64_t m : allan::octave_factors(allan::largest_factor(e, increments + 1))) {
            if (e == Estimator::totdev && m > static_cast<std::int64_t>(increments / 2)) continue;
            columns.push_back({e, m, std::vector<Seen>(records), 0.0});
        }
    }
    tbb::parallel_for(std::size_t{0}, records, [&](std::size_t record) {
        const auto phase = test::simulate_angle(truth, increments, 1.0, 1000 + record);
        for (Column& column : columns) {
            const std::array<std::int64_t, 1> m = {column.m};
            const allan::Point p = allan::deviation(column.estimator, phase, 1.0, m,
                                                    {.confidence = confidence, .bias = allan::Bias::exact})[0];
            column.seen[record] = {p.dev * p.dev * p.bias, p.lo, p.hi, p.alpha};
        }
    });
    return columns;
}

/// The mean over all records of the plain estimator; 5000 records of many terms know it to a per cent at any tau.
double truth_of(const std::vector<Column>& columns, const Column& mine) {
    for (const Column& c : columns) {
        if (c.estimator != plain(mine.estimator) || c.m != mine.m) continue;
        double sum = 0.0;
        for (const Seen& s : c.seen) sum += s.variance;
        return sum / static_cast<double>(c.seen.size());
    }
    return 0.0;
}

struct Range {
    double least = 100.0;
    double most = 0.0;
    int outside = 0;
    int count = 0;
    void add(double percent) {
        least = std::min(least, percent);
        most = std::max(most, percent);
        outside += percent < 66.0 || percent > 70.0 ? 1 : 0;
        ++count;
    }
    std::string text() const {
        return count == 0 ? "-"
                          : fmt::format("{:.1f} to {:.1f}; {} of {} outside 66 to 70", least, most, outside, count);
    }
};

struct Summary {
    Range many_known, many_told, few_known, few_told;
};

/// How many of the intervals that the program made hold the truth, in per cent.
double told_coverage(const Column& c) {
    const auto held =
        std::ranges::count_if(c.seen, [&](const Seen& s) { return s.lo * s.lo <= c.truth && s.hi * s.hi >= c.truth; });
    return 100.0 * static_cast<double>(held) / static_cast<double>(c.seen.size());
}

/// Share of the second noise in the Allan variance at m, in per cent.
double share_of_second(const Mixture& mixture, std::int64_t m) {
    // Variances go as m^-2, m^-1, m^0, m^1 for alpha = 2, 0, -1, -2.
    const auto power = [](int alpha) { return alpha == 2 ? -2 : -1 - alpha; };
    const double ratio = std::pow(static_cast<double>(m) / middle, power(mixture.alpha[1]) - power(mixture.alpha[0]));
    return 100.0 * ratio / (1.0 + ratio);
}

void print_mixture(const Mixture& mixture, std::size_t records) {
    constexpr std::array<int, 5> kinds = {2, 1, 0, -1, -2};
    constexpr std::array<Estimator, 6> shown = {Estimator::oadev, Estimator::mdev,    Estimator::totdev,
                                                Estimator::ohdev, Estimator::mtotdev, Estimator::htotdev};
    std::vector<Column> columns = simulate(mixture.truth, records);
    for (Column& c : columns) c.truth = truth_of(columns, c);
    const auto at = [&](Estimator e, std::int64_t m) -> const Column& {
        return *std::ranges::find_if(columns, [&](const Column& c) { return c.estimator == e && c.m == m; });
    };
    fmt::print("\n**{}**\n\n| m | % of the second in the variance |", mixture.name);
    for (const int alpha : kinds) fmt::print(" % identified as {} |", alpha);
    for (const Estimator e : shown) fmt::print(" {} |", allan::name(e));
    fmt::print("\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (std::int64_t m = 1; m <= 64; m *= 2) {
        fmt::print("| {} | {:.0f} |", m, share_of_second(mixture, m));
        for (const int alpha : kinds) {
            const auto& seen = at(Estimator::oadev, m).seen;
            const auto told = std::ranges::count(seen, alpha, &Seen::alpha);
            fmt::print(" {:.0f} |", 100.0 * static_cast<double>(told) / static_cast<double>(records));
        }
        for (const Estimator e : shown) fmt::print(" {:.1f} |", told_coverage(at(e, m)));
        fmt::print("\n");
    }
}

void print_noise(const Noise& noise, std::size_t records, Summary& summary) {
    std::vector<Column> columns = simulate(noise.truth, records);
    fmt::print("\n**{}**\n\n", noise.name);
    fmt::print(
        "| deviation | m | edf | of the records | mean over truth | of the theory | % covered, noise known | % "
        "covered, noise identified | % identified |\n"
        "|---|---|---|---|---|---|---|---|---|\n");
    const auto n = static_cast<double>(records);
    for (Column& c : columns) {
        c.truth = truth_of(columns, c);
        if (c.truth == 0.0) continue;
        const allan::Uncertainty u = allan::uncertainty_of(c.estimator, noise.alpha, c.m, increments + 1, confidence);
        double mean = 0.0;
        double squares = 0.0;
        double known = 0.0;
        double named = 0.0;
        for (const Seen& s : c.seen) {
            mean += s.variance / n;
            squares += s.variance * s.variance / n;
            const double scaled = s.variance / (u.bias * c.truth);
            known += scaled >= u.low && scaled <= u.high ? 100.0 / n : 0.0;
            named += s.alpha == noise.alpha ? 100.0 / n : 0.0;
        }
        const double told = told_coverage(c);
        const double degrees = 2.0 * mean * mean / (squares - mean * mean);
        fmt::print("| {} | {} | {:.4g} | {:.4g} | {:.3f} | {:.3f} | {:.1f} | {:.1f} | {:.0f} |\n",
                   allan::name(c.estimator), c.m, u.edf, degrees, mean / c.truth, u.bias, known, told, named);
        (u.edf >= 10.0 ? summary.many_known : summary.few_known).add(known);
        (u.edf >= 10.0 ? summary.many_told : summary.few_told).add(told);
    }
}

}  // namespace

int main(int argc, char** argv) {
    std::size_t records = 5000;
    if (argc == 3 && std::strcmp(argv[1], "--records") == 0) records = std::stoul(argv[2]);
    fmt::print("{} records of {} increments; 68.27 % intervals; counting error {:.1f} %.\n", records, increments,
               100.0 * std::sqrt(0.683 * 0.317 / static_cast<double>(records)));
    Summary summary;
    for (const Noise& noise : noises) print_noise(noise, records, summary);
    fmt::print("\n| edf | % covered, noise known | % covered, noise identified |\n|---|---|---|\n");
    fmt::print("| 10 and more | {} | {} |\n", summary.many_known.text(), summary.many_told.text());
    fmt::print("| fewer | {} | {} |\n", summary.few_known.text(), summary.few_told.text());
    fmt::print(
        "\nTwo noises of equal Allan variance at m = 16: share of records by identified kind (alpha), and % "
        "covered.\n");
    for (const Mixture& mixture : mixtures) print_mixture(mixture, records);
}
