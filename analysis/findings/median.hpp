#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace ringlock::findings {

/// The upper median; at least one value.
inline double median_of(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// Standard deviation of normal values whose median distance from the middle is that of these; at least one.
inline double normal_deviation(std::vector<double> values, double middle) {
    constexpr double normal = 1.4826;  // standard deviation of a normal distribution over its median distance
    for (double& v : values) v = std::abs(v - middle);
    return normal * median_of(std::move(values));
}

}  // namespace ringlock::findings
