// How often the intervals of the Allan family hold the truth, over simulated records of one kind of noise each.
// `bench_allan_coverage [--records N]` prints a page; 5000 records unless told.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
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

std::vector<Column> simulate(const Noise& noise, std::size_t records) {
    std::vector<Column> columns;
    for (const Estimator e : examined) {
        for (const std::int64_t m : allan::octave_factors(allan::largest_factor(e, increments + 1))) {
            if (e == Estimator::totdev && m > static_cast<std::int64_t>(increments / 2)) continue;
            columns.push_back({e, m, std::vector<Seen>(records), 0.0});
        }
    }
    tbb::parallel_for(std::size_t{0}, records, [&](std::size_t record) {
        const auto phase = test::simulate_angle(noise.truth, increments, 1.0, 1000 + record);
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

void print_noise(const Noise& noise, std::size_t records, Summary& summary) {
    std::vector<Column> columns = simulate(noise, records);
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
        double told = 0.0;
        double named = 0.0;
        for (const Seen& s : c.seen) {
            mean += s.variance / n;
            squares += s.variance * s.variance / n;
            const double scaled = s.variance / (u.bias * c.truth);
            known += scaled >= u.low && scaled <= u.high ? 100.0 / n : 0.0;
            told += s.lo * s.lo <= c.truth && s.hi * s.hi >= c.truth ? 100.0 / n : 0.0;
            named += s.alpha == noise.alpha ? 100.0 / n : 0.0;
        }
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
}
