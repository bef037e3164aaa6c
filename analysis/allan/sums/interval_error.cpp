#include "analysis/allan/sums/interval_error.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace ringlock::allan {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Extremes of windows whose length is a power of two.
struct Extremes {
    std::vector<double> highest;
    std::vector<double> lowest;
    std::size_t length = 1;

    explicit Extremes(std::span<const double> x) : highest(x.begin(), x.end()), lowest(x.begin(), x.end()) {
        for (double& v : highest) v = std::isnan(v) ? -infinity : v;
        for (double& v : lowest) v = std::isnan(v) ? infinity : v;
    }

    /// Combines two adjacent windows into one of twice the length. In place: reads are ahead of writes.
    void twice_as_long() {
        const std::size_t there = highest.size() - length;
        for (std::size_t i = 0; i < there; ++i) {
            highest[i] = std::max(highest[i], highest[i + length]);
            lowest[i] = std::min(lowest[i], lowest[i + length]);
        }
        highest.resize(there);
        lowest.resize(there);
        length *= 2;
    }
};

/// The largest spread in windows of `points`, each covered by two of the length at hand.
Largest largest_spread(const Extremes& extremes, std::size_t points, std::size_t windows) {
    const std::size_t apart = points - extremes.length;
    Largest start;
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, windows, 65536), start,
        [&](const tbb::blocked_range<std::size_t>& range, Largest most) {
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                const double spread = std::max(extremes.highest[i], extremes.highest[i + apart]) -
                                      std::min(extremes.lowest[i], extremes.lowest[i + apart]);
                if (spread >= 0.0) ++most.windows;
                most.range = std::max(most.range, spread);
            }
            return most;
        },
        [](const Largest& a, const Largest& b) {
            return Largest{std::max(a.range, b.range), a.windows + b.windows};
        });
}

}  // namespace

std::vector<double> with_line(const Phase& phase) {
    std::vector<double> x(phase.x);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::fma(phase.line_per_sample, static_cast<double>(i), x[i]);
    return x;
}

std::vector<Largest> maximum_interval_errors(std::span<const double> x, std::span<const std::int64_t> m) {
    std::vector<std::size_t> order(m.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return m[a] < m[b]; });
    std::vector<Largest> out(m.size());
    Extremes extremes(x);
    for (const std::size_t k : order) {
        const auto points = static_cast<std::size_t>(m[k]) + 1;
        if (points > x.size()) continue;
        while (2 * extremes.length <= points) extremes.twice_as_long();
        out[k] = largest_spread(extremes, points, x.size() - points + 1);
    }
    return out;
}

}  // namespace ringlock::allan
