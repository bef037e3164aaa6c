#pragma once
#include <optional>

#include "engine/compensate/lane_compensator.hpp"
#include "engine/propagate/turn_tables.hpp"

namespace ringlock::compensate {

/// The turn map inverted: the exact lock-in error of a half cycle from the phases measured at its two turns.
///
/// With z and shift of the half turn (docs/turn-map.md), and the phases at the dither's turns at its beginning and end
/// turned upright, x_0 = s psi_0 and x_1 = -s psi_1, a half cycle of sign s gains
///
///     s (2 shift + 2 arg[(1 + z exp(-i x_0)) (1 - z exp(-i x_1))])
///
/// beyond drive and input: no first order, no knowledge of what lies between. The amplitude, on which z depends,
/// follows from the swing measured between the turns; the input rate from the corrected output over half a minute to a
/// minute. Phases are carried from the zero-rate point, where they are read, to the dither's turn by the Taylor series
/// of the equation of motion.
///
/// The rate must be known roughly before the first correction: errors of the first piece of readings of a run are
/// computed with the mean rate over that piece. Where the phase's turn lies after the dither's, the half cycle under
/// way is taken to have the mean amplitude, as its swing is not known yet.
class Exact final : public LaneCompensator {
   public:
    /// `tolerance_rad`: of the tables, for one turn. Throws RunError where a dither has too few fringes for a turn map.
    Exact(const Calibration& calibration, double tolerance_rad);

    void observe(const readout::LaneReadings& readings, LaneErrors& errors) override;

    struct State {
        simd::Lanes amplitude_rad, b_rad_s;
        simd::Lanes duration_s[2];  ///< of half cycles of positive and negative sign
        simd::Lanes angular_frequency_rad_s[2];
        simd::Lanes scale_s[2], scale_angle;  ///< unit of time of the path near a turn, and its angle of the dither
        simd::Lanes rate_rad_s;               ///< as estimated
        // Of the turn before: sine and cosine of its upright phase at the dither's turn, that phase, and the amplitude
        // of the half cycle that ended there.
        simd::Lanes sine, cosine, turn_fringes, turn_whole, last_amplitude_rad;
        simd::Lanes error_fringes;  ///< at the dither's turn
        simd::Lanes error_whole;
    };

   private:
    /// A minimum that the mean rate is counted from.
    struct Mark {
        std::int64_t turn = 0;
        double fringes = 0.0;
        double whole = 0.0;
    };

    void estimate_rate(const readout::LaneReadings& readings, const LaneErrors* errors);
    void make_tables(std::size_t lane);

    Calibration calibration_;
    propagate::TurnTables tables_;
    State state_;
    bool begun_ = false;
    std::array<std::array<Mark, 2>, simd::lanes> marks_{};  ///< one to two baselines ago, and less than one
};

}  // namespace ringlock::compensate
