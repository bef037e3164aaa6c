#pragma once
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "analysis/closure/types.hpp"

/// Tests of whether innovations are normal, as those of a correct model are.
namespace ringlock::closure {

/// Fourth moments of sums of `shortest` innovations and of longer sums, which are normal if the innovations are. Sums
/// of fewer than `shortest_bounded` may have smaller moments, since noise of even density, for example, is no
/// structure. None if there are too few innovations.
/// \param expected_excess  kurtosis beyond 3 that sums of this number of innovations have by the model; 0 if empty
std::optional<ResidualTest> fourth_moments(const std::vector<double>& innovations, const Rows& rows,
                                           std::size_t shortest, std::size_t shortest_bounded = 1,
                                           const std::function<double(std::size_t)>& expected_excess = {});

/// Whether innovations are beyond doubt flatter than normal ones, as injected noise between bounds is.
bool is_of_even_density(std::span<const double> innovations);
bool is_of_even_density(const std::vector<double>& innovations, const Rows& rows);

/// The step of the rate that explains most of the innovations, where the response to a step soon decays.
struct Jump {
    std::size_t row = 0;
    double chi2 = 0.0;
    double positions = 0.0;  ///< number of places that were tried
    std::size_t length = 0;  ///< rows that contain most of the response to a step
};
/// \param response  response of the filter to a step of the rate in the middle of the record
/// \return none if there are too few places
std::optional<Jump> largest_jump(const std::vector<double>& innovations, const Rows& rows,
                                 const std::vector<double>& response);

/// The test for jumps in the residual of a random rate. A random walk moves by small amounts; a jump is visible as
/// large innovations after it (Harvey and Koopman, J. Business and Economic Statistics 10, 377, 1992).
ResidualTest test_of(const Jump& jump);

}  // namespace ringlock::closure
