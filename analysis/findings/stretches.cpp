#include "analysis/findings/stretches.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/findings/median.hpp"

namespace ringlock::findings {
namespace {

constexpr std::size_t most_stretches = 5;

/// Sums of squares from the start, and the variance of a square over that of a normal one's.
struct Squares {
    std::vector<double> before;  ///< before[i]: of the first i
    double mean = 1.0;
    double spread = 1.0;

    double of(std::size_t from, std::size_t to) const { return before[to] - before[from]; }
};

Squares squares_of(const std::vector<double>& white, const std::vector<char>& taken) {
    Squares out;
    out.before.assign(white.size() + 1, 0.0);
    double count = 0.0;
    double fourth = 0.0;
    for (std::size_t i = 0; i < white.size(); ++i) {
        const double square = taken[i] ? 0.0 : white[i] * white[i];
        out.before[i + 1] = out.before[i] + square;
        fourth += square * square;
        count += taken[i] ? 0.0 : 1.0;
    }
    if (count == 0.0 || !(out.before.back() > 0.0)) return out;
    out.mean = out.before.back() / count;
    out.spread = std::max(1.0, 0.5 * (fourth / count / (out.mean * out.mean) - 1.0));
    return out;
}

/// Normal deviate of a mean square over m data (E. Wilson and M. Hilferty, Proc. Nat. Acad. Sci. 17 (1931) 684), whose
/// degrees of freedom the spread of squares makes fewer.
double deviate(double ratio, double m, double spread) {
    const double degrees = m / spread;
    const double part = 2.0 / (9.0 * degrees);
    return (std::cbrt(ratio) - (1.0 - part)) / std::sqrt(part);
}

}  // namespace

std::vector<Finding> disturbed_stretches(const std::vector<double>& white, const SearchOptions& options) {
    constexpr std::size_t fewest_windows = 8;
    constexpr double median_sd = 2.33;  // of the median of m squares of normal deviates, over it, times sqrt(m)
    const std::size_t length = std::max(options.disturbed_window, white.size() / options.disturbed_windows);
    const std::size_t windows = white.size() / length;
    if (windows < fewest_windows) return {};
    std::vector<double> medians;
    for (std::size_t w = 0; w < windows; ++w) {
        std::vector<double> squares;
        for (std::size_t i = w * length; i < (w + 1) * length; ++i) squares.push_back(white[i] * white[i]);
        medians.push_back(median_of(std::move(squares)));
    }
    const double usual = median_of(medians);
    std::vector<Finding> found;
    for (std::size_t w = 0; w < windows; ++w) {
        const double ratio = medians[w] / usual;
        if (!(ratio > options.disturbed_ratio)) continue;
        const double sigma = (ratio - 1.0) * std::sqrt(static_cast<double>(length)) / median_sd;
        if (!found.empty() && found.back().row + found.back().length == w * length) {
            found.back().length += length;
            found.back().size = std::max(found.back().size, ratio);
            found.back().size_sigma = std::max(found.back().size_sigma, sigma);
        } else {
            found.push_back({Kind::variance, w * length, length, ratio, sigma});
        }
    }
    return found;
}

std::vector<Finding> stretches_of_other_variance(const std::vector<double>& white, const SearchOptions& options) {
    const std::size_t n = white.size();
    std::vector<char> taken(n, 0);
    std::vector<Finding> found;
    double windows = 0.0;
    for (std::size_t length = options.shortest_stretch; 2 * length <= n; length *= 2) {
        windows += 2.0 * static_cast<double>(n / length);
    }
    while (found.size() < most_stretches) {
        const Squares squares = squares_of(white, taken);
        Finding best{.kind = Kind::variance};
        for (std::size_t length = options.shortest_stretch; 2 * length <= n; length *= 2) {
            for (std::size_t from = 0; from + length <= n; from += length / 2) {
                if (taken[from] || taken[from + length - 1] || taken[from + length / 2]) continue;
                const auto m = static_cast<double>(length);
                const double ratio = squares.of(from, from + length) / m / squares.mean;
                if (ratio < options.least_ratio && ratio > 1.0 / options.least_ratio) continue;
                const double sigma = std::abs(deviate(ratio, m, squares.spread));
                if (sigma > best.size_sigma) best = {Kind::variance, from, length, ratio, sigma};
            }
        }
        if (best.size_sigma == 0.0) break;
        if (std::erfc(best.size_sigma / std::sqrt(2.0)) * windows > options.variance_level) break;
        std::fill_n(taken.begin() + static_cast<std::ptrdiff_t>(best.row), best.length, 1);
        found.push_back(best);
    }
    return found;
}

}  // namespace ringlock::findings
