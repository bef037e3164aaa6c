#pragma once
#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <numbers>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "analysis/design/design.hpp"
#include "analysis/design/sensitivity.hpp"

/// Functions whose sensitivity indices are known in closed form.
namespace ringlock::test {

struct KnownIndices {
    double first = 0.0;
    double total = 0.0;
};

struct KnownFunction {
    std::string name;
    std::vector<design::Factor> factors;
    std::function<double(std::span<const double>)> value;
    double mean = 0.0;
    double variance = 0.0;
    std::vector<KnownIndices> indices;
};

/// sin x1 + a sin^2 x2 + b x3^4 sin x1, all x uniform in -pi...pi (Ishigami, Homma, ISUMA 1990).
inline KnownFunction ishigami(double a = 7.0, double b = 0.1) {
    constexpr double pi = std::numbers::pi;
    KnownFunction f;
    f.name = "Ishigami";
    for (const char* key : {"x1", "x2", "x3"}) f.factors.push_back({.key = key, .takes = design::Uniform{-pi, pi}});
    f.value = [a, b](std::span<const double> x) {
        return std::sin(x[0]) + a * std::pow(std::sin(x[1]), 2) + b * std::pow(x[2], 4) * std::sin(x[0]);
    };
    f.mean = 0.5 * a;
    const double v1 = 0.5 * std::pow(1.0 + b * std::pow(pi, 4) / 5.0, 2);
    const double v2 = a * a / 8.0;
    const double v13 = 8.0 * b * b * std::pow(pi, 8) / 225.0;
    const double v = f.variance = v1 + v2 + v13;
    f.indices = {{v1 / v, (v1 + v13) / v}, {v2 / v, v2 / v}, {0.0, v13 / v}};
    return f;
}

/// The product of (|4 x_i - 2| + a_i)/(1 + a_i), all x uniform in 0...1 (Saltelli, Sobol', Reliab. Eng. Syst. Saf. 50,
/// 225, 1995).
inline KnownFunction g_function(const std::vector<double>& a = {0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0}) {
    KnownFunction f;
    f.name = "g-function";
    double product = 1.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        f.factors.push_back({.key = fmt::format("x{}", i + 1), .takes = design::Uniform{0.0, 1.0}});
        product *= 1.0 + 1.0 / (3.0 * std::pow(1.0 + a[i], 2));
    }
    f.value = [a](std::span<const double> x) {
        double y = 1.0;
        for (std::size_t i = 0; i < a.size(); ++i) y *= (std::abs(4.0 * x[i] - 2.0) + a[i]) / (1.0 + a[i]);
        return y;
    };
    f.mean = 1.0;
    f.variance = product - 1.0;
    for (const double ai : a) {
        const double vi = 1.0 / (3.0 * std::pow(1.0 + ai, 2));
        f.indices.push_back({vi / f.variance, vi * (product / (1.0 + vi)) / f.variance});
    }
    return f;
}

/// The layout of sensitivity_points() with points A and B that are independent.
inline design::Points independent_sensitivity_points(std::size_t base_points, std::size_t factors, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const auto uniform = [&] { return (static_cast<double>(random() >> 12) + 0.5) * 0x1p-52; };
    design::Points points = design::room_for(base_points * (factors + 2), factors, UINT64_MAX);
    for (std::size_t base = 0; base < base_points; ++base) {
        for (std::size_t i = 0; i < factors; ++i) {
            const double a = uniform();
            const double b = uniform();
            for (std::size_t j = 0; j < factors + 2; ++j) {
                points[base * (factors + 2) + j][i] = j == 1 || j == i + 2 ? b : a;
            }
        }
    }
    return points;
}

inline std::vector<double> evaluate(const KnownFunction& f, const design::Points& unit) {
    const design::Points points = design::at_quantiles(unit, f.factors);
    std::vector<double> values(points.count);
    for (std::size_t i = 0; i < points.count; ++i) values[i] = f.value(points[i]);
    return values;
}

/// Indices of the values of one output.
inline design::OutputIndices indices_of_values(std::span<const double> values, std::size_t factors,
                                               const design::SensitivityOptions& options = {}) {
    return design::sensitivity_indices(
               {.base_points = values.size() / (factors + 2), .factors = factors, .outputs = 1, .values = values},
               options)
        .front();
}

}  // namespace ringlock::test
