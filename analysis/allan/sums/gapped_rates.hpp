#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "analysis/allan/sums/phase.hpp"
#include "analysis/allan/sums/pieces.hpp"

namespace ringlock::allan {

/// Mean rates over a tau of which a few samples are missing.
///
/// Phase cannot be followed across a missing rate or increment, but the mean of the others determines the mean rate
/// nearly as well. A mean counts where nine tenths of its samples are there: below ten samples all of them. It is the
/// mean of the samples that are there, so that missing samples are not replaced by any value; white noise then shows
/// the variance of as many samples as there are, at most a ninth more.
class GappedRates {
   public:
    /// \param phase  of increments or rates with gaps
    explicit GappedRates(const Phase& phase);

    /// Squares of differences of neighbouring means over m, times m^2 as differences of phase are: order 2 y_1 - y_0,
    /// order 3 y_2 - 2 y_1 + y_0; at every stride-th start.
    SquareMean sum(int order, std::size_t m, std::size_t stride) const;

   private:
    std::vector<double> sums_;          ///< of the samples that are there before each point, less the mean of all
                                        ///< samples
    std::vector<std::int64_t> counts_;  ///< how many those are
};

}  // namespace ringlock::allan
