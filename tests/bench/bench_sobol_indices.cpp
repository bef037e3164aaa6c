// Sensitivity indices of functions that have them in closed form, and how often the intervals hold those.
// `bench_sobol_indices [BLOCK]` prints one block of docs/design.md, or all; `--list` names them. Takes a minute or two.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "tests/bench/page.hpp"
#include "tests/support/sensitivity_functions.hpp"

namespace {

using namespace ringlock;
using bench::head;
using bench::number;
using bench::row;
using design::Bootstrap;
using design::Index;
using design::OutputIndices;
using test::KnownFunction;

constexpr std::size_t many_base_points = std::size_t{1} << 15;
constexpr std::uint64_t first_seed = 1;

std::vector<KnownFunction> functions() { return {test::ishigami(), test::g_function()}; }

OutputIndices with_sobol(const KnownFunction& f, std::size_t base_points, std::uint64_t seed,
                         const design::SensitivityOptions& options) {
    const design::Points unit = design::sensitivity_points(base_points, f.factors.size(), seed, UINT64_MAX);
    return test::indices_of_values(test::evaluate(f, unit), f.factors.size(), options);
}

OutputIndices with_independent(const KnownFunction& f, std::size_t base_points, std::uint64_t seed,
                               const design::SensitivityOptions& options) {
    const design::Points unit = test::independent_sensitivity_points(base_points, f.factors.size(), seed);
    return test::indices_of_values(test::evaluate(f, unit), f.factors.size(), options);
}

bool holds(const Index& i, double known) { return i.lo <= known && known <= i.hi; }
double half_width(const Index& i) { return 0.5 * (i.hi - i.lo); }

/// Closed form, estimate, interval, whether it holds the closed form, half width.
std::vector<std::string> cells(const Index& index, double known) {
    return {fmt::format("{:.6f}", known), fmt::format("{:.6f}", index.estimate),
            fmt::format("{:.6f} .. {:.6f}", index.lo, index.hi), holds(index, known) ? "yes" : "no",
            fmt::format("{:.2g}", half_width(index))};
}

void one_seed() {
    head({"factor", "S, closed form", "S", "95 %", "inside", "half width", "ST, closed form", "ST", "95 %", "inside",
          "half width"});
    for (const KnownFunction& f : functions()) {
        const OutputIndices indices = with_sobol(f, many_base_points, first_seed, {.seed = first_seed});
        for (std::size_t i = 0; i < f.factors.size(); ++i) {
            std::vector<std::string> line = {fmt::format("{}, {}", f.name, f.factors[i].key)};
            std::ranges::copy(cells(indices.factors[i].first, f.indices[i].first), std::back_inserter(line));
            std::ranges::copy(cells(indices.factors[i].total, f.indices[i].total), std::back_inserter(line));
            row(line);
        }
    }
}

void several_seeds() {
    constexpr std::uint64_t seeds = 20;
    head({"function", "intervals", "hold the closed form", "largest half width", "largest error",
          "rms of error over half width"});
    for (const KnownFunction& f : functions()) {
        std::size_t intervals = 0;
        std::size_t inside = 0;
        double widest = 0.0;
        double largest_error = 0.0;
        double squares = 0.0;
        for (std::uint64_t seed = first_seed; seed < first_seed + seeds; ++seed) {
            const OutputIndices indices = with_sobol(f, many_base_points, seed, {.seed = seed});
            const auto add = [&](const Index& index, double known) {
                ++intervals;
                inside += holds(index, known) ? 1 : 0;
                widest = std::max(widest, half_width(index));
                const double error = index.estimate - known;
                largest_error = std::max(largest_error, std::abs(error));
                squares += std::pow(error / half_width(index), 2);
            };
            for (std::size_t i = 0; i < f.factors.size(); ++i) {
                add(indices.factors[i].first, f.indices[i].first);
                add(indices.factors[i].total, f.indices[i].total);
            }
        }
        row({f.name, fmt::format("{}", intervals), fmt::format("{}", inside), number(widest, 5),
             number(largest_error, 5), number(std::sqrt(squares / static_cast<double>(intervals)), 2)});
    }
}

/// How the intervals of one kind did.
struct Coverage {
    std::size_t intervals = 0;
    std::size_t below = 0;  ///< the closed form lies below the interval
    std::size_t above = 0;
    double width = 0.0;

    void add(const Index& index, double known) {
        ++intervals;
        below += known < index.lo ? 1 : 0;
        above += known > index.hi ? 1 : 0;
        width += index.hi - index.lo;
    }
    std::string percent() const {
        const auto share = [&](std::size_t n) {
            return 100.0 * static_cast<double>(n) / static_cast<double>(intervals);
        };
        return fmt::format("{:.1f} ({:.1f} + {:.1f})", 100.0 - share(below) - share(above), share(below), share(above));
    }
};

void bootstraps() {
    constexpr std::uint64_t seeds = 300;
    head({"points", "base points", "S, percentile", "S, BCa", "ST, percentile", "ST, BCa",
          "width of BCa over percentile, S; ST"});
    for (const bool sobol : {false, true}) {
        for (const std::size_t base_points : {std::size_t{64}, std::size_t{256}, std::size_t{1024}}) {
            Coverage percentile[2];
            Coverage bca[2];
            for (const KnownFunction& f : functions()) {
                for (std::uint64_t seed = first_seed; seed < first_seed + seeds; ++seed) {
                    for (const Bootstrap kind : {Bootstrap::percentile, Bootstrap::bca}) {
                        const design::SensitivityOptions options{.seed = seed, .bootstrap = kind};
                        const OutputIndices indices = sobol ? with_sobol(f, base_points, seed, options)
                                                            : with_independent(f, base_points, seed, options);
                        Coverage* coverage = kind == Bootstrap::bca ? bca : percentile;
                        for (std::size_t i = 0; i < f.factors.size(); ++i) {
                            coverage[0].add(indices.factors[i].first, f.indices[i].first);
                            coverage[1].add(indices.factors[i].total, f.indices[i].total);
                        }
                    }
                }
            }
            row({sobol ? "Sobol'" : "independent", fmt::format("{}", base_points), percentile[0].percent(),
                 bca[0].percent(), percentile[1].percent(), bca[1].percent(),
                 fmt::format("{:.2f}; {:.2f}", bca[0].width / percentile[0].width,
                             bca[1].width / percentile[1].width)});
        }
    }
}

const bench::Block blocks[] = {
    {"indices", one_seed},
    {"seeds", several_seeds},
    {"bootstrap", bootstraps},
};

}  // namespace

int main(int argc, char** argv) { return bench::print_blocks("bench_sobol_indices", argc > 1 ? argv[1] : "", blocks); }
