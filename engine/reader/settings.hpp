#pragma once
#include <array>
#include <cstdint>

/// The reader latches the gyro's angle at the ticks of its own clock and removes the dither from it.
namespace ringlock::reader {

/// How the dither is taken out of the latched angle.
enum class Stripping {
    none,           ///< it is not
    whole_cycle,    ///< counts are latched once a dither cycle, and resampled
    reference,      ///< a measured dither angle is subtracted
    fir,            ///< a low-pass filter of linear phase at the latching rate, before decimation
    notch,          ///< an adaptive canceller of the dither's frequency
    reference_fir,  ///< a measured dither angle is subtracted, then the low-pass filter
};

/// Parts of the phase from which a latched angle is made.
enum class Fraction {
    ideal,      ///< the phase itself
    detectors,  ///< the counter's quarter fringe and the quadrature detectors within it
    none,       ///< the counter alone, in steps of a quarter fringe
};

/// Their names in scenarios and records, in the order of the values.
inline constexpr std::array stripping_names = {"none", "whole_cycle", "reference", "fir", "notch", "reference+fir"};
inline constexpr std::array fraction_names = {"ideal", "detectors", "none"};

/// Settings of a reader. The defaults are a reader without error, in which only the dither is missing.
struct Settings {
    double latch_hz = 0.0;  ///< rate of the latching clock, a multiple of that of the output; 0: that of the output
    Fraction fraction = Fraction::ideal;
    Stripping stripping = Stripping::reference;
    double reference_gain_error_relative = 0.0;  ///< of the measured dither angle
    double reference_delay_s = 0.0;
    double reference_noise_arcsec = 0.0;  ///< rms, independent from tick to tick
    double reference_learning_s = 0.0;    ///< time constant with which gain and delay are learnt; 0: they are not
    std::int64_t fir_order = 0;           ///< taps less one, even; 0: four dither cycles
    double fir_cutoff_hz = 0.0;           ///< where the response is one half; 0: a quarter of the dither's frequency
    double notch_bandwidth_hz = 1.0;      ///< between the points of half the power
    bool operator==(const Settings&) const = default;
};

/// Rate of the ticks of a reader that puts out angles at `output_hz`.
inline double latch_hz(const Settings& settings, double output_hz) {
    return settings.latch_hz > 0.0 ? settings.latch_hz : output_hz;
}

}  // namespace ringlock::reader
