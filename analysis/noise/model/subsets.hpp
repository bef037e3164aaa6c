#pragma once
#include <array>
#include <limits>
#include <vector>

#include "analysis/noise/model/likelihood.hpp"

namespace ringlock::noise {

/// Sets of terms as bits: bit i is Term i, the last one the ramp.
using Mask = std::size_t;
inline constexpr Mask ramp_bit = Mask{1} << term_count;
inline constexpr Mask correlated_bit = Mask{1} << correlated;
inline constexpr Mask five_terms = (ramp_bit | (ramp_bit - 1)) & ~correlated_bit;  ///< all but the correlated noise

Model model_of(Mask mask);

/// What a term must lower the deviance by.
struct Prices {
    /// Half a chi-squared with one degree of freedom: a variance on its boundary.
    std::array<double, noise::correlated> variance{};
    double ramp = 0.0;                                            ///< chi-squared with one degree of freedom
    double correlated = std::numeric_limits<double>::infinity();  ///< also for the search over its time

    double of(Mask bit) const;
    double of_all(Mask mask) const;
};

/// All subsets of some terms at their maxima.
class Subsets {
   public:
    /// \param all    terms there may be
    /// \param start  where to begin with sets that have correlated noise
    Subsets(const Likelihood& likelihood, Mask all, const Parameters& start);

    const Maximum& operator[](Mask mask) const { return fits_[mask]; }
    Mask all() const { return all_; }
    /// The set of least deviance plus prices among those that hold `wanted`.
    Mask best(const Prices& prices, Mask wanted = 0) const;
    /// By how much the deviance rises when a term is left out of all.
    double evidence(Mask bit) const { return fits_[all_ & ~bit].deviance - fits_[all_].deviance; }

   private:
    bool is_model(Mask mask) const { return (mask & ~all_) == 0 && (mask & ~ramp_bit) != 0; }

    Mask all_;
    std::vector<Maximum> fits_;
};

}  // namespace ringlock::noise
