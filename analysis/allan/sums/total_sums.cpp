#include "analysis/allan/sums/total_sums.hpp"

#include <algorithm>

namespace ringlock::allan {
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

}  // namespace ringlock::allan
