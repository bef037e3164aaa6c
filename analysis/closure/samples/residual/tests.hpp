#pragma once
#include <string_view>
#include <vector>

#include "analysis/closure/decide/view.hpp"
#include "analysis/closure/samples/fit/fit.hpp"

namespace ringlock::closure {

/// Stretches of the record whose residual is far larger than usual: 1 for each row in one.
struct Disturbed {
    Rows rows;
    double share = 0.0;
    double worst = 1.0;     ///< largest mean square over the usual one
    double at_s = 0.0;      ///< where
    double length_s = 0.0;  ///< of a stretch
    double p_value = 1.0;   ///< of the worst, if the residual were normal
};
/// \param rows  that are looked at
Disturbed find_disturbed(const SampleFit& fit, const Rows& rows);

/// A residual test of samples and the columns, as series of increments, that it regresses them on.
using SampleView = View<std::vector<double>>;

/// The view of a variance that goes up and down evenly.
inline constexpr std::string_view repeating_variance = "variance and covariance that repeat";

/// The view of a rate that jumps to and fro between two levels.
inline constexpr std::string_view jumping_rate = "a rate that jumps between two levels";

/// The view of a rate that goes with accelerations.
inline constexpr std::string_view followed_witnesses = "rates that follow the witnesses";

/// Holds the innovations that count against everything that the record has: time, frequency, the place in the record
/// modulo small numbers, witnesses, temperature, input rate, their own size. The views refer to the fit.
/// \param lattice_arcsec  steps of the values, which are not normal then
std::vector<SampleView> view_samples(const SampleFit& fit, double lattice_arcsec);

/// The line of the model that keeps amplitude and phase least.
struct UnsteadyLine {
    int step = -1;  ///< of the loop that added it; -1: there is none
    double hz = 0.0;
    double p_value = 1.0;
    double off = 0.0;     ///< power of its changes over that of the line
    double beside = 0.0;  ///< power of another line within beside_hz of it, over its own
};
UnsteadyLine unsteady_line(const SampleFit& fit);

/// The model with the view's regression, the noise fitted anew beside it.
SampleFit fit_beside(const SampleFit& fit, const SampleView& view);

/// Gain of the log-likelihood by that, less the view's cost.
double refitted_merit(const SampleFit& fit, const SampleView& view);

}  // namespace ringlock::closure
