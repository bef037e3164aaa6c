#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace ringlock::closure {

/// What is random in a record of samples; angles in arcsec.
struct SampleNoise {
    double angle_arcsec = 0.0;      ///< rms of the white error of each reading of the angle
    double rate_arcsec_rt_s = 0.0;  ///< white rate: root of the variance of the angle a second
    double walk_arcsec2_s3 = 0.0;   ///< growth of the variance of a rate that walks [(arcsec/s)^2/s]
    struct Term {
        double time_s, variance_arcsec2_s2;
    };
    std::vector<Term> terms = {};  ///< Gauss-Markov rates
    /// An angle that is a second-order autoregression.
    struct Resonance {
        double arcsec, hz, width_hz;
    };
    std::vector<Resonance> resonances = {};
    /// The variance of the readings' errors goes up and down at that frequency: its logarithm by cos, and by sin.
    double swing_hz = 0.0, swing_cos = 0.0, swing_sin = 0.0;
    double from_hz = 0.0;        ///< taken at that rate and interpolated; 0: not
    double blur_arcsec = 0.0;    ///< rms of what interpolated readings are off the straight line
    double digits_arcsec = 0.0;  ///< the least of it: what the values are written to
    double from_phase = 0.0;     ///< source intervals from the sample before the record's start to that start
};

/// The Kalman filter that makes innovations of increments: independent and of unit variance where the noise is as said.
///
/// The angle is a sum of white and slow rates, z = angle + resonances + white reading error; of a resampled record z
/// lies on the straight line between two such readings, which are states of their own.
class SampleFilter {
   public:
    SampleFilter(const SampleNoise& noise, std::size_t rows, double interval_s);
    /// Innovations over their standard deviations. Linear in the increments.
    std::vector<double> apply(std::span<const double> increments) const;
    double sd(std::size_t row) const { return sd_[std::min(row, sd_.size() - 1)]; }
    /// Minus the log-likelihood of the rows that count, but for a constant, in one pass that keeps nothing.
    static double minus_log_likelihood(const SampleNoise& noise, double interval_s, std::span<const double> increments,
                                       std::span<const std::uint8_t> rows);

    static constexpr int most = 16;
    using Vector = std::array<double, most>;

    /// Many filters step by step, for readings of the angle that are not known beforehand; not of a resampled record.
    class Many {
       public:
        /// Each begins at a reading.
        Many(const SampleFilter& filter, std::span<const double> readings);
        /// Of the next readings.
        void foretell(std::span<double> readings);
        void take(std::size_t row, std::span<const double> innovations);
        /// Each becomes a copy of another.
        void continue_from(std::span<const std::uint8_t> others);

       private:
        const SampleFilter& filter_;
        std::size_t count_;
        std::vector<double> x_;  ///< state after state of all
        std::vector<double> next_;
    };

   private:
    using Matrix = std::array<Vector, most>;
    struct Terms {
        int count = 0;
        std::array<int, most> at{};
    };
    SampleFilter() = default;
    void set_up(const SampleNoise& noise, double interval_s);
    template <int D, class Row>
    void run(std::size_t rows, Row&& row) const;
    template <int D>
    static void advance(const SampleFilter& filter, std::array<double, D>& x);

    int n_ = 0;
    bool resampled_ = false;
    bool swings_ = false;
    double swing_by_row_ = 0.0, swing_cos_ = 0.0, swing_sin_ = 0.0;
    double floor_ = 0.0;  ///< variance of the measurement itself
    double ratio_ = 0.0;  ///< resampled: source intervals a row
    double first_place_ = 0.0;
    Matrix f_{}, q_{}, start_{};  ///< one interval of the source
    Vector h_{};
    std::array<Terms, most> nonzero_{};
    std::vector<double> gain_;  ///< until they stay the same
    std::vector<double> sd_;
    std::vector<std::uint8_t> ticks_;  ///< resampled: source samples passed before each row
    std::vector<double> share_;
};

}  // namespace ringlock::closure
