// Results of a fit: parameters with their errors, and scores of series that the model does not contain.
#include <algorithm>
#include <cmath>
#include <optional>

#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

Eigen::MatrixXd TurnFit::whitened_columns(Eigen::VectorXd& scale) const {
    const auto column_of = [this](std::size_t k) -> const Regressor& { return columns_[k].of; };
    return counted(*whitening_, prediction_.frame, columns_.size(), column_of, scale);
}

/// Observed information, in units of the columns' norms. Squares of whitened columns are equal to it with one
/// exception: the column of a threshold contains the response of the lock-in to a reading's error, which is correlated
/// with the error itself and is no information, since the variance of the innovation changes likewise.
Eigen::MatrixXd TurnFit::information(Eigen::VectorXd& scale) const {
    constexpr double part = 0.1;  // of a standard error
    const Eigen::MatrixXd x = whitened_columns(scale);
    const Eigen::MatrixXd squares = x.transpose() * x;
    Eigen::MatrixXd normal = squares;
    const TurnNoise noise = model_->noise(parameters_);
    const auto count = static_cast<Eigen::Index>(columns_.size());
    for (Eigen::Index k = 0; k < count; ++k) {
        const Regressor& of = columns_[static_cast<std::size_t>(k)].of;
        if (of.slope.empty()) continue;
        const auto slopes_at = [&](double value) {
            TurnFrame frame = prediction_.frame;
            std::vector<double> rest = rest_;
            of.take(value, rest, frame);
            const Whitening whitening(frame, noise);
            const Eigen::VectorXd y = counted(whitening, rest);
            Eigen::VectorXd slopes(count);
            for (Eigen::Index j = 0; j < count; ++j) {
                const Regressor& by = columns_[static_cast<std::size_t>(j)].of;
                slopes(j) = by.slope.empty() ? counted(whitening, frame, by).dot(y)
                                             : slope_of_objective(frame, rest, by, 1e-3 / scale(j));
            }
            return Eigen::VectorXd(slopes.cwiseQuotient(scale));
        };
        normal.col(k) = (slopes_at(-part / scale(k)) - slopes_at(part / scale(k))) / (2.0 * part);
        normal.row(k) = normal.col(k).transpose();
    }
    add_priors(scale, normal, nullptr);
    if (dense::is_positive(normal)) return normal;
    normal = squares;  // at the end of a range, or where no row is informative
    add_priors(scale, normal, nullptr);
    return normal;
}

const std::vector<Estimate>& TurnFit::estimates() const {
    const std::lock_guard lock(estimating_);
    if (!estimates_) estimates_ = estimate();
    return *estimates_;
}

std::vector<Estimate> TurnFit::estimate() const {
    ready();
    Eigen::VectorXd scale;
    const Eigen::MatrixXd normal = information(scale);
    const Eigen::MatrixXd covariance = dense::inverse_of_symmetric(normal);
    TurnParameters found = parameters_;
    std::vector<Estimate> estimates;
    for (std::size_t k = nuisances(); k < columns_.size(); ++k) {
        Estimate estimate{columns_[k].effect, columns_[k].name, 0.0, 0.0};
        const auto index = static_cast<Eigen::Index>(k);
        estimate.sd = std::sqrt(std::max(covariance(index, index), 0.0)) / scale(index);
        if (estimate.effect.empty()) {
            estimate.value = estimate.name == "bias_deg_h" ? parameters_.bias_deg_h : parameters_.threshold_deg_h;
        } else {
            estimate.value = found.find(estimate.effect)->values.at(estimate.name);
        }
        estimates.push_back(std::move(estimate));
    }
    // Times and phases refer to the record's clock, which need not begin with the first turn.
    const double start_s = model_->series().start_s;
    for (const ActiveEffect& active : parameters_.effects) {
        std::optional<std::size_t> frequency;
        std::optional<std::size_t> phase;
        for (const effects::Parameter& parameter : active.effect->parameters()) {
            for (std::size_t k = 0; k < estimates.size(); ++k) {
                if (estimates[k].effect != active.effect->name() || estimates[k].name != parameter.name) continue;
                if (parameter.role == effects::Role::time) estimates[k].value += start_s;
                if (parameter.role == effects::Role::frequency) frequency = k;
                if (parameter.role == effects::Role::phase) phase = k;
            }
        }
        if (!frequency || !phase) continue;
        const auto f = static_cast<Eigen::Index>(nuisances() + *frequency);
        const auto p = static_cast<Eigen::Index>(nuisances() + *phase);
        const double turned = units::two_pi * start_s;
        estimates[*phase].value =
            std::remainder(estimates[*phase].value - turned * estimates[*frequency].value, units::two_pi);
        const double variance = covariance(p, p) / (scale(p) * scale(p)) +
                                turned * turned * covariance(f, f) / (scale(f) * scale(f)) -
                                2.0 * turned * covariance(p, f) / (scale(p) * scale(f));
        estimates[*phase].sd = std::sqrt(std::max(variance, 0.0));
    }
    add_noise_estimates(estimates);
    return estimates;
}

