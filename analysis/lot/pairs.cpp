#include "analysis/lot/pairs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "analysis/lot/mean.hpp"
#include "engine/core/error.hpp"

namespace ringlock::lot {
namespace {

/// Relative: each value was rounded at least once, their quotient or difference again.
constexpr double rounding_of_pair = 4.0 * std::numeric_limits<double>::epsilon();

void check_lengths(std::span<const double> a, std::span<const double> b) {
    if (a.size() != b.size()) {
        throw InputError(fmt::format(
            "arms of {} and {} gyros cannot be compared in pairs: give one value a gyro in both, NaN for none",
            a.size(), b.size()));
    }
}

bool can_have_logarithm(double v) { return std::isfinite(v) && v > 0.0; }

/// log(a/b), which keeps the last digits where a and b are nearly equal.
double log_ratio(double a, double b) {
    const double quotient = a / b;
    return std::isnormal(quotient) ? std::log(quotient) : std::log(a) - std::log(b);
}

/// The mean of those that make a pair.
PairedFigure of_mean(const Mean& m, std::size_t gyros, double rounding) {
    PairedFigure f;
    f.value = m.value;
    f.interval = m.interval;
    f.distinguishable = m.interval && !m.interval->holds(0.0) && std::abs(*m.value) > rounding;
    f.pairs = m.n;
    f.left_out = static_cast<std::int64_t>(gyros) - m.n;
    return f;
}

Comparison reversed(const Comparison& c) {
    Comparison r = c;
    if (c.ratio.value) r.ratio.value = 1.0 / *c.ratio.value;
    if (c.ratio.interval) r.ratio.interval = {1.0 / c.ratio.interval->hi, 1.0 / c.ratio.interval->lo};
    if (c.difference.value) r.difference.value = -*c.difference.value;
    if (c.difference.interval) r.difference.interval = {-c.difference.interval->hi, -c.difference.interval->lo};
    return r;
}

}  // namespace

PairedFigure paired_ratio(std::span<const double> a, std::span<const double> b, const Confidence& confidence) {
    check_lengths(a, b);
    std::vector<double> logs;
    logs.reserve(a.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
        if (can_have_logarithm(a[i]) && can_have_logarithm(b[i])) logs.push_back(log_ratio(a[i], b[i]));
    }
    PairedFigure f = of_mean(mean(logs, confidence), a.size(), rounding_of_pair);
    if (f.value) f.value = std::exp(*f.value);
    if (f.interval) f.interval = {std::exp(f.interval->lo), std::exp(f.interval->hi)};
    return f;
}

PairedFigure paired_difference(std::span<const double> a, std::span<const double> b, const Confidence& confidence) {
    check_lengths(a, b);
    std::vector<double> differences;
    differences.reserve(a.size());
    double largest = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const double difference = a[i] - b[i];
        if (!std::isfinite(difference)) continue;
        differences.push_back(difference);
        largest = std::max({largest, std::abs(a[i]), std::abs(b[i])});
    }
    return of_mean(mean(differences, confidence), a.size(), rounding_of_pair * largest);
}

Comparison compare(std::span<const double> a, std::span<const double> b, const Confidence& confidence) {
    check_lengths(a, b);
    std::vector<double> x;
    std::vector<double> y;
    for (std::size_t i = 0; i < a.size(); ++i) {
        if (!can_have_logarithm(a[i]) || !can_have_logarithm(b[i])) continue;
        x.push_back(a[i]);
        y.push_back(b[i]);
    }
    Comparison c{paired_ratio(x, y, confidence), paired_difference(x, y, confidence)};
    c.ratio.left_out = static_cast<std::int64_t>(a.size()) - c.ratio.pairs;
    c.difference.left_out = static_cast<std::int64_t>(a.size()) - c.difference.pairs;
    return c;
}

ComparisonMatrix::ComparisonMatrix(std::span<const std::vector<double>> arms, const Confidence& confidence)
    : arms_(arms.size()), cells_(arms.size() * arms.size()) {
    for (std::size_t a = 0; a < arms_; ++a) {
        cells_[a * arms_ + a] = compare(arms[a], arms[a], confidence);
        for (std::size_t b = a + 1; b < arms_; ++b) {
            cells_[a * arms_ + b] = compare(arms[a], arms[b], confidence);
            cells_[b * arms_ + a] = reversed(cells_[a * arms_ + b]);
        }
    }
}

const Comparison& ComparisonMatrix::at(std::size_t a, std::size_t b) const {
    if (a >= arms_ || b >= arms_) {
        throw InputError(fmt::format("arms {} and {} of a comparison of {}: count from 0", a, b, arms_));
    }
    return cells_[a * arms_ + b];
}

}  // namespace ringlock::lot
