#include "tests/support/direct.hpp"

#include "engine/core/units.hpp"
#include "engine/propagate/direct_lanes.hpp"

namespace ringlock::test {

double DirectIntegrator::lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) {
    const propagate::Stretch stretch{half, coupling_, phase_rad / units::two_pi, half.duration_s};
    propagate::StretchResult result;
    propagate::integrate({&stretch, 1}, tolerance_rad_, {&result, 1});
    steps_ += result.steps;
    return result.lockin_rad;
}

}  // namespace ringlock::test
