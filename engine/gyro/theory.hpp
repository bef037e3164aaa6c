#pragma once
#include "engine/gyro/setup.hpp"

/// Closed-form results for a dithered gyro; derivations in docs/physics.md.
namespace ringlock::gyro {

/// Kick of one whole turn to first order, amplitude [rad]: kappa = 2 pi Omega_L / sqrt(K Omega_D w_D).
double turn_kick_rad(const Setup& setup);

/// Variance of a turn's kick at a random phase [rad^2]: 2 Li2(r^2), r^2 = 1 - exp(-kappa^2/4) the square of |z| of the
/// turn's Moebius map (Landau and Zener); kappa^2/2 (1 - kappa^2/16 + ...).
double randomised_kick_variance_rad2(const Setup& setup);

/// Angle random walk with turn phases fully randomised [deg/sqrt(h)], exact; see angle_random_walk_deg_rt_h().
double randomised_arw_deg_rt_h(const Setup& setup);

/// The same to first order in the kick: Omega_L sqrt(K / (2 pi Omega_D)). It is 3 % high at kicks of 1 rad.
double angle_random_walk_deg_rt_h(const Setup& setup);

/// Depth of modulation M = 2 pi Omega_D / (K w_D): amplitude of the dither in optical phase [rad].
double modulation_depth_rad(const Setup& setup);

/// Half-width of the n-th locked band [deg/h] to first order in Omega_L: Omega_L |J_n(M)|.
double band_half_width_deg_h(const Setup& setup, int order);

/// Second-order delay of the phase over half a turn [rad]: (b^2/(2 psi''))(ln(2 sqrt(psi'')/w_D) + (gamma + ln 2)/2).
/// It cancels over a whole cycle but shortens every half cycle: bands have the half-widths Omega_L |J_n(M - delay)|.
double half_turn_delay_rad(const Setup& setup);

/// Centre of the n-th locked band [deg/h]: n K w_D / (2 pi).
double band_centre_deg_h(const Setup& setup, int order);

/// Largest half-width of the dead band over all depths of modulation [deg/h]: Omega_L sqrt(2 / (pi M)).
double band_envelope_deg_h(const Setup& setup);

/// Mean rate without dither (Adler) [deg/h]: sign(rate) sqrt(rate^2 - Omega_L^2), 0 inside the lock band.
double adler_rate_deg_h(double rate_deg_h, double lockin_threshold_deg_h);

/// |alpha| of a whole turn's map (Landau-Zener): exp(pi b^2 / (4 psi'')).
double turn_map_modulus(double b_rad_s, double acceleration_rad_s2);

}  // namespace ringlock::gyro
