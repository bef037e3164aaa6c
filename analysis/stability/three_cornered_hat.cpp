#include "analysis/stability/three_cornered_hat.hpp"

#include <algorithm>
#include <cmath>

namespace ringlock::stability {
namespace {

const allan::Point* at_factor(std::span<const allan::Point> points, std::int64_t m) {
    const auto found = std::find_if(points.begin(), points.end(), [m](const allan::Point& p) { return p.m == m; });
    return found == points.end() ? nullptr : &*found;
}

}  // namespace

std::vector<HatPoint> three_cornered_hat(std::span<const allan::Point> ab, std::span<const allan::Point> ac,
                                         std::span<const allan::Point> bc) {
    std::vector<HatPoint> out;
    for (const allan::Point& p : ab) {
        const allan::Point* q = at_factor(ac, p.m);
        const allan::Point* r = at_factor(bc, p.m);
        if (q == nullptr || r == nullptr) continue;
        const double v_ab = p.dev * p.dev;
        const double v_ac = q->dev * q->dev;
        const double v_bc = r->dev * r->dev;
        // NaN of any stays NaN.
        const double edf = p.edf + q->edf + r->edf - std::max({p.edf + q->edf, p.edf + r->edf, q->edf + r->edf});
        HatPoint point{.m = p.m, .tau_s = p.tau_s};
        point.variance = {0.5 * (v_ab + v_ac - v_bc), 0.5 * (v_ab + v_bc - v_ac), 0.5 * (v_ac + v_bc - v_ab)};
        const std::array<double, 3> products = {v_ab * v_ac, v_ab * v_bc, v_ac * v_bc};
        for (std::size_t i = 0; i < 3; ++i) {
            point.standard_error[i] = std::sqrt((products[i] + point.variance[i] * point.variance[i]) / edf);
        }
        out.push_back(point);
    }
    return out;
}

}  // namespace ringlock::stability
