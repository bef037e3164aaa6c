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

/// The unwrapped phase at the turns, as count and quadrature together tell it.
struct JoinedPhase {
    std::vector<double> phase_rad;
    std::vector<std::int64_t> miscounts;  ///< quarters that the counter has been off by since the first turn
    std::vector<std::size_t> miscounted;  ///< turns at which that changed
    double readout_sd_rad = 0.0;          ///< of the detectors over their amplitude, from the scatter of the radius
    std::vector<double> readout = {};     ///< variance of the phase's noise over that; none: 1 at all turns
};

/// Joins count and quadrature of the turns. The quadrature's phase, made round by `ellipse`, is taken on the branch
/// nearest to the middle of the quarter fringe that the counter names; an error of the counter, to within one quarter,
/// does not matter at the boundaries.
///
/// The counter's zero is its own: only how its difference from the quadrature changes is looked at. Where
/// `count_again`, the quarters that the counter has lost or gained are given back, so that nothing is left of them in
/// the phase; otherwise two of them and more become whole fringes.
JoinedPhase join(const record::Turns& turns, const gyro::Ellipse& ellipse, bool count_again);

/// How much further the phase swings than the dither, rotation of the mean half cycle taken off, where the input is
/// that share of its peak rate: the phase turns asin(share) later or sooner than the dither. 1 + share^2/2 and so on.
double swing_over_dither(double share);

/// A turn record prepared for the fit.
struct TurnSeries {
    gyro::Setup setup;  ///< as declared, or standard, with dither frequency and amplitude as measured; no effects
    bool scale_factor_declared = false;
    double start_s = 0.0;        ///< the first zero-rate point, by the record's clock
    std::vector<double> time_s;  ///< of the zero-rate points, since the first
    std::vector<int> direction;
    std::vector<double> swing;  ///< of the half cycle after each turn, over the mean one
    double interval_s = 0.0;
    double amplitude_rad = 0.0;  ///< of the dither: half the mean swing but for what the rotation adds to it
    double acceleration_rad_s2 = 0.0;
    double radius_sd_rad = 0.0;                ///< of the quadrature, over its mean, as of a circle
    std::vector<double> readout;               ///< variance of the phase's noise over the detectors'; none: 1
    std::vector<double> temperature_change_k;  ///< since the first turn; empty where unknown
    double mean_rate_deg_h = 0.0;              ///< of the output, less the input's
    std::vector<double> input_rate_deg_h;      ///< as referenced or declared, zero where neither

    /// Whether minima and maxima come at all phases. A locked gyro stays at a few, where what follows the phase and
    /// what does not look alike.
    bool all_phases_come = true;

    std::size_t size() const { return time_s.size(); }
    /// A rotation over the dither's peak rate, so that the phase stands still asin of it off the dither's turns.
    double relative_rate(double rate_deg_h) const {
        return units::two_pi / setup.scale_factor_arcsec * rate_deg_h * interval_s / (units::pi * amplitude_rad);
    }
    /// What comes so near the dither's frequency is its amplitude: no vibration of the base could do it without moving
    /// the dither as much. Beside what drifts in fewer than three periods.
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
