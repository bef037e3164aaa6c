#include "analysis/noise/model/rounding.hpp"

#include <cmath>
#include <limits>

namespace ringlock::noise {

bool only_rounding(const Spectrum& s, double largest_rate_unit) {
    double zz = 0.0;
    double dz = 0.0;
    double dd = 0.0;
    for (std::size_t j = 1; j <= s.z.size(); ++j) {
        zz += s.z[j - 1] * s.z[j - 1];
        dz += s.z[j - 1] * s.ramp(j);
        dd += s.ramp(j) * s.ramp(j);
    }
    const double slope = dz / dd;
    double rest = 0.0;
    for (std::size_t j = 1; j <= s.z.size(); ++j) {
        const double e = s.z[j - 1] - slope * s.ramp(j);
        rest += e * e;
    }
    const double count = static_cast<double>(s.z.size());
    constexpr double epsilon = std::numeric_limits<double>::epsilon();
    const double rounding = 4.0 * epsilon * largest_rate_unit + 1e-13 * std::sqrt(zz / count);
    return !(std::sqrt(rest / count) > rounding);
}

}  // namespace ringlock::noise
