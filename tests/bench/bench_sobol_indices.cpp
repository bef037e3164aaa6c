// Sensitivity indices of functions that have them in closed form, and how often the intervals hold those.
// `bench_sobol_indices [BLOCK]` prints one block of docs/design.md, or all; `--list` names them. Takes a minute or two.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
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

void one_seed() {
    head({"function", "index", "closed form", "estimate", "95 % interval", "inside", "half width"});
    for (const KnownFunction& f : functions()) {
        const OutputIndices indices = with_sobol(f, many_base_points, first_seed, {.seed = first_seed});
        for (const bool total : {false, true}) {
            for (std::size_t i = 0; i < f.factors.size(); ++i) {
                const Index& index = total ? indices.factors[i].total : indices.factors[i].first;
                const double known = total ? f.indices[i].total : f.indices[i].first;
                row({f.name, fmt::format("{}{}", total ? "ST" : "S", i + 1), number(known, 5),
                     number(index.estimate, 5), fmt::format("{:.5f} .. {:.5f}", index.lo, index.hi),
                     holds(index, known) ? "yes" : "no", number(half_width(index), 5)});
            }
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
    head({"points", "base points", "function", "S, percentile", "S, BCa", "ST, percentile", "ST, BCa",
          "width of BCa over percentile, S; ST"});
    for (const bool sobol : {false, true}) {
        for (const std::size_t base_points : {std::size_t{64}, std::size_t{256}, std::size_t{1024}}) {
            for (const KnownFunction& f : functions()) {
                Coverage coverage[2][2];
                for (std::uint64_t seed = first_seed; seed < first_seed + seeds; ++seed) {
                    for (const Bootstrap kind : {Bootstrap::percentile, Bootstrap::bca}) {
                        const auto indices =
                            sobol ? with_sobol(f, base_points, seed, {.seed = seed, .bootstrap = kind})
                                  : with_independent(f, base_points, seed, {.seed = seed, .bootstrap = kind});
                        Coverage* of_kind = coverage[kind == Bootstrap::bca ? 1 : 0];
                        for (std::size_t i = 0; i < f.factors.size(); ++i) {
                            of_kind[0].add(indices.factors[i].first, f.indices[i].first);
                            of_kind[1].add(indices.factors[i].total, f.indices[i].total);
                        }
                    }
                }
                row({sobol ? "Sobol'" : "independent", fmt::format("{}", base_points), f.name, coverage[0][0].percent(),
                     coverage[1][0].percent(), coverage[0][1].percent(), coverage[1][1].percent(),
                     fmt::format("{:.2f}; {:.2f}", coverage[1][0].width / coverage[0][0].width,
                                 coverage[1][1].width / coverage[0][1].width)});
            }
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
