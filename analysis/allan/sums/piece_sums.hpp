#pragma once
#include <cstddef>
#include <span>

#include "analysis/allan/sums/pieces.hpp"

namespace ringlock::allan {

/// The sums of the modified total deviation (NIST SP1065 section 5.2.12) and, of frequencies, the Hadamard total
/// deviation (5.2.14): every piece of 3m samples less the line through the means of its halves, continued by its mirror
/// image at both ends; the mean square of the 6m second differences of neighbouring means over m that it has.
///
/// Costs the same for every m (docs/dev/allan-totals.md): pieces that overlap are summed together.
///
/// \param x  samples without gaps
/// \param m  averaging factor; >= 1
/// \return over all pieces: sum of mean squares, in the unit of x squared, and how many pieces
SquareMean sum_of_pieces(std::span<const double> x, std::size_t m);

/// The same piece by piece and difference by difference, as the definition stands, at a cost of 6m a piece. Short
/// pieces are summed in this way, and the faster sums of longer ones are compared with it.
SquareMean sum_of_single_pieces(std::span<const double> x, std::size_t m);

}  // namespace ringlock::allan
