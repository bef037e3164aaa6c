#include "engine/propagate/direct.hpp"

#include <fmt/format.h>

#include <cmath>

#include "engine/core/error.hpp"
#include "engine/core/phase.hpp"
#include "engine/gyro/motion.hpp"

namespace ringlock::propagate {

namespace {
using Series = gyro::PhaseSeries<20>;
}

DirectIntegrator::DirectIntegrator(gyro::Coupling coupling, double tolerance_rad)
    : coupling_(coupling), tolerance_rad_(tolerance_rad) {}

double DirectIntegrator::lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) {
    const double shortest = 1e-12 * half.duration_s;
    Phase gain;  // psi - psi(0), kept precise over thousands of fringes
    Phase phase(phase_rad);
    // About two steps a fringe, each with its share of the tolerance.
    const double per_step = tolerance_rad_ / (4.0 + 2.0 * half.amplitude_rad / units::pi);
    double t = 0.0;
    double scale = 1.0 / (coupling_.b_rad_s + std::abs(half.rate_rad_s) + std::sqrt(half.end_acceleration_rad_s2()));
    while (t < half.duration_s) {
        const Series series(half, coupling_, t, phase.remainder_rad, scale);
        double h = series.step_s(per_step);
        if (!(h > shortest)) {
            throw RunError(
                fmt::format("direct integrator: the step fell below {:.3g} s at a tolerance of {:.3g} rad; "
                            "raise propagation.direct_tolerance_rad",
                            shortest, tolerance_rad_));
        }
        // The step actually taken is the difference of two representable times: a time that is off by half a unit
        // in its last place is worth 1e-12 rad at full rate.
        const double next = t + h >= half.duration_s ? half.duration_s : t + h;
        h = next - t;
        const double step = series.gain_rad(h);
        phase.add(step);
        gain.add(step);
        t = next;
        scale = h;
        ++steps_;
    }
    Phase excess = gain;
    excess.add(-half.plain_phase_total_rad());
    return excess.value_rad();
}

}  // namespace ringlock::propagate
