#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/gyro/device.hpp"
#include "engine/gyro/lane_drive.hpp"
#include "engine/simd/lanes.hpp"

/// The equation of motion integrated through every fringe, several gyros side by side.
namespace ringlock::propagate {

/// A stretch of the motion, from the turn at which a half cycle begins on.
struct Stretch {
    gyro::HalfCycle half;
    gyro::Coupling coupling;
    double start_fringes = 0.0;  ///< psi at the turn, without the coupling phase; best within a few fringes
    double end_s = 0.0;          ///< time from the turn to the end of the stretch; 0: nothing is done
};

/// Result of the motion over a stretch.
struct StretchResult {
    double lockin_rad = 0.0;  ///< phase that the lock-in adds beyond that of drive and input
    double cosine = 1.0;      ///< of psi + coupling phase at the beginning
    double sine = 0.0;
    std::int64_t steps = 0;
};

/// Integrates stretches by Taylor series of order 24 with steps chosen from the last two coefficients (Jorba & Zou
/// 2005, Experimental Mathematics 14). The variable is the phase that the lock-in adds, which stays small: nothing is
/// lost over thousands of fringes.
///
/// Every stretch has its own steps, and its result does not depend on the other stretches. `tolerance_rad`: error over
/// a half cycle, shared out among its steps. `results` has as many elements as `stretches`. Throws RunError where the
/// steps become too short for the tolerance.
void integrate(std::span<const Stretch> stretches, double tolerance_rad, std::span<StretchResult> results);

/// Goes through the turns of a block of gyros by integrate(): the reference for step_turns(), with the same drive and
/// the same output.
class DirectLanes {
   public:
    /// `devices`: the device of each gyro, at most simd::lanes. `tolerance_rad`: error of a half cycle.
    DirectLanes(std::span<const gyro::Device> devices, double tolerance_rad);

    /// Goes through the turns of `drive`, the next piece of a run, and on to the turn after the last. `turns` is filled
    /// where given.
    void step(const gyro::LaneDrive& drive, gyro::LaneTurns* turns);

   private:
    std::vector<gyro::Device> devices_;
    double tolerance_rad_;
    simd::Lanes lockin_fringes_;  // at the turn to come, less ...
    simd::Lanes whole_;           // ... these whole fringes
    std::vector<Stretch> stretches_;
    std::vector<StretchResult> results_;
};

}  // namespace ringlock::propagate
