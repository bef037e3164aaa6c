#pragma once
#include "engine/gyro/setup.hpp"
#include "engine/readout/electronics.hpp"

/// Lower bound of the error of any estimator of the phase at a zero-rate point (docs/dev/compensation.md).
namespace ringlock::readout {

/// Knowledge about a turn in addition to the readings.
struct BoundedTurn {
    double acceleration_rad_s2 = 0.0;  ///< psi''
    /// Standard deviation of the acceleration after the turn over itself, as known when the turn is read; 0: known. On
    /// the side before it is known from the swing that ends there.
    double acceleration_rms_relative = 0.0;
    bool pulses = true;  ///< false: from the sampled detectors alone
};

/// Cramer-Rao bound [rad^2] of the phase psi_0 at the zero-rate point of one turn, from the two samples and the pulses
/// that are kept on either side; the instant of the zero-rate point is not known.
///
/// The sampled phase has the variance v_0 = sigma_d^2 + step^2/12. A pulse at the distance D from the extremum says
/// psi_0 + (t - t_0)^2 psi''/2 with the variance v = sigma_c^2 + (psi' tick)^2/12, psi'^2 = 2 D psi''; hysteresis makes
/// D less before the turn and more after it, and a comparator that it keeps from switching gives no pulse. All errors
/// count as normal. 0 where an error is.
///
/// \param first_distance_rad  from the extremum to the next quarter fringe
double phase_variance_bound_rad2(const Electronics& electronics, const BoundedTurn& turn, double first_distance_rad);

/// Root of its mean over all phases [rad].
double phase_bound_rad(const Electronics& electronics, const BoundedTurn& turn);

/// Angle random walk [deg/sqrt(h)] that errors of that rms leave where turns are fully randomised: a kick of
/// kappa sin(psi_0 +- pi/4) is computed wrong by kappa cos(psi_0 +- pi/4) times the error, and over the four quarter
/// fringes, in which the error's variance is the same, the square of that cosine has the mean 1/2. The walk is the
/// error's share of the uncorrected one.
double walk_left_deg_rt_h(const gyro::Setup& setup, double phase_rms_rad);

}  // namespace ringlock::readout
