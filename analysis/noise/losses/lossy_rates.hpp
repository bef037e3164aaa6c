#pragma once
#include <cstddef>
#include <vector>

#include "analysis/allan/sums/phase.hpp"

namespace ringlock::noise {

/// Consecutive rates [begin, end) that are missing.
struct Gap {
    std::size_t begin = 0;
    std::size_t end = 0;
    /// Whether the mean of these rates is known, because the angle is on both sides of them.
    bool mean_known = false;

    std::size_t size() const { return end - begin; }
    std::size_t unknowns() const { return size() - (mean_known ? 1 : 0); }
};

/// Consecutive mean rates, some of which are missing.
struct LossyRates {
    /// One for each interval; those that are missing hold their known mean, or lie on a line from one neighbour to the
    /// other.
    std::vector<double> rate;
    std::vector<Gap> gaps;  ///< ascending

    std::size_t unknowns() const;
    /// The first n of them. A gap that ends beyond loses its mean.
    LossyRates first(std::size_t n) const;
};

/// Rates of a phase with gaps, in its unit per second.
///
/// A missing angle loses two rates but not their sum; a missing rate or increment loses itself.
/// \param phase   as allan::phase_of() makes it
/// \param tau0_s  sampling interval [s], > 0
LossyRates lossy_rates(const allan::Phase& phase, double tau0_s);

}  // namespace ringlock::noise
