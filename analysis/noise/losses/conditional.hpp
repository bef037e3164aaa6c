#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "analysis/noise/losses/cosine_pair.hpp"
#include "analysis/noise/losses/lossy_rates.hpp"
#include "analysis/noise/model/spectrum.hpp"
#include "engine/random/stream.hpp"

namespace ringlock::noise {

/// Gaussian coefficients 1 to n - 1 of a record: variances, and the angle errors of both ends (see Likelihood). The
/// mean, coefficient 0, is not known at all.
class CoefficientNoise {
   public:
    /// \param variance     of coefficients 1 to n - 1 without the angle errors of the ends
    /// \param angle_noise  variance of white angle noise, the parameter `quantisation`
    CoefficientNoise(std::vector<double> variance, double angle_noise);

    std::size_t samples() const { return inverse_.size(); }
    /// Coefficients times the inverse of their covariance; coefficient 0 becomes 0.
    void weigh(Pair& z) const;
    /// Coefficients times their variances, those before `from` times that of `from`.
    void spread(Pair& z, std::size_t from) const;
    /// Coefficients of that noise, from standard normal deviates in their place.
    void colour(Pair& deviates, random::NormalStream& ends) const;
    /// Adds `times` the direction of the end errors' covariance applied to z.
    void add_ends(const Pair& z, double times, Pair& to) const;

   private:
    std::vector<double> inverse_;  ///< 1 over the variance; 0 of coefficient 0
    std::vector<double> end_;      ///< u, see Bin
    double angle_noise_;
    std::array<double, 2> weight_{};  ///< of the end errors of both parities in the inverse
};

/// Missing rates given those that are there.
///
/// With precision P of all rates the missing ones m have conditional precision P_mm, which conjugate gradients invert
/// by products with P alone: two cosine transforms each. Where the mean of a gap is known, all is within gaps of mean
/// 0.
class Conditional {
   public:
    Conditional(std::size_t n, std::span<const Gap> gaps);

    std::size_t unknowns() const { return index_.size(); }
    /// Steps that conjugate gradients have taken so far.
    std::size_t steps() const { return steps_; }
    /// x with P_mm x = b, from a start that is given in x.
    /// \param b, x  of the missing rates in their order; gaps of known mean have mean 0
    void solve(const CoefficientNoise& noise, const Pair& b, Pair& x);
    /// Missing rates of a series of such coefficients.
    Pair missing_of(Pair coefficients);
    /// Coefficients 0 to n - 1 of a series that is 0 but for these missing rates.
    Pair coefficients_of(const Pair& missing);
    /// Puts the conditional mean in the place of the missing rates of a series without mean.
    void complete(const CoefficientNoise& noise, Pair& coefficients);

   private:
    void centre(Pair& missing) const;
    Pair preconditioned(const CoefficientNoise& noise, const Pair& rest);
    Pair times_precision(const CoefficientNoise& noise, const Pair& missing);

    CosinePair basis_;
    std::vector<std::size_t> index_;
    double length_ = 0.0;  ///< of the gap in which the usual missing rate is
    std::size_t steps_ = 0;
    std::vector<Gap> known_;  ///< gaps of known mean, as places in index_
};

}  // namespace ringlock::noise
