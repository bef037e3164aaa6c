#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/allan/sums/pieces.hpp"

/// Sums of squares that the estimators are made of. They do not depend on the number of threads nor on the instruction
/// set: the order of the additions depends on the positions of the data alone.
namespace ringlock::allan {

/// How a difference is formed.
struct Difference {
    int order = 2;          ///< 1, 2 or 3
    bool skipping = false;  ///< leave out those that meet a NaN
};

/// A running sum of squares of differences. Thirty-two sums side by side, folded at the end: the same for any width of
/// a machine's vectors.
class DifferenceSums {
   public:
    /// Adds the differences that begin at x[0], ..., x[count - 1]; points up to x[count - 1 + order m] are read.
    void add(const double* x, Difference difference, std::size_t m, std::size_t count);
    SquareMean folded() const;

   private:
    alignas(64) std::array<double, 32> columns_{};
    std::int64_t terms_ = 0;
};

/// Squares of all differences of the given order and step m whose first point is one of x[first], ..., x[last - 1].
///
/// \param x      phase; points up to last - 1 + order m are read
/// \param first, last  where differences begin
SquareMean sum_of_differences(std::span<const double> x, Difference difference, std::size_t m, std::size_t first,
                              std::size_t last);

/// The same at every `stride`-th start from the first point on, as far as the record goes.
SquareMean sum_of_strided_differences(std::span<const double> x, Difference difference, std::size_t m,
                                      std::size_t stride);

/// The same at every start of the record, for many steps at once, in about two readings of the record where they are
/// octaves: steps that fit the cache are taken from pieces of the record, those beyond from columns of the record
/// written in rows of the least of them, where a long step is a few rows.
///
/// \param m  steps, in any order
/// \return one for each
std::vector<SquareMean> sums_of_differences(std::span<const double> x, Difference difference,
                                            std::span<const std::size_t> m);

}  // namespace ringlock::allan
