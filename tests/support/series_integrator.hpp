#pragma once
#include <cmath>

#include "engine/core/phase.hpp"
#include "engine/gyro/motion.hpp"
#include "tests/support/propagator.hpp"

namespace ringlock::test {

/// The equation of motion by the scalar series of the phase itself, order 20: what the vectorised integrator, whose
/// variable, order and arithmetic are others, is held against.
class SeriesIntegrator final : public Propagator {
   public:
    SeriesIntegrator(gyro::Coupling coupling, double tolerance_rad)
        : coupling_(coupling), tolerance_rad_(tolerance_rad) {}

    double lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) override {
        Phase gain;
        Phase phase(phase_rad);
        // About two steps a fringe, each with its share of the tolerance.
        const double per_step = tolerance_rad_ / (4.0 + 2.0 * half.amplitude_rad / units::pi);
        double t = 0.0;
        double scale =
            1.0 / (coupling_.b_rad_s + std::abs(half.rate_rad_s) + std::sqrt(half.end_acceleration_rad_s2()));
        while (t < half.duration_s) {
            const gyro::PhaseSeries<20> series(half, coupling_, t, phase.remainder_rad, scale);
            const double wanted = series.step_s(per_step);
            // A time that is off by half a unit in its last place is worth 1e-12 rad at full rate.
            const double next = t + wanted >= half.duration_s ? half.duration_s : t + wanted;
            scale = next - t;
            const double step = series.gain_rad(scale);
            phase.add(step);
            gain.add(step);
            t = next;
        }
        gain.add(-half.plain_phase_total_rad());
        return gain.value_rad();
    }

   private:
    gyro::Coupling coupling_;
    double tolerance_rad_;
};

}  // namespace ringlock::test
