#pragma once
#include "engine/gyro/half_cycle.hpp"

namespace ringlock::test {

/// Lock-in phase [rad] gained over `duration_s` at a constant phase rate, in closed form (Adler's equation).
double constant_rate_gain_rad(double phase_rad, double rate_rad_s, double duration_s, const gyro::Coupling& coupling);

}  // namespace ringlock::test
