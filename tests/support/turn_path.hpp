#pragma once
#include <array>
#include <span>
#include <vector>

#include "engine/gyro/half_cycle.hpp"

namespace ringlock::test {

/// The phase's path close to one turn, from the equation of motion, with second harmonics of dither and coupling and a
/// threshold that differs between the turns.
///
/// The dither turns at its own zero-rate point; the phase turns where input rate and lock-in are added, a little before
/// or after. Times are relative to the dither's turn.
class TurnPath {
   public:
    /// `phase_rad`: psi at the dither's turn. `before` and `after`: the half cycles that end and begin there.
    /// Throws RunError where the phase does not reverse within the neighbouring quarter cycles.
    TurnPath(const gyro::HalfCycle& before, const gyro::HalfCycle& after, const gyro::Coupling& coupling,
             double phase_rad);

    double zero_rate_time_s() const { return zero_time_s_; }
    /// psi at the zero-rate point on the branch of `phase_rad`.
    double zero_rate_phase_rad() const { return zero_phase_rad_; }
    /// Phase that drive and input alone add between the dither's turn and the zero-rate point.
    double plain_gain_rad() const;
    /// Magnitude of the phase acceleration at the zero-rate point, as the half cycle on that side gives it.
    double acceleration_rad_s2(int side) const;

    /// Times at which the phase is `distance_rad[0]` < `distance_rad[1]` away from its extremum, before (side -1) or
    /// after (+1) it.
    std::array<double, 2> crossing_times_s(int side, const std::array<double, 2>& distance_rad) const;
    /// The same of any number of distances, nearest first.
    std::vector<double> crossing_times_s(int side, std::span<const double> distance_rad) const;

   private:
    /// Half cycle and time in it that hold at `time_s` when going towards `side`.
    struct Place {
        const gyro::HalfCycle* half;
        double t_s;      ///< within the half cycle
        double limit_s;  ///< how far the half cycle goes on in that direction
    };
    Place place(double time_s, int side) const;
    /// Goes from the dither's turn, where the phase rate is `rate_rad_s`, to where it vanishes; false where it does not
    /// before the middle of the half cycle.
    template <class Series>
    bool walk_to_zero_rate(double rate_rad_s, int side);

    gyro::HalfCycle before_;
    gyro::HalfCycle after_;
    gyro::Coupling coupling_;
    double scale_s_;
    double zero_time_s_ = 0.0;
    double zero_phase_rad_ = 0.0;
};

}  // namespace ringlock::test
