#pragma once
#include <array>
#include <cstdint>

#include "engine/compensate/compensator.hpp"

namespace ringlock::compensate {

/// The stationary-phase correction (Gao & Deng 2007): half of the kick of a turn, with a = psi'' on that side,
///
///     before or after a minimum:  f b sqrt(pi/a) (sin psi_0 + cos psi_0)
///     before or after a maximum:  f b sqrt(pi/a) (sin psi_0 - cos psi_0).
///
/// f = 1/2 is right; the paper prints f = 1 (its equations 16 and 17), which contradicts its own (7).
///
/// The acceleration that two pulses give is itself bent by the lock-in, in step with psi_0. It is therefore averaged
/// over turns, for each side of minima and of maxima by itself.
class FirstOrder : public Compensator {
   public:
    FirstOrder(const Calibration& calibration, double factor);

    void observe(const readout::Reading& reading) override;
    double error_rad() const override { return error_rad_; }

   private:
    /// Mean of the positive values seen: of all of them at first, then of about the last `memory_turns`.
    class Average {
       public:
        double update(double value);

       private:
        double mean_ = 0.0;
        std::int64_t count_ = 0;
    };

    double scale_;  // f b sqrt(pi)
    std::array<Average, 4> acceleration_;
    double after_last_rad_ = 0.0;
    double error_rad_ = 0.0;
};

/// Corrected coefficients.
class Corrected final : public FirstOrder {
   public:
    explicit Corrected(const Calibration& calibration) : FirstOrder(calibration, 0.5) {}
};

/// The coefficients as printed, twice too large.
class Published final : public FirstOrder {
   public:
    explicit Published(const Calibration& calibration) : FirstOrder(calibration, 1.0) {}
};

}  // namespace ringlock::compensate
