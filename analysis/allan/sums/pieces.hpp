#pragma once
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

/// Work on a long record, cut into pieces whose sums do not depend on the thread that computes them.
namespace ringlock::allan {

/// Sum of squares, and how many.
struct SquareMean {
    double sum = 0.0;
    std::int64_t terms = 0;
    SquareMean& operator+=(const SquareMean& other) {
        sum += other.sum;
        terms += other.terms;
        return *this;
    }
};

/// Starts of differences in a piece of a record: together with the points that the differences reach, up to 5 x 8192, a
/// piece fits a second-level cache.
inline constexpr std::size_t piece_starts = 16384;

/// Running sums side by side, independent of the width of a vector: term i goes to the (i mod 32)-th.
using Columns = std::array<double, 32>;

inline double folded_sum(Columns part) {
    for (std::size_t half = part.size() / 2; half > 0; half /= 2) {
        for (std::size_t i = 0; i < half; ++i) part[i] += part[i + half];
    }
    return part[0];
}

/// Adds up neighbours, then pairs of pairs: rounding grows with the logarithm of their number.
inline SquareMean pairwise(std::vector<SquareMean> parts) {
    if (parts.empty()) return {};
    for (std::size_t n = parts.size(); n > 1; n = (n + 1) / 2) {
        for (std::size_t i = 0; i < n / 2; ++i) {
            parts[i] = parts[2 * i];
            parts[i] += parts[2 * i + 1];
        }
        if (n % 2 == 1) parts[n / 2] = parts[n - 1];
    }
    return parts.front();
}

/// Calls work(piece) for 0...pieces-1 on all threads.
template <class Work>
void for_pieces(std::size_t pieces, const Work& work) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pieces, 1), [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t piece = range.begin(); piece < range.end(); ++piece) work(piece);
    });
}

}  // namespace ringlock::allan
