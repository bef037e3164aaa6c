#pragma once
#include <cstdint>
#include <span>

#include "engine/readout/lane_readings.hpp"
#include "engine/readout/pulse_tables.hpp"
#include "engine/readout/readout_constants.hpp"

namespace ringlock::readout {

/// The phase at the zero-rate point from all that the hardware has of a turn: the sampled detectors and the nearest
/// pulses on either side (Gao & Deng 2007, equations 14 and 15, which use one pulse on one side).
///
/// Near the extremum psi_0 at t_0 the phase, turned upright, is psi_0 + (t - t_0)^2 a/(2 R^2), with R as in PulseTables
/// for the coupling that the electronics have been told. A pulse at time t from the instant of sampling whose
/// comparator switches D from the sampled phase therefore says, with e = psi_0 - sampled + a tau^2/2, tau = t_0,
///
///     a t^2/(2 R^2) - D = -e + (a t/R^2) tau + noise,
///
/// and the sample itself says 0 = e + noise. e and tau are fitted by least squares, each with the variance of its
/// noise: comparator, clock (a tick's share at the phase's rate there), and, after the turn, the amplitude that is not
/// known yet. The lock-in bends the two sides in opposite ways, so that an error of the coupling goes into tau; what it
/// leaves in psi_0 is of second order in the coupling.
class FractionRecovery {
   public:
    /// \param devices           as the electronics know them: amplitude, durations, coupling
    /// \param electronics       not ideal ones
    /// \param amplitude_rms_rad spread of the half cycles' amplitudes about the device's
    FractionRecovery(std::span<const gyro::Device> devices, const Electronics& electronics, double amplitude_rms_rad);

    /// Improves phase_fringes, sine and cosine (of unit size afterwards) of consecutive readings with pulses, and the
    /// angle output where that is interpolated.
    void recover(LaneReadings& readings, LaneAngles& angles);

    /// Turns at which pulses and detectors contradicted each other, so that the detectors' phase was kept.
    std::int64_t contradictions(std::size_t lane) const {
        return static_cast<std::int64_t>(state_.contradictions[lane]);
    }

    struct State {
        simd::Lanes last_fringes{}, last_whole{};  ///< phase at the turn before
        simd::Lanes last_gain{};                   ///< of the half cycle before [fringes]
        simd::Lanes cycle_gain{};                  ///< mean over cycles [fringes]
        simd::Lanes cycles{};
        simd::Lanes contradictions{};
        std::int64_t turns = 0;
    };
    struct Known {
        simd::Lanes amplitude_rad, b_rad_s;
        simd::Lanes half_share[2];           ///< of the half cycles of positive and negative sign in the period
        simd::Lanes w2_per_amplitude[2][2];  ///< acceleration over amplitude, [minimum, maximum][before, after]
        simd::Lanes w2[2];
        simd::Lanes amplitude_relative;
    };

   private:
    std::size_t lanes_;
    Electronics electronics_;
    Known known_;
    PulseTables tables_;
    State state_;
};

}  // namespace ringlock::readout
