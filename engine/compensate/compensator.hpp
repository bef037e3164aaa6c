#pragma once
#include "engine/readout/reading.hpp"

/// Lock-in compensators: they see readings and a calibration, never the truth.
namespace ringlock::compensate {

/// What an operator has measured about the gyro beforehand.
struct Calibration {
    double b_rad_s = 0.0;  ///< (2 pi / K) Omega_L
};

/// Computes the lock-in error from the readings at the zero-rate points, online.
class Compensator {
   public:
    virtual ~Compensator() = default;
    /// Takes the next reading; call for every zero-rate point, in order.
    virtual void observe(const readout::Reading& reading) = 0;
    /// Lock-in error [rad] accumulated up to the zero-rate point last observed, to be taken away from its phase.
    virtual double error_rad() const = 0;
};

}  // namespace ringlock::compensate
