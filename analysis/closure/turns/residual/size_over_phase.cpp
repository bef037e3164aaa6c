#include "analysis/closure/turns/residual/size_over_phase.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/special_functions/erf.hpp>
#include <cmath>
#include <numbers>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/stats/whiteness.hpp"
#include "analysis/closure/turns/model/kicks.hpp"
#include "analysis/closure/turns/model/phase_table.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// The normal deviate that is as rare as an innovation of this size, in standard deviations. Squares would give too
/// much weight to a few rare phases.
double size_deviate(double size) {
    const double rarity = std::erfc(size / std::numbers::sqrt2);
    return std::numbers::sqrt2 * boost::math::erfc_inv(2.0 * std::clamp(rarity, 1e-300, 1.0 - 1e-15));
}

/// The size that has this deviate.
double size_of(double deviate) {
    return std::numbers::sqrt2 * boost::math::erfc_inv(0.5 * std::erfc(deviate / std::numbers::sqrt2));
}

/// Cosine and sine of a phase and of its double.
using Harmonics = Eigen::Vector4d;
Harmonics harmonics_of(double phase_rad) {
    return {std::cos(phase_rad), std::sin(phase_rad), std::cos(2.0 * phase_rad), std::sin(2.0 * phase_rad)};
}

/// Means of harmonics of the phase psi times the size's deviate, as a function of the predicted phase. The innovation
/// is a part of the phase, so that sizes follow the phase even if no effect is missing where the predicted phases
/// repeat turn after turn:
///
///     psi = predicted + sd (normal innovation) + before(psi),
///
/// with before the phase that the lock-in adds before the turn.
PhaseTable<Harmonics> size_by_phase(const TurnKicks& kicks, int direction, double sd_rad) {
    constexpr double end = 5.0;
    const int points = static_cast<int>(std::ceil(2.0 * end * std::max(2.0, 2.0 * sd_rad)));
    const double step = 2.0 * end / points;
    return PhaseTable<Harmonics>([&](double predicted_rad) {
        Harmonics mean = Harmonics::Zero();
        for (int k = 0; k <= points; ++k) {
            const double deviate = k * step - end;
            const double weight = 0.5 * deviate * step * std::exp(-0.5 * deviate * deviate) / std::sqrt(units::two_pi);
            const double size_rad = sd_rad * size_of(deviate);
            for (const double innovation_rad : {size_rad, -size_rad}) {
                mean += weight * harmonics_of(kicks.phase_after(direction, predicted_rad + innovation_rad));
            }
        }
        return mean;
    });
}

}  // namespace

ResidualTest size_over_phase(const TurnFit& fit) {
    const auto& e = fit.innovations();
    const auto& rows = fit.rows();
    const std::size_t n = e.size();
    const double sd = std::sqrt(squares_of(e, rows).mean);
    const auto& phase = fit.model().phase_rad();
    const auto& series = fit.model().series();
    const TurnKicks kicks = fit.model().mean_kicks(fit.parameters());
    std::vector<double> size(n);
    std::vector<double> sd_rad(n);  // without the phase that the lock-in adds before the turn
    std::vector<double> predicted(n);
    double mean_size = 0.0;
    double mean_sd_rad = 0.0;
    double counted = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        if (!rows[i]) continue;
        size[i] = size_deviate(std::abs(e[i]) / sd);
        const TurnKicks::Kick kick = kicks.at(series.direction[i], phase[i]);
        sd_rad[i] = fit.sd_rad()[i] * std::abs(1.0 - fit.prediction().frame.before_slope[i]);
        predicted[i] = phase[i] - kick.before_rad - sd_rad[i] * e[i];
        mean_size += size[i];
        mean_sd_rad += sd_rad[i];
        counted += 1.0;
    }
    mean_size /= counted;
    mean_sd_rad /= counted;
    const PhaseTable<Harmonics> at_minima = size_by_phase(kicks, 1, mean_sd_rad);
    const PhaseTable<Harmonics> at_maxima = size_by_phase(kicks, -1, mean_sd_rad);
    const Eigen::Index columns = 8;
    Eigen::VectorXd right = Eigen::VectorXd::Zero(columns);
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(columns, columns);
    for (std::size_t i = 0; i < n; ++i) {
        if (!rows[i]) continue;
        const int direction = series.direction[i];
        const Harmonics more =
            harmonics_of(phase[i]) * (size[i] - mean_size) - (direction > 0 ? at_minima : at_maxima).at(predicted[i]);
        Eigen::VectorXd row(columns);
        row << more, static_cast<double>(direction) * more;
        right += row;
        covariance += row * row.transpose();
    }
    const dense::SymmetricEigen axes = dense::symmetric_eigen(covariance);
    double folded = 0.0;
    int freedom = 0;
    for (Eigen::Index k = 0; k < columns; ++k) {
        if (axes.values(k) < options.turns.residual.least_direction * axes.values.maxCoeff()) continue;
        const double along = axes.vectors.col(k).dot(right);
        folded += along * along / axes.values(k);
        ++freedom;
    }
    return {Where::phase, "size of the residual over the turn's phase", chi2_tail(folded, freedom), ""};
}

}  // namespace ringlock::closure
