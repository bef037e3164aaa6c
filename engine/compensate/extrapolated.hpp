#pragma once
#include "engine/compensate/lane_compensator.hpp"
#include "engine/readout/electronics.hpp"

namespace ringlock::compensate {

/// The phase at a turn extrapolated from the pulses before it and from those after it: the difference is the kick (Lim,
/// Honeywell, US patent 4,605,307, 1982). It needs no threshold and no coupling phase, and works one turn at a time.
///
/// Without lock-in the phase turned upright is psi_0 + a (t - tau)^2/(2 R^2) next to a turn, a = A w^2 of that side's
/// half cycle and, for a plain sinusoid, R = 1 + w^2 D/(12 a) at the distance D from the extremum. With it that is the
/// path far from the turn, with a psi_0 of either side. A pulse at time t from the instant of sampling whose comparator
/// switches D from the sampled phase then says, with e_side = psi_0 of that side - sampled + a tau^2/2,
///
///     y = a t^2/(2 R^2) - D = -e_side + g tau + noise,      g = a t/R^2.
///
/// e_before, e_after and the common tau [s] are fitted to the four pulses of each side by least squares, weighed by
/// comparator noise and clock. The kick is e_after - e_before; half of it has acted when the zero-rate point is
/// reached.
///
/// Remaining error: at the distance D the lock-in has still to add b cos(psi)/psi', psi' = sqrt(2 a D), to first order,
/// over the kick's kappa = b sqrt(2 pi/a) that is up to 1/sqrt(4 pi D): a third at the first pulse, an eighth at the
/// fourth, with the sign of each second quarter fringe. Half a kick and tau differ only by how they depend on g, so
/// that the straight line enlarges these tails where it is carried to g = 0. Four pulses leave 0.78 of the error's rms
/// (1.13 with three: the sum of the above over psi_0), for any threshold; the estimate is 1.07 times the kick and has a
/// correlation of 0.81 with it, so that 0.61 times the estimate would leave 0.59. The default instrument's comparators
/// and clock add 0.015 rad a cycle, 0.0002 deg/sqrt(h); the amplitudes of half cycles, of which the mean is known, a
/// tenth of that behind injected noise of 3 rad. Errors with more pulses: docs/dev/readout.md.
class Extrapolated final : public LaneCompensator {
   public:
    /// `electronics`: as the readings' pulses were taken; noise and hysteresis are known to the operator.
    Extrapolated(const Calibration& calibration, const readout::Electronics& electronics);

    /// Throws RunError where the readings have no pulses.
    void observe(const readout::LaneReadings& readings, LaneErrors& errors) override;
    bool wants_samples() const override { return true; }

    struct State {
        simd::Lanes acceleration_rad_s2[2];  ///< A w^2 of half cycles of positive and negative sign
        simd::Lanes curve_per_rad[2];        ///< w^2/(12 a)
        simd::Lanes error_fringes;           ///< after the last turn
        simd::Lanes error_whole;
    };

   private:
    std::size_t lanes_;
    readout::Electronics electronics_;
    State state_;
};

}  // namespace ringlock::compensate
