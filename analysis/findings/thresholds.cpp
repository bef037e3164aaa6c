#include "analysis/findings/thresholds.hpp"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>

namespace ringlock::findings {

double normal_threshold(double level, std::size_t n) {
    return boost::math::quantile(boost::math::complement(boost::math::normal(), 0.5 * level / static_cast<double>(n)));
}

Best best_of(const Scan& found, double least, std::size_t from, std::size_t to) {
    Best best;
    for (std::size_t t = from; t < std::min(to, found.sigma.size()); ++t) {
        const double excess = std::abs(found.sigma[t]) - least;
        if (excess > best.excess) best = {t, excess};
    }
    return best;
}

}  // namespace ringlock::findings
