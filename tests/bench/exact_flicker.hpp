#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace ringlock::bench {

/// Flicker rate averaged over consecutive intervals, exact for a record of a given length.
///
/// Differences of the averages are stationary: with the generalised covariance -ln|t|/pi of a spectrum 1/(2 pi f)
/// theirs is minus the fourth difference of -(t^2/2)(ln t - 3/2)/pi, negative at every lag but 0, so that a circle of
/// them has no negative eigenvalue (P. Craigmile, J. Time Series Analysis 24 (2003) 505) and a Fourier transform of
/// white noise has them exactly.
class ExactFlicker {
   public:
    explicit ExactFlicker(std::size_t samples);

    /// Rates of bias instability B = 1, up to a constant.
    std::vector<double> rates(std::uint64_t seed) const;

   private:
    std::size_t samples_;
    std::vector<double> root_;  ///< of the eigenvalues of the circle
};

}  // namespace ringlock::bench
