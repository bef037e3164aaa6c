#include "analysis/stability/dynamic.hpp"

#include <algorithm>
#include <utility>

#include "analysis/allan/sums/phase.hpp"

namespace ringlock::stability {
namespace {

std::vector<std::int64_t> factors_in(allan::Estimator estimator, const Windows& windows, std::size_t points) {
    const auto quarter = static_cast<std::int64_t>(windows.length / 4);
    const std::int64_t largest = allan::largest_factor(estimator, static_cast<std::int64_t>(points));
    return allan::octave_factors(std::min(quarter, largest));
}

}  // namespace

Windows windows_of(std::size_t length, std::size_t intervals, std::size_t most) {
    const std::size_t half = std::max<std::size_t>(1, length / 2);
    const std::size_t free = intervals > length ? intervals - length : 0;
    const std::size_t needed = most > 1 ? (free + most - 2) / (most - 1) : free + 1;
    return {.length = length, .step = std::max(half, needed)};
}

std::vector<WindowDeviation> dynamic_deviation(allan::Estimator estimator, std::span<const double> data,
                                               std::span<const std::int64_t> counts, allan::Kind kind, double tau0_s,
                                               double scale, const Windows& windows, const allan::Options& options) {
    // A window of phase has one value more than intervals.
    const std::size_t values = windows.length + (kind == allan::Kind::phase ? 1 : 0);
    std::vector<WindowDeviation> out;
    for (std::size_t begin = 0; begin + values <= data.size(); begin += windows.step) {
        WindowDeviation window{.begin_s = static_cast<double>(begin) * tau0_s,
                               .end_s = static_cast<double>(begin + windows.length) * tau0_s,
                               .points = {}};
        const std::span<const double> piece = data.subspan(begin, values);
        const allan::Phase phase = counts.empty()
                                       ? allan::phase_of(piece, kind, tau0_s, scale)
                                       : allan::phase_of(counts.subspan(begin, values), piece, kind, tau0_s, scale);
        const std::vector<std::int64_t> factors = factors_in(estimator, windows, phase.x.size());
        if (!factors.empty()) window.points = allan::deviation(estimator, phase, tau0_s, factors, options);
        out.push_back(std::move(window));
    }
    return out;
}

}  // namespace ringlock::stability