TurnFit::Regression TurnFit::regress(const std::vector<Regressor>& regressors, const TurnParameters& noise) const {
    constexpr double gained = 0.01;  // of the log-likelihood, by another pass
    ready();
    Regression regression{0.0, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(regressors.size()))};
    TurnParameters trial = noise;
    TurnFrame frame = prediction_.frame;
    std::vector<double> rest = rest_;
    const std::size_t own = columns_.size();
    const auto column_of = [&](std::size_t k) -> const Regressor& {
        return k < own ? columns_[k].of : regressors[k - own];
    };
    const double before = objective(parameters_, rest_);
    for (int pass = 0; pass < options.turns.fit.most_regression_passes; ++pass) {
        const Whitening whitening(frame, model_->noise(trial));
        const Eigen::VectorXd y = counted(whitening, rest);
        Eigen::VectorXd scale;
        const Eigen::MatrixXd x = counted(whitening, frame, own + regressors.size(), column_of, scale);
        const Eigen::MatrixXd normal = x.transpose() * x;
        const Eigen::VectorXd right = x.transpose() * y;
        const Eigen::VectorXd value = dense::MinimumNorm(normal).solve(right).cwiseQuotient(scale);
        for (std::size_t k = 0; k < own + regressors.size(); ++k) {
            column_of(k).take(value(static_cast<Eigen::Index>(k)), rest, frame);
        }
        regression.value += value.tail(static_cast<Eigen::Index>(regressors.size()));
        trial = with_noise_of(frame, trial, rest);
        const double gain = before - objective(frame, trial, rest);
        const bool arrived = pass > 0 && gain - regression.gain < gained;
        regression.gain = gain;
        if (arrived) break;
    }
    regression.noise = std::move(trial);
    return regression;
}

Eigen::VectorXd TurnFit::whitened(const Regressor& regressor) const {
    const Eigen::MatrixXd& own = basis();
    Eigen::VectorXd column = counted(*whitening_, prediction_.frame, regressor);
    const double all = column.norm();
    column -= own * (own.transpose() * column);
    if (column.norm() < options.turns.fit.least_independent_share * all) column.setZero();
    return column;
}

Eigen::VectorXd TurnFit::residual() const { return below(ready().innovations_, -1.0); }

TurnFit::Score TurnFit::score(const std::vector<Regressor>& regressors) const {
    return score_whitened(regressors.size(), [&](std::size_t k) { return whitened(regressors[k]); });
}

TurnFit::Score TurnFit::score(std::size_t count, const std::function<Regressor(std::size_t)>& regressor) const {
    return score_whitened(count, [&](std::size_t k) { return whitened(regressor(k)); });
}

TurnFit::Score TurnFit::score_whitened(std::size_t count,
                                       const std::function<Eigen::VectorXd(std::size_t)>& column) const {
    basis();
    Eigen::MatrixXd x(static_cast<Eigen::Index>(2 * rows_.size()), static_cast<Eigen::Index>(count));
    side_by_side(count, [&](std::size_t k) { x.col(static_cast<Eigen::Index>(k)) = column(k); });
    return score_of({x.transpose() * x, x.transpose() * residual()});
}

