#include "analysis/closure/stats/two_levels.hpp"

#include <algorithm>
#include <boost/math/special_functions/binomial.hpp>
#include <cmath>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"

namespace ringlock::closure {

TwoLevels two_levels(const Eigen::MatrixXd& normal, const Eigen::VectorXd& right) {
    const Eigen::Index n = right.size();
    const double floor = 1e-9 * normal.diagonal().maxCoeff();
    if (!(floor > 0.0)) return {};
    const double place = std::log(static_cast<double>(n - 1));
    const double of_levels = options.stats.two_levels.cost_of_levels;
    std::vector<int> high(static_cast<std::size_t>(n), 0);
    const auto level = [&](Eigen::Index k) { return high[static_cast<std::size_t>(k)]; };
    Eigen::VectorXd shape = Eigen::VectorXd::Zero(n);
    TwoLevels best;
    // Smaller gains are rounding errors, for which the search would not end.
    constexpr double gained = 1e-6;  // relative to the evidence
    const Eigen::Index most_steps = options.stats.two_levels.most_steps_per_stretch * n;
    for (Eigen::Index taken = 0; taken < most_steps; ++taken) {
        const Eigen::VectorXd pull = normal * shape;
        const double squares = shape.dot(pull);
        const double product = shape.dot(right);
        TwoLevels step = best;
        Eigen::Index from = 0;
        Eigen::Index to = 0;
        for (Eigen::Index a = 0; a < n; ++a) {
            double new_product = product;
            double new_squares = squares;
            Eigen::VectorXd cross = Eigen::VectorXd::Zero(n);  // normal times the exchanges so far
            for (Eigen::Index b = a; b < n; ++b) {
                const double sign = 1.0 - 2.0 * level(b);
                new_product += sign * right(b);
                new_squares += sign * 2.0 * (pull(b) + cross(b)) + normal(b, b);
                cross += sign * normal.col(b);
                if (new_squares < floor) continue;
                // Either end of the range gets a jump where there was none, and loses it where there was one.
                int changes = best.changes;
                if (a > 0) changes += level(a) == level(a - 1) ? 1 : -1;
                if (b + 1 < n) changes += level(b) == level(b + 1) ? 1 : -1;
                if (changes == 0) continue;
                const double chi2 = new_product * new_product / new_squares;
                const double cost = of_levels + changes * place;
                const double evidence = 0.5 * chi2 - cost;
                if (!(evidence > step.evidence)) continue;
                step = {chi2, changes, evidence, cost};
                from = a;
                to = b;
            }
        }
        if (!(step.evidence > best.evidence + gained * std::abs(best.evidence))) break;
        best = step;
        for (Eigen::Index k = from; k <= to; ++k) {
            high[static_cast<std::size_t>(k)] ^= 1;
            shape(k) = level(k);
        }
    }
    if (best.changes == 0) return {};
    const auto changes = static_cast<unsigned>(best.changes);
    const double paths = boost::math::binomial_coefficient<double>(static_cast<unsigned>(n - 1), changes) *
                         std::exp2(static_cast<double>(changes));
    best.shape = shape;
    best.p_value = of_several(chi2_tail(best.chi2, 1), paths);
    return best;
}

}  // namespace ringlock::closure
