#pragma once
#include <string_view>
#include <vector>

#include "analysis/closure/decide/residual_test.hpp"
#include "analysis/closure/samples/fit/fit.hpp"

namespace ringlock::closure {

/// Stretches of the record whose residual is much larger than usual (outlier stretches): 1 for each row in one.
struct Disturbed {
    Rows rows;
    double share = 0.0;
    double worst = 1.0;     ///< largest mean square over the usual one
    double at_s = 0.0;      ///< time of the largest
    double length_s = 0.0;  ///< of a stretch
    double p_value = 1.0;   ///< of the largest mean square, for a normal residual
};
/// \param rows  rows to be tested
Disturbed find_disturbed(const SampleFit& fit, const Rows& rows);

/// A residual test of samples, with the columns of its regression as series of increments.
using SampleResidualTest = ResidualTestOn<std::vector<double>>;

/// The test of a variance that oscillates.
inline constexpr std::string_view repeating_variance = "variance and covariance that repeat";

/// The test of a rate that jumps between two levels.
inline constexpr std::string_view jumping_rate = "a rate that jumps between two levels";

/// The test of a rate that is proportional to accelerations.
inline constexpr std::string_view followed_witnesses = "rates that follow the witnesses";

/// Tests the innovations that count against all quantities of the record: time, frequency, the place in the record
/// modulo small numbers, witnesses, temperature, input rate, their own size. The tests refer to the fit.
/// \param lattice_arcsec  quantisation of the values, with which they are not normal
std::vector<SampleResidualTest> test_residual(const SampleFit& fit, double lattice_arcsec);

/// The line of the model whose amplitude and phase vary most.
struct UnsteadyLine {
    int step = -1;  ///< step of the loop that added it; -1: there is none
    double hz = 0.0;
    double p_value = 1.0;
    double off = 0.0;       ///< power of its variations relative to that of the line
    double adjacent = 0.0;  ///< power of another line within `adjacent_hz` of it, relative to that of the line
};
UnsteadyLine unsteady_line(const SampleFit& fit);

/// The model with the regression of a residual test, the noise fitted again with it.
SampleFit fit_with_columns(const SampleFit& fit, const SampleResidualTest& test);

/// Gain of the log-likelihood by that regression, less its cost.
double refitted_evidence(const SampleFit& fit, const SampleResidualTest& test);

}  // namespace ringlock::closure
