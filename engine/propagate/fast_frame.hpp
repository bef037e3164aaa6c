#pragma once
#include <array>
#include <complex>

#include "engine/gyro/half_cycle.hpp"

namespace ringlock::propagate {

/// The frame in which fast motion is plain rotation, for any harmonics of the coupling:
///
///     phi = theta + 2 Re sum_k p_k exp(i k theta),      theta = psi + coupling phase,
///
/// turns at a rate that does not depend on phi. An asymptotic series in the coupling over the rate and in the change of
/// the rate within a fringe; derived in docs/dev/turn-map.md. Without second harmonic it is that of half_turn.hpp.
class FastFrame {
   public:
    /// The frame of a half cycle at `t_s` from its first turn, where motion must be fast (fast_motion_from_s()).
    /// `tolerance_rad`: terms that are smaller are left out, which saves time; 0: all terms are taken.
    FastFrame(const gyro::HalfCycle& half, const gyro::Coupling& coupling, double t_s, double tolerance_rad = 0.0);

    /// phi - theta [rad].
    double correction_rad(double theta_rad) const;
    /// theta of that phi [rad].
    double theta_rad(double phi_rad) const;
    /// Rate at which phi turns less that of drive and input [rad/s].
    double rate_beyond_drive_rad_s() const { return rate_beyond_drive_rad_s_; }

   private:
    static constexpr std::size_t most_harmonics = 12;
    std::size_t harmonics_ = most_harmonics;
    std::array<std::complex<double>, most_harmonics + 1> p_{};
    double rate_beyond_drive_rad_s_ = 0.0;
};

}  // namespace ringlock::propagate
