#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "analysis/allan/difference_sums.hpp"
#include "analysis/allan/phase.hpp"
#include "analysis/allan/pieces.hpp"

namespace ringlock::allan {

/// Phase with its mirror image, turned around at the ends: x_{-j} = 2 x_0 - x_j and alike at the other end, as the
/// total deviation wants it (NIST SP1065 section 5.2.11).
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

/// The sums of the modified total deviation (SP1065 section 5.2.12) and, of frequencies, the Hadamard total deviation
/// (5.2.14): every piece of 3m samples less the line through the means of its halves, continued by its mirror image at
/// both ends; the mean square of the 6m second differences of neighbouring means over m that it has. Costs 6m a piece.
///
/// \return over all pieces: sum of mean squares, and how many pieces
SquareMean sum_of_pieces(std::span<const double> x, std::size_t m);

}  // namespace ringlock::allan
