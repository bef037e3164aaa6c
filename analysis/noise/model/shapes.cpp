#include "analysis/noise/model/shapes.hpp"

#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::noise {
namespace {

using units::pi;

/// Sum over all integers k of |x + k|^-3, for 0 < x <= 1/2.
double alias_sum_cubes(double x) {
    constexpr int direct = 6;
    double sum = 1.0 / (x * x * x);
    for (int k = 1; k < direct; ++k) {
        sum += std::pow(k + x, -3.0) + std::pow(k - x, -3.0);
    }
    // Euler-Maclaurin for the tails that begin at direct + x and direct - x
    for (const double a : {direct + x, direct - x}) {
        sum += 0.5 / (a * a) + 0.5 / (a * a * a) + 0.25 / (a * a * a * a) - (1.0 / 12.0) * std::pow(a, -6.0);
    }
    return sum;
}

/// Sine integral Si(pi j).
double sine_integral_at(double j) {
    const double k = pi * j;
    if (j < 4.5) {
        double term = k;
        double sum = k;
        for (int i = 1; i < 60; ++i) {
            term *= -k * k / ((2.0 * i) * (2.0 * i + 1.0));
            sum += term / (2.0 * i + 1.0);
        }
        return sum;
    }
    const double sign = std::fmod(j, 2.0) == 0.0 ? 1.0 : -1.0;
    const double k2 = k * k;
    return 0.5 * pi - sign / k * (1.0 - 2.0 / k2 + 24.0 / (k2 * k2));
}

/// Variance of cosine j of a finite piece of flicker over S(f_j): (2/pi) Si(pi j) - (1 - (-1)^j) 2/(pi^2 j).
double flicker_end_correction(double index) {
    if (index > 64.0) return 1.0 - 2.0 / (pi * pi * index);
    const bool odd = std::fmod(index, 2.0) != 0.0;
    return 2.0 / pi * sine_integral_at(index) - (odd ? 4.0 / (pi * pi * index) : 0.0);
}

}  // namespace

Shapes shapes(double x, double index) {
    const double s = std::sin(pi * x);
    const double s2 = s * s;
    Shapes g;
    g[quantisation] = 4.0 * s2;
    g[angle_random_walk] = 1.0;
    g[flicker] = s2 / (2.0 * pi * pi * pi) * alias_sum_cubes(x) * (index > 0.0 ? flicker_end_correction(index) : 1.0);
    g[rate_random_walk] = (3.0 - 2.0 * s2) / (12.0 * s2);
    return g;
}

CorrelatedShape::CorrelatedShape(double log_correlation_time, std::size_t samples)
    : a_(std::exp(-log_correlation_time)),
      sinh_half2_(std::pow(std::sinh(0.5 * a_), 2)),
      sinh_(std::sinh(a_)),
      // sinh a - a loses all digits for small a
      sinh_less_a_(a_ < 0.1 ? a_ * a_ * a_ / 6.0 * (1.0 + a_ * a_ / 20.0 * (1.0 + a_ * a_ / 42.0)) : sinh_ - a_),
      samples_(static_cast<double>(samples)) {}

CorrelatedShape::Value CorrelatedShape::operator()(double sin2) const {
    const double below = sinh_half2_ + sin2;
    const double above = a_ * sinh_half2_ - sin2 * sinh_less_a_;
    const double spectrum = 2.0 * above / (a_ * a_ * below);
    const double share = sinh_half2_ / (a_ * below);
    const double ends = 4.0 * share * share * (1.0 - sin2) / samples_;
    // Derivatives of logarithms by a; those of S and of sinh a - a are sinh(a)/2 and 2 S.
    const double of_above = (sinh_half2_ * (1.0 - 2.0 * sin2) + 0.5 * a_ * sinh_) / above;
    const double of_below = 0.5 * sinh_ / below;
    const double of_share = 0.5 * sinh_ / sinh_half2_ - 1.0 / a_ - of_below;
    const double by_a = spectrum * (of_above - 2.0 / a_ - of_below) - 2.0 * ends * of_share;
    return {spectrum - ends, -a_ * by_a};
}

LogTimes log_times(std::size_t samples) {
    return {std::log(shortest_correlation_samples), std::log(static_cast<double>(samples) / correlations_in_record)};
}

}  // namespace ringlock::noise
