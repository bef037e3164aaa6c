#include "analysis/allan/total_sums.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>

namespace ringlock::allan {
namespace {

/// The mean of the second half of 3m samples less that of the first, over the distance between the middles of the
/// halves. An odd sample in the middle belongs to none.
double half_slope(const double* sums, std::size_t size) {
    const std::size_t half = size / 2;
    const double first = sums[half] - sums[0];
    const double second = sums[size] - sums[size - half];
    const auto distance = static_cast<double>(size - half);
    return (second - first) / static_cast<double>(half) / distance;
}

/// Mean square of the differences of one piece.
///
/// \param sums    sums over all samples before each: 3m + 1
/// \param mirror  room for 9m + 1
double piece(const double* sums, std::size_t m, std::vector<double>& mirror) {
    const std::size_t size = 3 * m;
    const double slope = half_slope(sums, size);
    double* q = mirror.data();
    const double middle = 0.5 * static_cast<double>(size - 1);
    // Sums of the piece less its line, which is taken through zero in the middle.
    for (std::size_t i = 0; i <= size; ++i) {
        const auto k = static_cast<double>(i);
        q[i] = (sums[i] - sums[0]) - slope * k * (0.5 * (k - 1.0) - middle);
    }
    // Piece, mirror image, piece: one period of 6m of the piece mirrored on and on, and what its last terms reach.
    const double all = q[size];
    for (std::size_t i = 1; i <= size; ++i) q[size + i] = 2.0 * all - q[size - i];
    for (std::size_t i = 1; i <= size; ++i) q[2 * size + i] = 2.0 * all + q[i];
    SquareMean total;
    constexpr std::size_t columns = 8;
    double squares[columns] = {};
    for (std::size_t i = 0; i < 2 * size; i += columns) {
        const std::size_t there = std::min(columns, 2 * size - i);
        for (std::size_t c = 0; c < there; ++c) {
            const double* at = q + i + c;
            const double z = (at[3 * m] - at[0]) - 3.0 * (at[2 * m] - at[m]);
            squares[c] += z * z;
        }
    }
    const double sum = ((squares[0] + squares[4]) + (squares[1] + squares[5])) +
                       ((squares[2] + squares[6]) + (squares[3] + squares[7]));
    const auto n = static_cast<double>(m);
    return sum / (2.0 * static_cast<double>(size)) / (n * n);
}

}  // namespace

Reflected::Reflected(const Phase& phase) {
    const std::size_t n = phase.x.size();
    if (n < 3) return;
    const std::size_t beyond = n - 1;
    first_ = beyond;
    last_ = first_ + n - 1;
    x_.resize(n + 2 * beyond);
    for (std::size_t i = 0; i < n; ++i) x_[first_ + i] = phase.x[i];
    for (std::size_t j = 1; j <= beyond; ++j) {
        x_[first_ - j] = 2.0 * phase.x.front() - phase.x[j];
        x_[last_ + j] = 2.0 * phase.x.back() - phase.x[n - 1 - j];
    }
    skipping_ = !phase.whole() && phase.one_origin;
    if (phase.one_origin) {
        joined_ = {{0, x_.size()}};
        return;
    }
    // The first stretch goes on in its image, and so does the last; the others stand alone, and so do their images.
    const std::size_t count = phase.stretches.size();
    for (std::size_t k = 0; k < count; ++k) {
        const Stretch& s = phase.stretches[k];
        joined_.push_back({k == 0 ? first_ - (s.end - 1) : first_ + s.begin,
                           k + 1 == count ? last_ + (n - s.begin) : first_ + s.end});
    }
}

SquareMean Reflected::sum(std::size_t m) const {
    SquareMean total;
    for (const Stretch& part : joined_) {
        // A difference about c has its first point at c - m; c runs over the inner points of the record.
        const std::size_t from = std::max(part.begin, first_ + 1 > m ? first_ + 1 - m : 0);
        const std::size_t room = part.size() > 2 * m ? part.end - 2 * m : part.begin;
        const std::size_t to = std::min(room, last_ > m ? last_ - m : 0);
        if (to > from) total += sum_of_differences(x_, {.order = 2, .skipping = skipping_}, m, from, to);
    }
    return total;
}

SquareMean sum_of_pieces(std::span<const double> x, std::size_t m) {
    const std::size_t size = 3 * m;
    if (m == 0 || x.size() < size) return {};
    const std::size_t pieces = x.size() - size + 1;
    // Sums are begun anew every few pieces, so that they stay as small as the samples let them.
    const std::size_t batch = size + 16;
    const std::size_t batches = (pieces + batch - 1) / batch;
    std::vector<double> parts(batches, 0.0);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, batches, 1),
                      [&](const tbb::blocked_range<std::size_t>& range) {
                          std::vector<double> sums(batch + size + 1);
                          std::vector<double> mirror(3 * size + 1);
                          for (std::size_t b = range.begin(); b < range.end(); ++b) {
                              const std::size_t first = b * batch;
                              const std::size_t there = std::min(batch, pieces - first);
                              const double origin = x[first];
                              sums[0] = 0.0;
                              for (std::size_t i = 0; i < there - 1 + size; ++i)
                                  sums[i + 1] = sums[i] + (x[first + i] - origin);
                              for (std::size_t i = 0; i < there; ++i) parts[b] += piece(sums.data() + i, m, mirror);
                          }
                      });
    SquareMean total{0.0, static_cast<std::int64_t>(pieces)};
    for (const double part : parts) total.sum += part;
    return total;
}

}  // namespace ringlock::allan
