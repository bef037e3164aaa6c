#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "analysis/record/record.hpp"
#include "tests/closure/generator/generator.hpp"
#include "tests/closure/generator/rates.hpp"

/// Records of uniform samples with known truth, as gyros and data loggers put them out.
namespace ringlock::test::closure {

/// A line in the angle, the stripped dither that is left: amplitude sin(2 pi int f dt + phase), f = frequency + drift
/// (t - mid-record), and what is still to come of `settles_hz` from the start, by the rule of a body that takes on
/// another temperature: settles exp(-(t - start)/settling time). Where it wanders its phase walks at random, by
/// a variance of 2 pi wander a second: a line of that full width at half its power. In increments it has 2 |sin(pi
/// f/rate)| times the amplitude, and appears at its alias where f is above half the rate.
struct DitherResidue {
    double frequency_hz = 100.0;
    double drift_hz_per_s = 0.0;
    double amplitude_arcsec = 0.0;
    double phase_rad = 0.0;
    double settles_hz = 0.0;
    double settling_s = 600.0;
    double wander_hz = 0.0;
};

/// Taken at `from_hz` and interpolated to the record's rate, the angle or (as from a table of rates) the rate linearly.
///
/// A record interval holds p = from/rate source intervals, in part. Of white rate noise N^2, interpolated in the angle,
/// an increment has the variance (N^2/from) sum of (shares of source intervals)^2, which beats with the distance of the
/// two rates; over all phases of the beat, with the integral of (p - |t|)(1 - |t|), it is
///
///     N^2/rate times 1 - 1/(3 p) for p >= 1,   p - p^2/3 for p < 1,
///
/// and neighbours that share a source interval are correlated. In frequency: sinc^2(f/from), and images about multiples
/// of `from_hz`.
struct Resampling {
    double from_hz = 0.0;  ///< 0: none
    bool of_rate = false;
};

/// Rotation of the case about the input axis: a resonance, its angle a second-order autoregression. The witness, an
/// accelerometer that gravity makes a tiltmeter, reads 9.80665 m/s^2 times sqrt(coherence) theta + sqrt(1 - coherence)
/// theta', theta' independent of theta and like it: `coherence` is the magnitude-squared coherence of witness and
/// rotation at all frequencies, before the noise of either instrument.
struct CaseMotion {
    std::string witness = "accel_x";
    double coherence = 0.9;
    double rms_arcsec = 0.0;  ///< of the angle
    double centre_hz = 5.0;
    double width_hz = 4.0;
};

/// A line in the rate whose amplitude changes; not in the library.
struct JumpingLine {
    double frequency_hz = 10.0;
    double rate_before_deg_h = 0.0;
    double rate_after_deg_h = 0.0;
    double time_s = 0.0;
};

/// A line in the rate whose frequency swings to and fro by `deviation_hz`; not in the library.
struct SwingingLine {
    double frequency_hz = 10.0;
    double rate_deg_h = 0.0;
    double deviation_hz = 0.1;
    double period_s = 60.0;
};

/// White noise of the angle whose variance goes up and down by so much of itself; not in the library.
struct NoiseModulation {
    double depth = 0.0;
    double period_s = 60.0;
};

/// A bias that follows the temperature through a mass between thermometer and gyro, as warm as the thermometer at the
/// start: y' = (temperature - y)/lag; not in the library.
struct LateTemperature {
    double deg_h_per_k = 0.0;
    double lag_s = 30.0;
};

/// An acceleration along accel_x, a first-order Markov process, which the witness sees, and a bias in proportion to it;
/// the bias is not in the library.
struct SlowAcceleration {
    double rms_m_s2 = 0.0;
    double time_s = 30.0;
    double deg_h_s2_per_m = 0.0;
};

struct SampleTruth {
    double rate_hz = 100.0;
    std::size_t size = 100000;
    std::uint64_t seed = 1;
    record::SampleKind kind = record::SampleKind::angle_increment_arcsec;
    double scale_factor_arcsec = 0.5;  ///< a count is a quarter of it

    double mean_rate_deg_h = 0.0;
    record::Track input_profile_deg_h;  ///< beside it, linear between its rows; known: the record has it as a reference
    double scale_factor_error = 0.0;    ///< of the profile
    double white_angle_arcsec = 0.0;    ///< rms on each reading of the angle; increments have its difference
    RateTruth rates;                    ///< the white rate noise is `quantum_noise_deg_rt_h`
    Temperature temperature;            ///< not constant: a witness
    double bias_temperature_deg_h_per_k = 0.0;
    double null_shift_deg_h_per_k_h = 0.0;  ///< bias for each kelvin an hour of the temperature's slope
    std::vector<RateLine> lines;            ///< beside rates.base_vibration

    double count_quantization_arcsec = 0.0;  ///< the angle in whole steps, floor(angle/step) step
    DitherResidue dither_residue;
    Resampling resampling;
    CaseMotion case_motion;

    bool accelerometers = false;        ///< witnesses even without case motion
    double accelerometer_noise = 1e-5;  ///< rms [m/s^2], white
    double thermometer_noise_k = 0.0;

    // Effects that the library does not have, beside those of `rates`
    JumpingLine jumping_line;
    SwingingLine swinging_line;
    NoiseModulation noise_modulation;
    double bias_per_rate_squared_h_deg = 0.0;  ///< of the profile: deg/h per (deg/h)^2
    LateTemperature late_temperature;
    SlowAcceleration slow_acceleration;
    double saturation_arcsec = 0.0;  ///< increments of the source are clipped here; 0: never

    std::optional<record::Declared> declared;  ///< not given: K where counts are put out
};

/// Coherence of the witness as it is recorded and the rotation, the mean over their power within a width of the centre:
/// less than before the witness's own noise.
double coherence_with_noise(const SampleTruth& truth);

/// Order of what happens to the angle: motion and noise, saturation, quantization, resampling. Sample k covers
/// [k, k+1]/rate, angles and counts are those at its end, less that at time 0; witnesses are means of its two ends.
record::Record generate_samples(const SampleTruth& truth);

}  // namespace ringlock::test::closure
