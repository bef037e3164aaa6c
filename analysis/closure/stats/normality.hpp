#pragma once
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "analysis/closure/types.hpp"

/// Whether innovations are normal, as those of every model here are.
namespace ringlock::closure {

/// Fourth moments of sums of `shortest` innovations and of longer ones: what is normal stays so. Sums of fewer than
/// `shortest_bounded` may have less: a noise of even density, say, which is no structure.
/// `expected_excess`: kurtosis beyond 3 that sums of so many have by the model; 0 where it is empty. None where there
/// are too few.
std::optional<ResidualTest> fourth_moments(const std::vector<double>& innovations, const Rows& rows,
                                           std::size_t shortest, std::size_t shortest_bounded = 1,
                                           const std::function<double(std::size_t)>& expected_excess = {});

/// Whether they are, beyond doubt, flatter than normal ones, as injected noise between bounds is.
bool is_of_even_density(std::span<const double> innovations);
bool is_of_even_density(const std::vector<double>& innovations, const Rows& rows);

/// The step of the rate that innovations show most of, where a step is forgotten soon.
struct Jump {
    std::size_t row = 0;
    double chi2 = 0.0;
    double places = 0.0;     ///< that were looked at
    std::size_t length = 0;  ///< rows in which most of a step shows
};
/// `response`: what the filter makes of a step of the rate in the middle of the record. None where there are too few
/// places.
std::optional<Jump> largest_jump(const std::vector<double>& innovations, const Rows& rows,
                                 const std::vector<double>& response);

/// A rate that wanders moves by little at a time; jumps betray themselves by the size of what follows them (Harvey and
/// Koopman, J. Business and Economic Statistics 10, 377, 1992).
ResidualTest test_of(const Jump& jump);

}  // namespace ringlock::closure
