#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

namespace ringlock::closure {

/// Kicks of the lock-in by the rows of a record. A kick is added to the row in which its turn falls; the kick of a turn
/// near the end of a row is divided between that row and the next. Variance of the first part, variance of the second
/// part, and their covariance, each divided by the variance of a whole kick and summed over the turns next to the row's
/// end.
struct KickRows {
    std::vector<double> variance, carried, covariance;
};

/// Noise of the dither in readings that contain it, expressed by the amplitudes at its turns. For each row: the number
/// of turns passed since the row before, and the weights in the reading of the amplitude at the last turn, of that at
/// the next turn, and of the state that follows the amplitudes.
struct DitherRows {
    std::vector<std::uint16_t> passed;
    std::vector<double> last, next, follower;
};

/// State that follows the amplitudes a_k of the dither's noise: m' = kept m + by_last a_k + by_next a_(k+1) at a turn.
struct DitherFollower {
    double kept = 0.0, by_last = 0.0, by_next = 0.0;
};

/// Random part of a record of samples; angles in arcsec.
struct SampleNoise {
    double angle_arcsec = 0.0;      ///< rms of the white error of each reading of the angle
    double rate_arcsec_rt_s = 0.0;  ///< white rate: root of the angle's variance per second
    double walk_arcsec2_s3 = 0.0;   ///< random walk of the rate: growth of its variance [(arcsec/s)^2/s]
    struct Term {
        double time_s, variance_arcsec2_s2;
    };
    std::vector<Term> terms = {};  ///< Gauss-Markov rates
    /// Share of the variance of the white rate that arrives in kicks at the turns of the dither, and turns per second.
    /// `kicks` is null if there are none.
    double kick_share = 0.0;
    double turn_hz = 0.0;
    double kick_excess = 0.0;  ///< kurtosis of a kick beyond 3
    std::shared_ptr<const KickRows> kicks = {};
    /// Variance of a kick [arcsec^2].
    double kick_variance() const { return kick_share * rate_arcsec_rt_s * rate_arcsec_rt_s / turn_hz; }
    /// Share of the variance of the readings' errors, as it is at the turns, that is noise of the dither, and
    /// correlation of its amplitudes from turn to turn. `dither` is null if there is no such noise.
    double dither_share = 0.0;
    double dither_memory = 0.0;
    DitherFollower dither_follower = {};
    std::shared_ptr<const DitherRows> dither = {};
    /// Angle that is a second-order autoregression.
    struct Resonance {
        double arcsec, hz, width_hz;
    };
    std::vector<Resonance> resonances = {};
    /// Sidebands of the dither in the readings, where a noisy drive changes its amplitude and its phase: rms at any
    /// time, frequency of the dither, full width at half maximum of their spectrum. 0 arcsec: none. At 0 Hz they are
    /// the noise of the amplitude in a reader whose zero crossings are late.
    Resonance sidebands = {0.0, 0.0, 0.0};
    /// Error of counts that are latched where the dither adds nothing to the angle: a sawtooth of the angle. Under a
    /// steady rate its harmonics are lines, which the random walk of the counted angle widens: the phase of harmonic m
    /// diffuses m^2 times as fast as that of the first. The width is fitted; all other values follow from the declared
    /// reader and the mean rate.
    struct CountError {
        double step_arcsec = 0.0;  ///< of the count; 0: none
        double hz = 0.0;           ///< steps that the counted angle passes per second
        double width_hz = 0.0;     ///< of the first harmonic, full width at half maximum
        double latch_hz = 0.0;     ///< rate at which counts are latched
        /// Rms error of the angle at which a count is latched, independent between counts: it blurs the sawtooth.
        double jitter_arcsec = 0.0;
        /// Number of harmonics that are states; the others are part of the white error of the readings.
        int harmonics = 0;
        double amplitude_arcsec(int harmonic) const;
    };
    CountError count_error = {};
    /// The variance of the readings' errors oscillates at that frequency: coefficients of cos and sin in its logarithm.
    double swing_hz = 0.0, swing_cos = 0.0, swing_sin = 0.0;
    double from_hz = 0.0;        ///< rate of the source that the record was interpolated from; 0: not resampled
    double blur_arcsec = 0.0;    ///< rms deviation of interpolated readings from the straight lines
    double digits_arcsec = 0.0;  ///< rms of rounding to the digits of the values
    /// Source intervals from the source's last reading before the record's start to that start.
    double from_phase = 0.0;
};

/// A record of samples as a linear system: x' = F x + noise of covariance Q from reading to reading of the instrument,
/// or of the source of a resampled record; a sample is h x + error. States: angle, rates, resonances (two each), and
/// two readings of the source in a resampled record.
struct SampleStates {
    static constexpr int most = 16;
    static constexpr int dither_states = 3;  ///< number of states of the dither's noise
    using Vector = std::array<double, most>;
    using Matrix = std::array<Vector, most>;
    /// Columns of the elements in a row of F that are not zero.
    struct Terms {
        int count = 0;
        std::array<int, most> at{};
        bool operator==(const Terms&) const = default;
    };

    SampleStates() = default;
    SampleStates(const SampleNoise& noise, double interval_s);

    /// Whether both systems have the same states and steps, so that they can share vector lanes; their values may
    /// differ.
    bool is_like(const SampleStates& other) const;

    int count = 0;
    bool resampled = false;
    /// Variance of a kick. The second state, after the angle, is the part of a kick that belongs to the next row.
    double kick = 0.0;
    std::shared_ptr<const KickRows> kicks;
    /// Noise of the dither: index of the first of its three states (amplitudes at the last and the next turn, and the
    /// state that follows them), variance and memory of the amplitudes.
    std::shared_ptr<const DitherRows> dither;
    int of_dither = 0;
    double dither_variance = 0.0, dither_memory = 0.0;
    DitherFollower dither_follower;
    bool swings = false;
    double swing_by_row = 0.0, swing_cos = 0.0, swing_sin = 0.0;
    double floor = 0.0;  ///< variance of the error of the measurement itself
    double ratio = 0.0;  ///< resampled: source intervals per row
    double first_place = 0.0;
    Matrix f{}, q{}, start{};  ///< over one interval of the source
    Vector h{};                ///< of a resampled record, its last two elements differ by row
    std::array<Terms, most> nonzero{};
};

/// Calls `with` with the number of states as a compile-time constant.
template <int D = 1, class With>
void for_states(int states, With&& with) {
    if constexpr (D <= SampleStates::most) {
        if (states == D) return with(std::integral_constant<int, D>{});
        for_states<D + 1>(states, with);
    }
}

}  // namespace ringlock::closure
