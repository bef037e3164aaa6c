#include "analysis/lot/mean.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <iterator>
#include <vector>

namespace ringlock::lot {
namespace {

/// Mean and standard deviation of finite values. A power of two keeps squares and sums from overflowing and rounds
/// nothing; differences to the first value make equal values have exactly their mean and no scatter.
void set_moments(Mean& m, const std::vector<double>& x) {
    if (x.empty()) return;
    double largest = 0.0;
    for (const double v : x) largest = std::max(largest, std::abs(v));
    const int exponent = largest > 0.0 ? std::ilogb(largest) : 0;
    const double first = std::ldexp(x.front(), -exponent);
    const auto n = static_cast<double>(x.size());
    double sum = 0.0;
    for (const double v : x) sum += std::ldexp(v, -exponent) - first;
    const double shift = sum / n;
    m.value = std::ldexp(first + shift, exponent);
    if (x.size() < 2) return;
    double squares = 0.0;
    for (const double v : x) {
        const double d = std::ldexp(v, -exponent) - first - shift;
        squares += d * d;
    }
    m.standard_deviation = std::ldexp(std::sqrt(squares / (n - 1.0)), exponent);
}

}  // namespace

Mean mean(std::span<const double> values, const Confidence& confidence) {
    check(confidence);
    std::vector<double> finite;
    finite.reserve(values.size());
    std::ranges::copy_if(values, std::back_inserter(finite), [](double v) { return std::isfinite(v); });
    Mean m;
    m.n = static_cast<std::int64_t>(finite.size());
    m.left_out = static_cast<std::int64_t>(values.size() - finite.size());
    set_moments(m, finite);
    if (m.n < 2) return m;
    const boost::math::students_t_distribution<double> t(static_cast<double>(m.n - 1));
    const double upper = boost::math::quantile(boost::math::complement(t, 0.5 * (1.0 - confidence.level)));
    m.half_width = upper * widening(confidence, m.n) * (*m.standard_deviation / std::sqrt(static_cast<double>(m.n)));
    m.interval = {*m.value - *m.half_width, *m.value + *m.half_width};
    return m;
}

GeometricMean geometric_mean(std::span<const double> values, const Confidence& confidence) {
    std::vector<double> logs;
    logs.reserve(values.size());
    for (const double v : values) {
        if (std::isfinite(v) && v > 0.0) logs.push_back(std::log(v));
    }
    const Mean of_logs = mean(logs, confidence);
    GeometricMean g;
    g.n = of_logs.n;
    g.left_out = static_cast<std::int64_t>(values.size()) - g.n;
    g.log_standard_deviation = of_logs.standard_deviation;
    if (of_logs.value) g.value = std::exp(*of_logs.value);
    if (of_logs.interval) {
        g.interval = {std::exp(of_logs.interval->lo), std::exp(of_logs.interval->hi)};
        g.relative_half_width = std::expm1(*of_logs.half_width);
    }
    return g;
}

}  // namespace ringlock::lot
