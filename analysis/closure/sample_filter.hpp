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
    double from_hz = 0.0;      ///< taken at that rate and interpolated; 0: not
    double blur_arcsec = 0.0;  ///< rms of what interpolated readings are off the straight line
    double from_phase = 0.0;   ///< source intervals from the sample before the record's start to that start
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

   private:
    static constexpr int most = 16;
    using Vector = std::array<double, most>;
    using Matrix = std::array<Vector, most>;
    void step(Matrix& p) const;
    void advance(Vector& x) const;

    int n_ = 0;
    bool resampled_ = false;
    Matrix f_{}, q_{};  ///< one interval of the source
    Vector h_{};
    std::vector<Vector> gain_;  ///< until they stay the same
    std::vector<double> sd_;
    std::vector<std::uint8_t> ticks_;  ///< resampled: source samples passed before each row
    std::vector<double> share_;
    std::vector<int> nonzero_[most];
};

}  // namespace ringlock::closure
