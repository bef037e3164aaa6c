#include <algorithm>
#include <cmath>

#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/closure/turns/model/effect_roles.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

/// The steps by which a fit of turns approaches its maximum: equations of one step, its length and its bounds.
namespace ringlock::closure {

namespace {

/// Whether the size has a phase, so that it may take either sign during the fit.
bool is_turned(const effects::Effect& effect, const effects::Parameter& size) {
    const std::vector<Amplitude> amplitudes = amplitudes_of(effect);
    return std::any_of(amplitudes.begin(), amplitudes.end(),
                       [&](const Amplitude& a) { return a.value == &size && a.turned_by != nullptr; });
}

}  // namespace

/// Fits offset and amplitude, which have no start values, with the start values of the noise.
void TurnFit::fit_nuisances() {
    set_rest(prediction_);
    const Whitening whitening(prediction_.frame, model_->noise(parameters_));
    const Eigen::VectorXd y = counted(whitening, rest_);
    Eigen::MatrixXd x(y.size(), nuisance_.size());
    for (std::size_t k = 0; k < nuisance_.size(); ++k) {
        x.col(static_cast<Eigen::Index>(k)) = counted(whitening, prediction_.frame, columns_[k].of);
    }
    const Eigen::VectorXd step = dense::least_squares(x, y);
    for (std::size_t k = 0; k < nuisance_.size(); ++k) nuisance_[k] += step(static_cast<Eigen::Index>(k));
    set_rest(prediction_);
}

void TurnFit::fit_deterministic(int most) {
    for (int pass = 0; pass < most; ++pass) {
        // Columns of a point so near that another step gains nothing remain valid.
        if (moved_) find_columns();
        moved_ = false;
        set_rest(prediction_);
        TurnParameters guess = parameters_;
        const bool guessed = guess.injected_sd_rad == 0.0;
        if (guessed) {
            guess.injected_sd_rad = 1.0;
            guess.wander_sd_rad = 1e-3;
        }
        TurnNoise noise = model_->noise(guess);
        // No noise has been fitted yet: a radian a turn, so that a random wander does not hide the kicks.
        if (guessed) noise.white_rad2_per_s = 1.0 / model_->series().interval_s;
        const Whitening whitening(prediction_.frame, noise);
        moved_ = go_down(equations(whitening, guessed), guessed ? &whitening : nullptr);
        if (!moved_) break;
    }
}

TurnFit::Equations TurnFit::equations(const Whitening& whitening, bool guessed) const {
    const std::size_t count = solved();
    const Eigen::VectorXd y = counted(whitening, rest_);
    // With a noise that is only guessed |1 - before'| does not compensate.
    const Eigen::Index used = guessed ? y.size() / 2 : y.size();
    Eigen::VectorXd scale;
    const auto column_of = [this](std::size_t k) -> const Regressor& { return columns_[k].of; };
    Eigen::MatrixXd x = counted(whitening, prediction_.frame, count, column_of, scale);
    if (!guessed) follow_gains(whitening, x, scale);
    Eigen::MatrixXd normal = x.topRows(used).transpose() * x.topRows(used);
    Eigen::VectorXd right = x.topRows(used).transpose() * y.head(used);
    for (std::size_t k = 0; k < count && !guessed; ++k) {
        if (columns_[k].of.slope.empty()) continue;
        const auto index = static_cast<Eigen::Index>(k);
        right(index) = slope_of_objective(prediction_.frame, rest_, columns_[k].of, 1e-3 / scale(index)) / scale(index);
    }
    add_priors(scale, normal, &right);
    hold_back(scale, normal);
    return {std::move(normal), std::move(right), std::move(scale)};
}

/// Columns of the innovations that include the change of the filter's gains. The response of the lock-in to each
/// reading error adds up, and so does the response to the estimated errors. For an effect far from its size this is a
/// rotation of a hundred times the errors of the fit, which the bias must compensate within the step.
void TurnFit::follow_gains(const Whitening& whitening, Eigen::MatrixXd& x, Eigen::VectorXd& scale) const {
    const TurnNoise noise = model_->noise(parameters_);
    const std::size_t n = rows_.size();
    side_by_side(x.cols(), [&](Eigen::Index k) {
        const Regressor& of = columns_[static_cast<std::size_t>(k)].of;
        if (of.slope.empty()) return;
        const double step = 1e-3 / scale(k);
        const auto innovations_at = [&](double value) {
            TurnFrame frame = prediction_.frame;
            std::vector<double> rest = rest_;
            of.take(value, rest, frame);
            Whitening::Innovations there = Whitening::innovations(frame, noise, rest);
            for (std::size_t i = 0; i < n; ++i) there.white[i] *= there.sd_rad[i] / whitening.sd_rad()[i];
            return std::move(there.white);
        };
        const std::vector<double> lower = innovations_at(-step);
        const std::vector<double> upper = innovations_at(step);
        for (std::size_t i = 0; i < n; ++i) {
            x(static_cast<Eigen::Index>(i), k) = rows_[i] ? (lower[i] - upper[i]) / (2.0 * step * scale(k)) : 0.0;
        }
        const double norm = std::max(x.col(k).norm(), 1e-300);
        x.col(k) /= norm;
        scale(k) *= norm;
    });
}

/// Times, frequencies and phases are far from linear. If a full step goes far or increases the objective, the fit tries
/// a part of the step, which follows a curved valley, and then a damped step (Levenberg 1944), which descends its wall.
bool TurnFit::go_down(const Equations& equations, const Whitening* guessed) {
    constexpr double gained = 1e-3;  // of chi-squared: another step would gain less than is useful
    constexpr int parts = 4;
    constexpr int trials = 12;
    const Eigen::MatrixXd& normal = equations.normal;
    const Eigen::VectorXd& right = equations.right;
    const Eigen::VectorXd whole = dense::solve_symmetric(normal, right);
    const auto step = [&](int trial) -> Eigen::VectorXd {
        if (trial < parts) return std::exp2(-trial) * whole;
        const double damping = 1e-3 * std::pow(10.0, trial - parts);
        return dense::solve_symmetric(normal + damping * Eigen::MatrixXd::Identity(normal.rows(), normal.cols()),
                                      right);
    };
    const auto value = [&](const TurnModel::Prediction& prediction) {
        return guessed != nullptr ? squares_left(*guessed) : objective_at(prediction);
    };
    const double before = value(prediction_);
    const TurnParameters from = parameters_;
    const std::vector<double> nuisance_from = nuisance_;
    for (int trial = 0; trial < trials; ++trial) {
        parameters_ = from;
        nuisance_ = nuisance_from;
        take(step(trial).cwiseQuotient(equations.scale));
        try {
            TurnModel::Prediction prediction = model_->predict(parameters_);
            set_rest(prediction);
            const double now = value(prediction);
            const bool down = now <= before + 1e-9 * std::abs(before);
            if (!down && !(guessed != nullptr && parameters_.effects.empty())) continue;
            prediction_ = std::move(prediction);
            const bool arrived = right.dot(whole) < gained || (trial == 0 && std::abs(before - now) < 0.5 * gained);
            return !arrived;
        } catch (const RunError&) {
            // no motion of a gyro with such parameters can be followed
        }
    }
    parameters_ = from;
    nuisance_ = nuisance_from;
    set_rest(prediction_);
    return false;
}

/// Derivative of the log-likelihood, with the changes of the filter's gains and variances.
double TurnFit::slope_of_objective(const TurnFrame& frame, const std::vector<double>& rest, const Regressor& of,
                                   double step) const {
    const auto at = [&](double value) {
        TurnFrame frame_there = frame;
        std::vector<double> rest_there = rest;
        of.take(value, rest_there, frame_there);
        return objective(frame_there, parameters_, rest_there);
    };
    return (at(-step) - at(step)) / (2.0 * step);
}

/// Limits a step: times to a part of the record, frequencies to a part of a period over it, and a phase without a size
/// to a part of a turn. A time between training rows hardly shows in them and would otherwise move too far.
void TurnFit::hold_back(const Eigen::VectorXd& scale, Eigen::MatrixXd& normal) const {
    constexpr double part = 0.1;
    const double duration_s = model_->series().time_s.back();
    const auto bound = [&](Eigen::Index k, double limit) {
        normal(k, k) += 1.0 / (limit * limit * scale(k) * scale(k));
    };
    for (std::size_t s = 1; s <= parameters_.swings.size(); ++s) {
        bound(static_cast<Eigen::Index>(nuisance_.size() + s * swing_columns - 1), part / duration_s);
    }
    if (effects_ == Effects::held) return;
    constexpr double far = 1e3;  // rad
    auto k = static_cast<Eigen::Index>(nuisances() + base_columns);
    for (const ActiveEffect& active : parameters_.effects) {
        const auto all = active.effect->parameters();
        for (const effects::Parameter& parameter : all) {
            if (!is_fitted_in_phase(*active.effect, parameter.role)) continue;
            const double limit = parameter.role == effects::Role::time        ? part * duration_s
                                 : parameter.role == effects::Role::frequency ? part / duration_s
                                 : is_own_phase(*active.effect, parameter)    ? part * units::two_pi
                                 : parameter.role == effects::Role::phase     ? far
                                                                              : 0.0;
            if (limit > 0.0) bound(k, limit);
            ++k;
        }
    }
}

void TurnFit::take(const Eigen::VectorXd& step) {
    Eigen::Index k = 0;
    for (double& value : nuisance_) value += step(k++);
    for (AmplitudeSwing& swing : parameters_.swings) {
        for (double* value : {&swing.cosine_rad, &swing.sine_rad, &swing.hz}) *value += step(k++);
    }
    parameters_.bias_deg_h += step(k++);
    const double threshold_from = parameters_.threshold_deg_h;
    parameters_.threshold_deg_h = std::max(0.0, parameters_.threshold_deg_h + step(k++));
    if (effects_ == Effects::held) return;
    for (ActiveEffect& active : parameters_.effects) {
        // The size that belongs to the phase. A phase of the gyro's coupling belongs to the coupling, whose size is the
        // threshold; a phase that varies in time does not change the threshold.
        const bool moves_in_time = active.effect->changes().coupling_phase;
        double* size = nullptr;
        double size_from = 0.0;
        double most = 0.0;
        for (const effects::Parameter& parameter : active.effect->parameters()) {
            if (!is_fitted_in_phase(*active.effect, parameter.role)) continue;
            double& value = active.values.at(std::string(parameter.name));
            const double by = step(k++);
            if (moves_in_time && is_own_phase(*active.effect, parameter)) {
                value = std::remainder(value + by, units::two_pi);
                continue;
            }
            if (parameter.role == effects::Role::phase) {
                double& along = size != nullptr ? *size : parameters_.threshold_deg_h;
                // Straight on in the plane of size and phase: the phase of a very small size may turn by any angle.
                const double across = (size != nullptr ? size_from : threshold_from) * by;
                value = std::remainder(value + std::atan2(across, along), units::two_pi);
                along = std::hypot(along, across);
                if (size != nullptr) along = std::min(along, most);
                continue;
            }
            if (parameter.role == effects::Role::size) {
                size = &value;
                size_from = value;
                most = parameter.max;
            }
            const bool turned = is_turned(*active.effect, parameter);
            value = turned ? value + by : std::clamp(value + by, parameter.min, parameter.max);
        }
    }
}

}  // namespace ringlock::closure