TurnFit::Score TurnFit::score_of(const Products& products) {
    Score score;
    const dense::MinimumNorm decomposition(products.squares);
    score.covariance = decomposition.pseudo_inverse();
    score.value = score.covariance * products.right;
    score.chi2 = products.right.dot(score.value);
    score.rank = static_cast<int>(decomposition.rank());
    return score;
}

/// In two passes of the filter: the first determines the part of each series along the model's own columns, and the
/// second removes it.
TurnFit::Products TurnFit::products(std::size_t count, const Piece& piece) const {
    constexpr std::size_t turns_at_once = 1024;
    constexpr Eigen::Index columns_at_once = 24;  // of the lower triangle, so that all parts take equal time
    const Eigen::MatrixXd& own = basis();
    const std::size_t n = rows_.size();
    const auto series = static_cast<Eigen::Index>(count);
    const auto turns = static_cast<Eigen::Index>(n);
    Eigen::MatrixXd white(static_cast<Eigen::Index>(turns_at_once), series);
    const auto each_piece = [&](const auto& work) {
        std::vector<FilterState> states(count);
        for (std::size_t first = 0; first < n; first += turns_at_once) {
            const std::size_t some = std::min(turns_at_once, n - first);
            side_by_side(count, [&](std::size_t k) {
                double* const column = &white(0, static_cast<Eigen::Index>(k));
                piece(k, first, {column, some});
                whitening_->apply(first, {column, some}, states[k]);
                for (std::size_t i = 0; i < some; ++i) {
                    if (!rows_[first + i]) column[i] = 0.0;
                }
            });
            work(static_cast<Eigen::Index>(first), white.topRows(static_cast<Eigen::Index>(some)));
        }
    };
    Eigen::MatrixXd share = Eigen::MatrixXd::Zero(own.cols(), series);
    Eigen::VectorXd all = Eigen::VectorXd::Zero(series);
    each_piece([&](Eigen::Index first, const auto& part) {
        share.noalias() += own.middleRows(first, part.rows()).transpose() * part;
        all += part.colwise().squaredNorm().transpose();
    });
    Products found{Eigen::MatrixXd::Zero(series, series), Eigen::VectorXd::Zero(series)};
    // Rows of |1 - before'| contain only the part that is removed with the model's own columns.
    const auto below = own.bottomRows(turns);
    Eigen::MatrixXd lower = share.transpose() * (below.transpose() * below) * share;
    found.right = share.transpose() * (below.transpose() * residual().tail(turns)) * -1.0;
    const Eigen::Map<const Eigen::VectorXd> innovations(innovations_.data(), turns);
    each_piece([&](Eigen::Index first, const auto& part) {
        const Eigen::Index some = part.rows();
        const auto tiles = (series + columns_at_once - 1) / columns_at_once;
        white.topRows(some).noalias() -= own.middleRows(first, some) * share;
        side_by_side(tiles, [&](Eigen::Index tile) {
            const Eigen::Index from = tile * columns_at_once;
            const Eigen::Index wide = std::min(columns_at_once, series - from);
            lower.block(from, from, series - from, wide).noalias() +=
                white.topRows(some).rightCols(series - from).transpose() * white.topRows(some).middleCols(from, wide);
        });
        // Rows that do not count are zero in the series and in the model's own columns.
        found.right.noalias() += white.topRows(some).transpose() * innovations.segment(first, some);
    });
    found.squares = lower.selfadjointView<Eigen::Lower>();
    for (Eigen::Index k = 0; k < series; ++k) {
        if (std::sqrt(found.squares(k, k)) >= options.turns.fit.least_independent_share * std::sqrt(all(k))) continue;
        found.squares.row(k).setZero();
        found.squares.col(k).setZero();
        found.right(k) = 0.0;
    }
    return found;
}

}  // namespace ringlock::closure
