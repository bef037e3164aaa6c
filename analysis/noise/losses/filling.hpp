#pragma once
#include <cstddef>
#include <vector>

#include "analysis/noise/losses/conditional.hpp"
#include "analysis/noise/losses/lossy_rates.hpp"
#include "analysis/noise/model/spectrum.hpp"

namespace ringlock::noise {

/// A record filled in under a model of its noise.
struct Filled {
    Spectrum expected;  ///< expectations of the coefficients given what is there, with their spread
    Spectrum sample;    ///< of one record as the model makes them: what is missing has its full noise
};

/// Fills the gaps of a record with what the noise of a model makes there.
///
/// The expectation is exact, the spread about it is the mean square of a few draws. These are made of the same random
/// numbers whatever the model is, so that all depends smoothly on it; each draw is scaled to the mean of x^T P_mm x,
/// the number of unknowns, which takes away most of its chance: all of it where the missing rates are independent.
class Filling {
   public:
    /// \param rates  of a length that the spectrum has
    /// \param pairs  of solutions: twice as many less one are draws
    Filling(LossyRates rates, std::size_t pairs);

    /// \param noise  of the coefficients less their means
    /// \param means  of coefficients 1 to n - 1: ramp and sinusoids
    Filled fill(const CoefficientNoise& noise, const std::vector<double>& means);
    /// The record with straight lines across its gaps.
    const Spectrum& bridged() const { return bridged_; }
    const LossyRates& rates() const { return rates_; }
    double share_present() const;
    double draws() const { return 2.0 * static_cast<double>(conditional_.size()) - 1.0; }
    /// Whether the gaps have taken so much work that the record is better given up: about half a minute.
    bool too_hard() const;
    /// The rates with those that are missing as in the last sample.
    std::vector<double> completed() const;

   private:
    void solve(std::size_t pair, const CoefficientNoise& noise, const std::vector<double>& means);

    LossyRates rates_;
    Spectrum bridged_;
    std::vector<Conditional> conditional_;  ///< one for each pair
    std::vector<Pair> missing_;             ///< the last solutions, where the next ones begin
    std::vector<Pair> coefficients_;
    double scale_of_sample_ = 0.0;  ///< of the first draw
};

}  // namespace ringlock::noise
