#pragma once
#include <complex>
#include <cstddef>
#include <unsupported/Eigen/FFT>
#include <vector>

namespace ringlock::noise {

/// Two real series of like length as the real and the imaginary parts of one complex series.
using Pair = std::vector<std::complex<double>>;

/// Orthonormal cosine transform (DCT-II) of pairs of series and its inverse, each by one complex Fourier transform of
/// the same length (J. Makhoul, IEEE Trans. ASSP 28 (1980) 27).
class CosinePair {
   public:
    /// \param n  length; quick where its prime factors are small
    explicit CosinePair(std::size_t n);

    std::size_t size() const { return turn_.size(); }
    /// Coefficients 0 to n - 1 in place of the series.
    void to_coefficients(Pair& series);
    /// The series in place of its coefficients.
    void to_series(Pair& coefficients);

   private:
    std::vector<std::complex<double>> turn_;  ///< exp(i pi j/(2 n))
    Pair in_, out_;
    Eigen::FFT<double> fft_;
};

}  // namespace ringlock::noise
