#pragma once
#include <limits>
#include <vector>

#include "engine/gyro/device.hpp"
#include "tests/support/propagator.hpp"

namespace ringlock::bench {

/// Noise of the dither angle at each turn in every benchmark [rad], rms: that of the default scenario.
inline constexpr double turn_phase_rms_rad = 3.0;

/// Goes through `turns` turns of the noise-injected dither, the same for all propagators, and returns the lock-in phase
/// gained [rad].
double go_through(test::Propagator& propagator, const gyro::Device& device, int turns);

/// A half cycle of the noise-injected dither and what the lock-in adds in it, by the direct integrator at 1e-13 rad.
/// tests/physics/reference_integrators.cpp holds that to 1e-12 rad.
struct SolvedHalfCycle {
    gyro::HalfCycle half;
    double phase_rad;
    double gain_rad;
};

/// 40 of them, with phases all round the fringe.
std::vector<SolvedHalfCycle> solved_half_cycles(const gyro::Device& device);

/// Worst error of `propagator` over `solved` [rad]. Stops at the first one above `give_up_rad`.
double worst_error_rad(test::Propagator& propagator, const std::vector<SolvedHalfCycle>& solved,
                       double give_up_rad = std::numeric_limits<double>::infinity());

}  // namespace ringlock::bench
