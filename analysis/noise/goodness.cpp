#include "analysis/noise/goodness.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <vector>

namespace ringlock::noise {
namespace {

/// Chance that the Kolmogorov statistic sqrt(n) D exceeds t.
double kolmogorov_tail(double t) {
    if (t < 0.2) return 1.0;
    double sum = 0.0;
    for (int k = 1; k < 100; ++k) {
        const double term = std::exp(-2.0 * k * k * t * t);
        sum += k % 2 == 1 ? term : -term;
        if (term < 1e-18) break;
    }
    return std::clamp(2.0 * sum, 0.0, 1.0);
}

/// Upper tail of the squares next to a line: whether the supposed line is broad.
double broadness(std::span<const double> w, const Line& line) {
    constexpr std::ptrdiff_t half_width = 12;
    const auto middle = static_cast<std::ptrdiff_t>(std::llround(line.index));
    const std::ptrdiff_t begin = std::max<std::ptrdiff_t>(1, middle - half_width);
    const std::ptrdiff_t end = std::min(static_cast<std::ptrdiff_t>(w.size()), middle + half_width);
    double sum = 0.0;
    for (std::ptrdiff_t j = begin; j <= end; ++j) sum += w[static_cast<std::size_t>(j - 1)];
    const auto degrees = static_cast<double>(end - begin + 1 - 3);  // less what the line has taken
    return boost::math::cdf(boost::math::complement(boost::math::chi_squared(degrees), std::min(sum, 1e6)));
}

}  // namespace

Goodness goodness_of_fit(const Spectrum& spectrum, const Maximum& best, std::span<const Line> lines, double tau0_s,
                         double threshold) {
    const std::size_t n = spectrum.z.size();
    std::vector<double> w = residual(spectrum, best);
    const std::vector<double> variance = coefficient_variances(spectrum, best);
    double total = 0.0;
    for (std::size_t j = 1; j <= n; ++j) {
        w[j - 1] *= w[j - 1] / variance[j - 1];
        total += w[j - 1];
    }
    const auto frequency = [&](std::size_t j) { return spectrum.x(j) / tau0_s; };
    const auto count = static_cast<double>(n);
    Goodness out;

    double sum = 0.0;
    double distance = 0.0;
    std::size_t farthest = 1;
    std::size_t largest = 1;
    for (std::size_t j = 1; j <= n; ++j) {
        sum += w[j - 1];
        const double d = std::abs(sum / total - static_cast<double>(j) / count);
        if (d > distance) {
            distance = d;
            farthest = j;
        }
        if (w[j - 1] > w[largest - 1]) largest = j;
    }
    // Squares of normal deviates have variance 2: the bridge is sqrt(2) wider than that of uniform order statistics.
    out.p_cumulative = kolmogorov_tail(distance * std::sqrt(0.5 * count));

    const double one = std::erfc(std::sqrt(0.5 * w[largest - 1]));
    out.p_line = -std::expm1(count * std::log1p(-std::min(one, 1.0 - 1e-16)));

    double chi2 = 0.0;
    double bands = 0.0;
    double worst = 0.0;
    std::size_t worst_band = 1;
    for (std::size_t begin = 1; begin <= n;) {
        std::size_t end = std::max(begin + 15, begin + begin / 4);
        if (n < end + 16) end = n;
        double s = 0.0;
        for (std::size_t j = begin; j <= end; ++j) s += w[j - 1];
        const auto k = static_cast<double>(end - begin + 1);
        const double deviate = (std::cbrt(s / k) - (1.0 - 2.0 / (9.0 * k))) / std::sqrt(2.0 / (9.0 * k));
        chi2 += deviate * deviate;
        bands += 1.0;
        if (std::abs(deviate) > worst) {
            worst = std::abs(deviate);
            worst_band = (begin + end) / 2;
        }
        begin = end + 1;
    }
    out.p_bands = boost::math::cdf(boost::math::complement(boost::math::chi_squared(bands), std::min(chi2, 1e6)));

    const Line* broadest = nullptr;
    for (const Line& line : lines) {
        const double p = std::min(1.0, static_cast<double>(lines.size()) * broadness(w, line));
        if (p < out.p_around_lines) {
            out.p_around_lines = p;
            broadest = &line;
        }
    }

    if (out.p_around_lines < threshold) {
        out.reason =
            fmt::format("a peak at {:.4g} Hz that is broader than a line (p = {:.1e})",
                        0.5 * broadest->index / (static_cast<double>(spectrum.samples) * tau0_s), out.p_around_lines);
    } else if (out.p_line < threshold) {
        out.reason = fmt::format("a spectral line at {:.4g} Hz (p = {:.1e})", frequency(largest), out.p_line);
    } else if (out.p_bands < threshold) {
        out.reason = fmt::format("the spectrum departs from the model, most near {:.3g} Hz (p = {:.1e})",
                                 frequency(worst_band), out.p_bands);
    } else if (out.p_cumulative < threshold) {
        out.reason = fmt::format("the cumulative spectrum departs from the model, most at {:.3g} Hz (p = {:.1e})",
                                 frequency(farthest), out.p_cumulative);
    }
    out.accepted = out.reason.empty();
    return out;
}

}  // namespace ringlock::noise
