#pragma once
#include <span>
#include <vector>

namespace ringlock::allan {

/// What a series of numbers is. It must be said: the same numbers give another deviation for each kind.
enum class Kind {
    phase,      ///< accumulated angle (or time error) at each instant
    increment,  ///< what the phase gained over each interval
    rate        ///< mean rate (or fractional frequency) over each interval
};

/// Phase with a straight line removed, ready for the estimators of allan.hpp.
///
/// \param data    samples in time order, tau0_s apart; all finite
/// \param kind    what they are
/// \param tau0_s  sampling interval [s]; > 0
/// \return phase in the unit of the data (times seconds for rates): n values for phase, n + 1 for increments and rates,
///         beginning with 0 in that case
///
/// Allan deviations look at second differences of phase and are blind to a line, so the line through the two ends
/// (phase) or the mean (increments, rates) is taken out before anything is summed. A counter that runs at 10 MHz keeps
/// its digits: differences are formed with their rounding error and the line with one fused rounding, the running sum
/// is compensated.
std::vector<double> centred_phase(std::span<const double> data, Kind kind, double tau0_s);

}  // namespace ringlock::allan
