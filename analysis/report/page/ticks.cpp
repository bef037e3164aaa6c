#include "analysis/report/page/ticks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string_view>

namespace ringlock::report {

namespace {

/// Exponent of the power of ten that the value is at least, but for rounding.
int decade_of(double value) { return static_cast<int>(std::floor(std::log10(value) + 1e-12)); }

double power_of_ten(int exponent) { return std::pow(10.0, exponent); }

bool within(AxisRange range, double value, double rounding) {
    return value >= range.lo - rounding && value <= range.hi + rounding;
}

/// Multiples of powers of ten within the range.
std::vector<double> multiples(AxisRange range, const std::vector<double>& factors, int every) {
    std::vector<double> out;
    const int last = decade_of(range.hi);
    for (int exponent = decade_of(range.lo); exponent <= last; ++exponent) {
        if (exponent % every != 0) continue;
        for (const double factor : factors) {
            const double value = factor * power_of_ten(exponent);
            if (within(range, value, 1e-9 * value)) out.push_back(value);
        }
    }
    return out;
}

std::string superscript(int number) {
    constexpr std::array<std::string_view, 10> digits = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
    std::string out;
    for (const char c : fmt::format("{}", number)) out += c == '-' ? "⁻" : digits.at(static_cast<std::size_t>(c - '0'));
    return out;
}

}  // namespace

AxisRange axis_range(const std::vector<double>& values, bool logarithmic) {
    double lo = INFINITY;
    double hi = -INFINITY;
    for (const double value : values) {
        if (!std::isfinite(value) || (logarithmic && value <= 0.0)) continue;
        lo = std::min(lo, value);
        hi = std::max(hi, value);
    }
    if (lo > hi) return logarithmic ? AxisRange{1.0, 10.0} : AxisRange{0.0, 1.0};
    constexpr double margin = 0.04;  // of the range, on either side
    if (logarithmic) {
        // Margins at the ends of doubles would be zero or infinite.
        lo = std::clamp(lo, 1e-300, 1e300);
        hi = std::clamp(hi, lo, 1e300);
        const double factor = hi > lo ? std::pow(hi, margin) / std::pow(lo, margin) : 1.5;
        return {lo / factor, hi * factor};
    }
    const double half = 0.5 * hi - 0.5 * lo;
    const double alone = hi != 0.0 ? std::max(0.1 * std::abs(hi), 1e-300) : 1.0;
    const double pad = half > 0.0 ? std::max(2.0 * margin * half, 1e-300) : alone;
    return {lo - pad, hi + pad};
}

Ticks linear_ticks(AxisRange range, int most, bool whole) {
    Ticks ticks;
    const double span = range.hi - range.lo;
    if (!(span > 0.0) || !std::isfinite(span)) return ticks;
    const double least = span / most;
    double step = power_of_ten(decade_of(least));
    for (const double factor : {1.0, 2.0, 5.0, 10.0}) {
        if (factor * power_of_ten(decade_of(least)) < least) continue;
        step = factor * power_of_ten(decade_of(least));
        break;
    }
    if (whole) step = std::max(1.0, step);
    const double first = std::ceil(range.lo / step - 1e-9);
    for (int i = 0; i <= 2 * most; ++i) {
        const double value = (first + i) * step;
        if (value > range.hi + 1e-9 * step) break;
        ticks.major.push_back(std::abs(value) < 1e-9 * step ? 0.0 : value);
    }
    return ticks;
}

Ticks log_ticks(AxisRange range, int most) {
    const int decades = decade_of(range.hi) - decade_of(range.lo) + 1;
    const int every = std::max(1, (decades + most - 1) / most);
    Ticks ticks{multiples(range, {1.0}, every), {}};
    if (ticks.major.size() < 2) {
        ticks.major = multiples(range, {1.0, 2.0, 5.0}, 1);
        if (ticks.major.size() < 2) return linear_ticks(range, most);
    }
    constexpr int most_decades_with_minor = 9;
    if (decades <= most_decades_with_minor) {
        const std::vector<double> all = multiples(range, {1, 2, 3, 4, 5, 6, 7, 8, 9}, 1);
        std::set_difference(all.begin(), all.end(), ticks.major.begin(), ticks.major.end(),
                            std::back_inserter(ticks.minor));
    }
    return ticks;
}

std::string tick_label(double value) {
    const double size = std::abs(value);
    if (size == 0.0 || (size >= 1e-3 && size < 1e5)) return fmt::format("{:.6g}", value);
    const int exponent = decade_of(size);
    const std::string factor = fmt::format("{:.4g}", value / power_of_ten(exponent));
    const std::string power = "10" + superscript(exponent);
    if (factor == "1") return power;
    return factor == "-1" ? "-" + power : factor + "·" + power;
}

}  // namespace ringlock::report
