#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/record/record.hpp"
#include "engine/core/units.hpp"
#include "engine/gyro/setup.hpp"

namespace ringlock::closure {

/// The unwrapped phase at the turns, from count and quadrature together.
struct JoinedPhase {
    std::vector<double> phase_rad;
    std::vector<std::int64_t> miscounts;  ///< quarters by which the counter is off since the first turn
    std::vector<std::size_t> miscounted;  ///< turns at which that changed
    double readout_sd_rad = 0.0;  ///< noise of the detectors over their amplitude, from the scatter of the radius
    /// Variance of the phase's noise over that of the detectors; empty: 1 at all turns
    std::vector<double> readout = {};
};

/// Joins count and quadrature of the turns. The quadrature's phase, with `ellipse` corrected, is taken on the branch
/// nearest to the middle of the quarter fringe that was counted. An error of the counter within one quarter does not
/// matter at the boundaries.
///
/// The counter has a zero of its own, so only changes of its difference from the quadrature are evaluated. With
/// `count_again` the quarters that the counter has lost or gained are corrected, so that the phase does not contain
/// them; otherwise two or more of them become whole fringes.
JoinedPhase join(const record::Turns& turns, const gyro::Ellipse& ellipse, bool count_again);

/// Ratio of the phase's swing, without the rotation of the mean half cycle, to the dither's swing, where the input is
/// that share of the dither's peak rate. The phase turns asin(share) later or earlier than the dither. The ratio is
/// 1 + share^2/2 + ...
double swing_over_dither(double share);

/// A turn record prepared for the fit.
struct TurnSeries {
    gyro::Setup setup;  ///< as declared, or standard, with measured dither frequency and amplitude; without effects
    bool scale_factor_declared = false;
    double start_s = 0.0;        ///< the first zero-rate point, by the record's clock
    std::vector<double> time_s;  ///< of the zero-rate points, since the first
    std::vector<int> direction;
    std::vector<double> swing;  ///< of the half cycle after each turn, over the mean one
    double interval_s = 0.0;
    double amplitude_rad = 0.0;  ///< of the dither: half the mean swing, without the part that the rotation adds
    double acceleration_rad_s2 = 0.0;
    double radius_sd_rad = 0.0;                ///< scatter of the quadrature's radius over its mean, as of a circle
    std::vector<double> readout;               ///< variance of the phase's noise over the detectors'; empty: 1
    std::vector<double> temperature_change_k;  ///< since the first turn; empty where unknown
    double mean_rate_deg_h = 0.0;              ///< rate of the output less that of the input
    std::vector<double> input_rate_deg_h;      ///< reference or declared rate, zero without either

    /// Whether minima and maxima occur at all phases. A locked gyro stays at a few, where functions of the phase cannot
    /// be distinguished from structure that is no function of it.
    bool all_phases_come = true;

    std::size_t size() const { return time_s.size(); }
    /// Rate over the dither's peak rate: the phase stands still at asin of it from the dither's turns.
    double relative_rate(double rate_deg_h) const {
        return units::two_pi / setup.scale_factor_arcsec * rate_deg_h * interval_s / (units::pi * amplitude_rad);
    }
    /// An oscillation this near the dither's frequency is one of its amplitude, since a vibration of the base there
    /// would move the dither as much. The band includes anything of fewer than three periods, which is drift.
    double amplitude_band_hz() const {
        const TurnOptions::Reading& of = options.turns.reading;
        return std::max(of.amplitude_band * 0.5 / interval_s, of.fewest_periods / time_s.back());
    }
    /// Integral of the input rate from the first turn on to each of these times [arcsec], exact between the rows of the
    /// reference. Fastest where each time is near the last.
    std::vector<double> input_angles_arcsec(std::span<const double> times_s) const;

    record::Track input;              ///< the reference, times since the first turn
    std::vector<double> input_angle;  ///< its integral up to each row
};

/// Throws InputError where the record has too few turns, or too little dither, for a fit.
TurnSeries prepare(const record::Record& record, const JoinedPhase& joined);

}  // namespace ringlock::closure
