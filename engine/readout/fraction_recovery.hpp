#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "engine/readout/lane_readings.hpp"
#include "engine/readout/pulse_tables.hpp"
#include "engine/readout/readout_constants.hpp"

namespace ringlock::readout {

/// The phase at the zero-rate point from all data of a turn that the hardware has: the sampled detectors and the
/// nearest pulses on either side (Gao & Deng 2007, equations 14 and 15, which use one pulse on one side).
///
/// Near the extremum psi_0 at t_0 the phase, turned upright, is psi_0 + (t - t_0)^2 a/(2 R^2), with R as in PulseTables
/// for the coupling that has been set in the electronics. A pulse at time t from the instant of sampling whose
/// comparator switches D from the sampled phase therefore says, with e = psi_0 - sampled + a tau^2/2, tau = t_0,
///
///     a t^2/(2 R^2) - D = -e + (a t/R^2) tau + noise,
///
/// and the sample itself says 0 = e + noise. e and tau are fitted by least squares, each with the variance of its
/// noise: comparator and clock (a tick's share at the phase's rate there). After the turn injected noise gives the half
/// cycle an amplitude that is not known yet: a is wrong by a share, the same at all pulses there, which adds that share
/// of D to each. It is a third unknown, whose variance is known beforehand.
/// Behind a noisy drive the amplitude is the same on both sides of the turn and grows over either half cycle
/// (docs/noise-injection.md): the swings of successive half cycles determine the amplitude at the turn and its change
/// before, which takes c (w t)^3/(3 pi) off the distance to a pulse; the change c after the turn is the third unknown
/// then. The sides meet at the dither's turn, not at the zero-rate point: at a rate r there, lock-in and input, the
/// parabola of a side has its vertex r/a before it, so that the side after has its own by (r/a)(1 - a/a') later than
/// the side before, a' being its acceleration. At asymmetries of 1e-3 that is 2e-10 s. The lock-in bends the two sides
/// in opposite ways, so that an error of the coupling goes into tau; the remaining error of psi_0 is of second order in
/// the coupling.
class FractionRecovery {
   public:
    /// \param devices           as the electronics know them: amplitude, durations, coupling
    /// \param electronics       not ideal ones
    /// \param amplitude_rms_rad spread of the half cycles' amplitudes about the device's
    /// \param change_rms_rad    rms of an amplitude's change over a half cycle; 0: half cycles are cosines
    FractionRecovery(std::span<const gyro::Device> devices, const Electronics& electronics, double amplitude_rms_rad,
                     double change_rms_rad = 0.0);

    /// Improves phase_fringes, sine and cosine (of unit size afterwards) of consecutive readings with pulses, and,
    /// where given and interpolated, the angle output.
    void recover(LaneReadings& readings, LaneAngles* angles);

    /// The same for rows [first_row, last_row).
    void recover(LaneReadings& readings, std::size_t first_row, std::size_t last_row, LaneAngles* angles);

    /// Information on the coupling itself from the pulses: with b and phase e those of the tables, a coupling
    /// b ((1 + x) sin(psi + e) + y cos(psi + e)) adds x P + y Q to the left-hand sides above, P = 2 D (R - 1)/R and Q
    /// the same of a coupling a quarter fringe on. The parts of P and Q that are orthogonal to e, tau and the share add
    /// up to normal equations of x and y, weighted with the inverse of the noise's variance: of all turns since learn()
    /// or forget_bends().
    struct Bends {
        double xx, xy, yy, x, y;
    };
    void learn() { learning_ = true; }
    Bends bends(std::size_t lane) const {
        return {state_.xx[lane], state_.xy[lane], state_.yy[lane], state_.x[lane], state_.y[lane]};
    }
    void forget_bends(std::size_t lane);

    struct Coupling {
        double b_rad_s;
        double phase_rad;
    };
    /// The coupling of the tables.
    Coupling coupling_of_tables(std::size_t lane) const {
        return {devices_[lane].coupling.b_rad_s, devices_[lane].coupling.phase_rad};
    }
    /// Makes the tables anew for this coupling. Bends are linear about the coupling of their tables only, so the
    /// earlier ones are discarded.
    void set_coupling(std::size_t lane, const Coupling& coupling);

    /// Turns at which pulses and detectors contradicted each other, so that the detectors' phase was kept.
    std::int64_t contradictions(std::size_t lane) const {
        return static_cast<std::int64_t>(state_.contradictions[lane]);
    }

    struct State {
        simd::Lanes last_fringes{}, last_whole{};  ///< phase at the turn before
        simd::Lanes last_gain{};                   ///< of the half cycle before [fringes]
        simd::Lanes turn_amplitude_rad{};          ///< at the turn before, where amplitudes change over half cycles
        simd::Lanes last_pull_rad_s{};             ///< b (sin x + cos x) at the turn before, x turned upright
        /// Mean over cycles, or, where amplitudes change over half cycles, the rotation alone [fringes].
        simd::Lanes cycle_gain{};
        simd::Lanes cycles{};
        simd::Lanes contradictions{};
        simd::Lanes xx{}, xy{}, yy{}, x{}, y{};  ///< normal equations of the coupling
        std::int64_t turns = 0;
    };
    struct Known {
        simd::Lanes amplitude_rad, b_rad_s;
        simd::Lanes coupling_cosine_rad_s, coupling_sine_rad_s;  ///< b times those of the coupling phase
        simd::Lanes rad_s_per_cycle_gain;
        simd::Lanes half_share[2];           ///< of the half cycles of positive and negative sign in the period
        simd::Lanes w2_per_amplitude[2][2];  ///< acceleration over amplitude, [minimum, maximum][before, after]
        simd::Lanes root_pi_over_a_s[2];     ///< sqrt(pi/a) of the half cycle that ends there, [minimum, maximum]
        simd::Lanes w2[2];
        simd::Lanes amplitude_relative;
        double change_rms_rad = 0.0;
    };

   private:
    void make_tables(std::size_t lane);

    std::size_t lanes_;
    std::vector<gyro::Device> devices_;
    Electronics electronics_;
    bool learning_ = false;
    Known known_;
    PulseTables tables_;
    State state_;
};

}  // namespace ringlock::readout
