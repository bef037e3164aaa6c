#pragma once
#include <array>

#include "engine/compensate/lane_compensator.hpp"
#include "engine/propagate/turn_tables.hpp"

namespace ringlock::compensate {

/// The turn map inverted: the exact lock-in error of a half cycle from the phases measured at its two turns.
///
/// With z and shift of the half turn (docs/dev/turn-map.md), and the phases at the dither's turns at its beginning and
/// end turned upright, x_0 = s psi_0 and x_1 = -s psi_1, a half cycle of sign s gains
///
///     s (2 shift + 2 arg[(1 + z exp(-i x_0)) (1 - z exp(-i x_1))])
///
/// beyond drive and input: no first order, and no knowledge of the phase between the turns. The amplitude, on which z
/// depends, follows from the swing measured between the turns; the input rate from the corrected output over 16 to 32
/// s. Phases are carried from the zero-rate point, where they are read, to the dither's turn by the Taylor series of
/// the equation of motion.
///
/// Behind a noisy drive the amplitude changes over the half cycle, too (docs/noise-injection.md). A swing is the sum of
/// the amplitudes at its two turns, and determines that at the later one where the earlier one is known.
///
/// The rate must be known roughly before the first correction: errors of the first piece of readings of a run are
/// computed with the mean rate over that piece, which ought to hold two minima at least: with a rate of zero the first
/// few corrections of a fast input are wrong by some per cent. How later readings are cut into pieces does not matter.
/// Where the phase's turn lies after the dither's, the half cycle under way is taken to have the mean amplitude, as its
/// swing is not known yet. At the paper's device with injected noise that leaves 1e-5 of the error of a half cycle,
/// 2e-4 at 5000 deg/h, most of which the next half cycle compensates; without noise 5e-7, 3e-5 at 5000 deg/h. Rates
/// that vary within the 128 turns between two estimates of the rate are not known: 1.5e-3 at a vibration of 100 deg/h.
class Exact final : public LaneCompensator {
   public:
    /// `tolerance_rad`: of the tables, for one turn. Throws RunError where a dither has too few fringes for a turn map.
    /// `coupling_share`: half width of the tables in the coupling, for one that set_coupling() moves.
    Exact(const Calibration& calibration, double tolerance_rad, double coupling_share = 0.0);

    /// From the next reading on.
    void set_coupling(std::size_t lane, double b_rad_s, double phase_rad);

    void observe(const readout::LaneReadings& readings, LaneErrors& errors) override;
    /// Rows [first_row, last_row), in this order, all of the same readings into the same errors.
    void observe(const readout::LaneReadings& readings, std::size_t first_row, std::size_t last_row,
                 LaneErrors& errors);
    std::int64_t tables_made() const override { return tables_.made(); }

    struct State {
        simd::Lanes amplitude_rad, b_rad_s;
        simd::Lanes duration_s[2];  ///< of half cycles of positive and negative sign
        simd::Lanes angular_frequency_rad_s[2];
        simd::Lanes scale_s[2], scale_angle;  ///< unit of time of the path near a turn, and its angle of the dither
        simd::Lanes rate_rad_s;               ///< as estimated
        // Of the turn before: sine and cosine of its upright phase at the dither's turn, and that phase.
        simd::Lanes sine, cosine, turn_fringes, turn_whole;
        // Where the amplitude changes over half cycles: that of the dither at that turn, and the input's rate as
        // estimated from the middles between turns.
        simd::Lanes turn_amplitude_rad, middles_rate_rad_s;
        simd::Lanes error_fringes;  ///< at the dither's turn
        simd::Lanes error_whole;
        simd::Lanes coupling_cosine, coupling_sine;  ///< of the coupling phase
        // The last reading and how the dither's turn was reached from it, for a rate or a coupling known better since.
        simd::Lanes read_sine, read_cosine, read_fringes, read_lockin_rad;
        simd::Lanes read_amplitude_rad, read_angular_frequency_rad_s, read_scale_s;
    };

    /// Half turns at the rate and the coupling as known, polynomials in the amplitude and its change: [end at a
    /// minimum, at a maximum].
    using Parts = std::array<propagate::TurnTables::Part, 2>;

   private:
    /// A minimum of the phase and where it was read.
    struct Minimum {
        std::int64_t turn = -1;
        simd::Lanes fringes, whole;
    };

    void see_minima(const readout::LaneReadings& readings, std::size_t first_row, std::size_t last_row,
                    const LaneErrors* errors);
    void estimate_rate();
    void solve(const readout::LaneReadings& readings, std::size_t first, std::size_t last, LaneErrors& errors);
    void count_turns(std::size_t rows);
    void make_tables(std::size_t lane);
    void take_parts();

    Calibration calibration_;
    double coupling_share_;
    propagate::TurnTables tables_;
    Parts parts_;
    State state_;
    bool begun_ = false;
    bool changed_ = false;  ///< rate or coupling, since the last row
    Minimum older_;         ///< the rate is counted from here: one to two baselines ago
    Minimum newer_;         ///< less than one ago
    Minimum latest_;
    std::int64_t turns_ = 0;  ///< seen
    std::int64_t next_estimate_ = 0;
};

}  // namespace ringlock::compensate
