#pragma once
#include <cstdint>
#include <optional>

#include "analysis/lot/confidence.hpp"

namespace ringlock::lot {

/// k gyros of n, such as those within a limit (yield).
struct Share {
    std::int64_t k = 0;
    std::int64_t n = 0;
    std::optional<double> value;       ///< k/n; absent where n = 0
    std::optional<Interval> interval;  ///< of the population's share; absent where n = 0

    /// Half the interval's width. k/n is not in the middle, so that the farther end may be up to twice as far away.
    std::optional<double> half_width() const;
};

/// The share with its exact interval (C. J. Clopper, E. S. Pearson, Biometrika 26, 404, 1934): the ends are the shares
/// under which k or more, and k or fewer, have tail_probability() each; 0 where k = 0, and 1 where k = n.
///
/// \param k  gyros that count, 0 ... n
/// \param n  gyros in all, 0 or more
/// Throws InputError where k or n is outside, or the level is not in (0, 1).
Share share(std::int64_t k, std::int64_t n, const Confidence& confidence = {});

}  // namespace ringlock::lot
