#include "analysis/findings/clipping.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include "analysis/findings/median.hpp"
#include "engine/core/units.hpp"

namespace ringlock::findings {
namespace {

/// Median of the data and the standard deviation of normal data of the same median deviation.
struct Middle {
    double value = 0.0;
    double deviation = 0.0;
    std::size_t count = 0;
};

Middle middle_of(std::span<const double> values) {
    std::vector<double> present;
    std::copy_if(values.begin(), values.end(), std::back_inserter(present), [](double v) { return !std::isnan(v); });
    Middle out;
    out.count = present.size();
    if (present.empty()) return out;
    out.value = median_of(present);
    out.deviation = normal_deviation(std::move(present), out.value);
    return out;
}

}  // namespace

double share_clipped_off(double limit) {
    // For X normal and Y = min(X, limit): E Y = -density + limit P(X > limit), and so on.
    const double density = std::exp(-0.5 * limit * limit) / std::sqrt(units::two_pi);
    const double above = 0.5 * std::erfc(limit / std::sqrt(2.0));
    const double mean = limit * above - density;
    const double square = 1.0 - above - limit * density + limit * limit * above;
    return 1.0 - (square - mean * mean);
}

std::string why_clipping_withholds(std::span<const Finding> found, allan::Kind kind, std::span<const double> values) {
    constexpr double of_error = 0.25;
    std::size_t clipped = 0;
    double hidden = 0.0;
    Middle middle;
    for (const Finding& f : found) {
        if (f.kind != Kind::clipped) continue;
        const auto there = static_cast<std::size_t>(std::count(values.begin(), values.end(), f.size));
        if (2 * there < f.length) continue;  // most of them repeat a value and are left out
        if (clipped == 0) middle = middle_of(values);
        clipped += there;
        // Where half of the data are at one end there is no deviation to compare it with.
        hidden += middle.deviation > 0.0 ? share_clipped_off(std::abs(f.size - middle.value) / middle.deviation) : 1.0;
    }
    hidden = std::min(1.0, hidden);
    if (clipped == 0) return "";
    if (kind == allan::Kind::phase) return fmt::format("{} data lie at the ends of their range", clipped);
    // A coefficient grows as the root of its variance.
    const double error = 1.0 / std::sqrt(2.0 * static_cast<double>(middle.count));
    if (0.5 * hidden <= of_error * error) return "";
    return fmt::format("{} data lie at the ends of their range, which hides about {:.3g} % of the variance", clipped,
                       100.0 * hidden);
}

}  // namespace ringlock::findings
