#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "analysis/allan/sums/difference_sums.hpp"
#include "analysis/allan/sums/phase.hpp"
#include "analysis/allan/sums/pieces.hpp"

namespace ringlock::allan {

/// Phase with its mirror image, turned around at the ends: x_{-j} = 2 x_0 - x_j and alike at the other end, as the
/// total deviation requires (NIST SP1065 section 5.2.11).
class Reflected {
   public:
    explicit Reflected(const Phase& phase);

    /// Squares of the second differences of step m about every inner point of the record.
    SquareMean sum(std::size_t m) const;

   private:
    std::vector<double> x_;
    std::vector<Stretch> joined_;  ///< parts across which differences may reach
    std::size_t first_ = 0;        ///< the record's first point in x_
    std::size_t last_ = 0;
    bool skipping_ = false;
};

}  // namespace ringlock::allan
