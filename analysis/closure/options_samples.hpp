#pragma once

namespace ringlock::closure {

/// Numbers that decide what is named on a record of samples.
struct SampleOptions {
    /// Relative error of a declared dither frequency [1]. With a larger one the dither and its harmonics would cover
    /// half of all frequencies.
    double declared_dither_error = 0.002;
    /// Largest drift of a dither, relative to its frequency [1/s]: springs of steel soften by 2.5e-4 a kelvin, the
    /// resonance by half of that, while a gyro warms up by a kelvin a minute.
    double dither_drift_per_s = 2e-6;
};

}  // namespace ringlock::closure
