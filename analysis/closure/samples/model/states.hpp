#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

namespace ringlock::closure {

/// Kicks of the lock-in, by the rows of a record. A kick goes to the row in which its turn falls, or, of a turn near
/// the end of a row, to that row and the next: variance of the first part, of the second one, and their covariance,
/// over that of a whole kick, summed over the turns that are next to the row's end.
struct KickRows {
    std::vector<double> variance, carried, covariance;
};

/// Noise of the dither in readings that still have it, by the amplitudes at its turns. By the rows of a record: turns
/// passed since the row before, and the weights with which the amplitudes at the last turn and at the next, and what
/// follows the amplitudes, enter the reading.
struct DitherRows {
    std::vector<std::uint16_t> passed;
    std::vector<double> last, next, follower;
};

/// What follows the amplitudes of the dither's noise from turn to turn: m' = kept m + by_last a_k + by_next a_(k+1).
struct DitherFollower {
    double kept = 0.0, by_last = 0.0, by_next = 0.0;
};

/// What is random in a record of samples; angles in arcsec.
struct SampleNoise {
    double angle_arcsec = 0.0;      ///< rms of the white error of each reading of the angle
    double rate_arcsec_rt_s = 0.0;  ///< white rate: root of the variance of the angle a second
    double walk_arcsec2_s3 = 0.0;   ///< growth of the variance of a rate that walks [(arcsec/s)^2/s]
    struct Term {
        double time_s, variance_arcsec2_s2;
    };
    std::vector<Term> terms = {};  ///< Gauss-Markov rates
    /// Share of the white rate's variance that comes in kicks at the turns of the dither, so many a second; null: none.
    double kick_share = 0.0;
    double turn_hz = 0.0;
    double kick_excess = 0.0;  ///< kurtosis of a kick beyond 3
    std::shared_ptr<const KickRows> kicks = {};
    /// Variance of a kick [arcsec^2].
    double kick_variance() const { return kick_share * rate_arcsec_rt_s * rate_arcsec_rt_s / turn_hz; }
    /// Share of the variance of the readings' errors that is noise of the dither, as it is at the turns; correlation of
    /// its amplitudes from turn to turn. Null: none.
    double dither_share = 0.0;
    double dither_memory = 0.0;
    DitherFollower dither_follower = {};
    std::shared_ptr<const DitherRows> dither = {};
    /// An angle that is a second-order autoregression.
    struct Resonance {
        double arcsec, hz, width_hz;
    };
    std::vector<Resonance> resonances = {};
    /// Sidebands of the dither in the readings, where a noisy drive moves its amplitude and its phase: rms at any time,
    /// frequency of the dither, full width at half maximum of their spectrum. 0 arcsec: none. At 0 Hz it is the
    /// noise of the amplitude that a reader at late zero crossings has.
    Resonance sidebands = {0.0, 0.0, 0.0};
    /// Error of counts that are latched where the dither adds nothing: a sawtooth of the angle. Under a steady rate its
    /// harmonics are lines, which the random walk of the counted angle widens: the phase of harmonic m diffuses m^2
    /// times as fast as that of the first. All but the width follows from the declared reader and the mean rate.
    struct CountError {
        double step_arcsec = 0.0;  ///< of the count; 0: none
        double hz = 0.0;           ///< steps that the counted angle passes in a second
        double width_hz = 0.0;     ///< of the first harmonic, full width at half maximum
        double latch_hz = 0.0;     ///< rate at which counts are latched
        /// Rms of the angle at which a count is latched, independent from one to the next: it blurs the sawtooth.
        double jitter_arcsec = 0.0;
        int harmonics = 0;  ///< that are states; the others are part of the white error of the readings
        double amplitude_arcsec(int harmonic) const;
    };
    CountError count_error = {};
    /// The variance of the readings' errors goes up and down at that frequency: its logarithm by cos, and by sin.
    double swing_hz = 0.0, swing_cos = 0.0, swing_sin = 0.0;
    double from_hz = 0.0;        ///< taken at that rate and interpolated; 0: not
    double blur_arcsec = 0.0;    ///< rms of what interpolated readings are off the straight line
    double digits_arcsec = 0.0;  ///< the least of it: what the values are written to
    double from_phase = 0.0;     ///< source intervals from the sample before the record's start to that start
};

/// A record of samples as a linear system: x' = F x + noise of covariance Q from reading to reading of the instrument,
/// or of the source that it was resampled from; a sample is h x + error. States: angle, rates, resonances (two each),
/// of a resampled record two readings.
struct SampleStates {
    static constexpr int most = 16;
    static constexpr int dither_states = 3;  ///< of the noise of the dither, behind the angle
    using Vector = std::array<double, most>;
    using Matrix = std::array<Vector, most>;
    /// Which of a row of F are not zero.
    struct Terms {
        int count = 0;
        std::array<int, most> at{};
        bool operator==(const Terms&) const = default;
    };

    SampleStates() = default;
    SampleStates(const SampleNoise& noise, double interval_s);

    /// Whether the states are the same, and steps from one to the next: their numbers may differ.
    bool is_like(const SampleStates& other) const;

    int count = 0;
    bool resampled = false;
    /// Variance of a kick. The part of a kick that belongs to the next row is the second state, after the angle.
    double kick = 0.0;
    std::shared_ptr<const KickRows> kicks;
    /// The dither's noise: the first of its three states, amplitudes at the last and the next turn and what follows
    /// them; their variance and memory.
    std::shared_ptr<const DitherRows> dither;
    int of_dither = 0;
    double dither_variance = 0.0, dither_memory = 0.0;
    DitherFollower dither_follower;
    bool swings = false;
    double swing_by_row = 0.0, swing_cos = 0.0, swing_sin = 0.0;
    double floor = 0.0;  ///< variance of the measurement itself
    double ratio = 0.0;  ///< resampled: source intervals a row
    double first_place = 0.0;
    Matrix f{}, q{}, start{};  ///< one interval of the source
    Vector h{};                ///< of a resampled record: by row
    std::array<Terms, most> nonzero{};
};

/// Calls `with` with the number of states as a constant.
template <int D = 1, class With>
void for_states(int states, With&& with) {
    if constexpr (D <= SampleStates::most) {
        if (states == D) return with(std::integral_constant<int, D>{});
        for_states<D + 1>(states, with);
    }
}

}  // namespace ringlock::closure
