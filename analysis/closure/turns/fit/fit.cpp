#include "analysis/closure/turns/fit/fit.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

constexpr std::size_t drift_terms = options.turns.fit.degree_of_amplitude;
constexpr std::size_t swing_columns = 3;  // of an oscillation of the amplitude: two amplitudes and the frequency
constexpr std::size_t base_columns = 2;   // bias and threshold, after the nuisances

/// Legendre polynomial of that degree at x.
double legendre(std::size_t degree, double x) {
    double last = 1.0;
    double now = x;
    if (degree == 0) return last;
    for (std::size_t k = 1; k < degree; ++k) {
        const double next = ((2.0 * static_cast<double>(k) + 1.0) * x * now - static_cast<double>(k) * last) /
                            static_cast<double>(k + 1);
        last = now;
        now = next;
    }
    return now;
}

/// Parameters that are fitted to the phases. Those that other columns determine (side_channels.hpp) are held.
bool fitted_in_phase(const effects::Effect& effect, effects::Role role) {
    using effects::Role;
    return (role == Role::size || role == Role::phase || role == Role::time || role == Role::frequency) &&
           !told_by_other_columns(effect);
}

/// Whether the size has a phase, so that it may take either sign during the fit.
bool is_turned(const effects::Effect& effect, const effects::Parameter& size) {
    const std::vector<Amplitude> amplitudes = amplitudes_of(effect);
    return std::any_of(amplitudes.begin(), amplitudes.end(),
                       [&](const Amplitude& a) { return a.value == &size && a.turned_by != nullptr; });
}

}  // namespace

void Regressor::take(double value, std::vector<double>& rest, TurnFrame& frame) const {
    for (std::size_t i = 0; i < series.size(); ++i) rest[i] -= value * series[i];
    for (std::size_t i = 0; i < slope.size(); ++i) frame.before_slope[i] += value * slope[i];
    for (std::size_t i = 0; i < kick.size(); ++i) frame.kick_slope[i] += value * kick[i];
    for (std::size_t i = 0; i < left.size(); ++i) frame.shape_left[i] += value * left[i];
}

Regressor difference(TurnModel::Prediction with, const TurnModel::Prediction& without, double per) {
    Regressor of(std::move(with.phase_rad), std::move(with.frame.before_slope), std::move(with.frame.kick_slope),
                 std::move(with.frame.shape_left));
    for (std::size_t i = 0; i < of.series.size(); ++i) {
        of.series[i] = (of.series[i] - without.phase_rad[i]) / per;
        of.slope[i] = (of.slope[i] - without.frame.before_slope[i]) / per;
        of.kick[i] = (of.kick[i] - without.frame.kick_slope[i]) / per;
    }
    for (std::size_t i = 0; i < of.left.size(); ++i) of.left[i] = (of.left[i] - without.frame.shape_left[i]) / per;
    return of;
}

std::array<std::vector<double>, 3> amplitude_by(const AmplitudeSwing& swing, const TurnSeries& series) {
    std::array<std::vector<double>, 3> by;
    for (auto& column : by) column.resize(series.size());
    for (std::size_t i = 0; i < series.size(); ++i) {
        const double turned = units::two_pi * series.time_s[i];
        const double cosine = -series.direction[i] * std::cos(turned * swing.hz);
        const double sine = -series.direction[i] * std::sin(turned * swing.hz);
        by[0][i] = cosine;
        by[1][i] = sine;
        by[2][i] = turned * (swing.sine_rad * cosine - swing.cosine_rad * sine);
    }
    return by;
}

TurnFit::TurnFit(const TurnModel& model, const TurnParameters& start, Rows rows, Effects effects, double needed)
    : model_(&model),
      parameters_(start),
      rows_(std::move(rows)),
      effects_(effects),
      needed_(needed),
      nuisance_(2 + drift_terms, 0.0) {
    if (rows_.size() != model.series().size()) throw std::logic_error("TurnFit: not as many rows as turns");
    if (parameters_.bias_deg_h == 0.0) parameters_.bias_deg_h = model.series().mean_rate_deg_h;
    prediction_ = model_->predict(parameters_);
    find_columns();
    if (parameters_.injected_sd_rad > 0.0) fit_nuisances();
    fit_deterministic(options.turns.fit.passes);
    fit_noise();
    climb();
    for (int round = 0; round < options.turns.fit.most_time_rounds && place_times(); ++round) climb();
    if (-objective(parameters_, rest_) > needed_) {
        try_other_noise();
        shape_noise();
    }
    finish();
}

TurnFit::TurnFit(const TurnFit& of, TurnParameters parameters, int passes)
    : model_(of.model_),
      parameters_(std::move(parameters)),
      rows_(of.rows_),
      effects_(of.effects_),
      needed_(of.needed_),
      nuisance_(of.nuisance_),
      columns_at_(of.columns_at_),
      moved_(of.moved_),
      prediction_(of.ready().prediction_),
      columns_(of.columns_) {
    if (passes > 0) fit_deterministic(passes);
    finish();
}

std::unique_ptr<TurnFit> TurnFit::with_noise(const TurnParameters& of) const {
    return std::unique_ptr<TurnFit>(new TurnFit(*this, of, 0));
}

void TurnFit::climb() {
    const TurnOptions::Fit& of = options.turns.fit;
    for (int round = 0; round < of.most_rounds; ++round) {
        const double before = objective(parameters_, rest_);
        fit_deterministic(options.turns.fit.passes);
        fit_noise();
        const double now = objective(parameters_, rest_);
        if (before - now < (round < of.soon ? of.gained : of.gained_late)) break;
        if (-now + of.rounds_ahead * (before - now) < needed_) break;
    }
}

/// If the coupling changes at once, each turn by which the time is off leaves a kick in all later phases. The
/// likelihood then has a maximum at nearly every turn, and Gauss-Newton ends at the nearest one, so all turns nearby
/// are tried.
/// \return whether another time is more likely
bool TurnFit::place_times() {
    if (effects_ == Effects::held) return false;
    bool moved = false;
    for (ActiveEffect& active : parameters_.effects) {
        const effects::Parameter* time = effects::first_of(*active.effect, effects::Role::time);
        if (time == nullptr || changes_angle_only(*active.effect)) continue;
        double& time_s = active.values.at(std::string(time->name));
        const double from_s = time_s;
        double best_s = from_s;
        double best = objective_at(prediction_);
        TurnModel::Prediction prediction = prediction_;
        const int turns = options.turns.fit.turns_about_time;
        for (int k = -turns; k <= turns; ++k) {
            time_s = std::clamp(from_s + k * model_->series().interval_s, time->min, time->max);
            try {
                TurnModel::Prediction there = model_->predict(parameters_);
                set_rest(there);
                const double now = objective_at(there);
                if (!(now < best)) continue;
                best = now;
                best_s = time_s;
                prediction = std::move(there);
            } catch (const RunError&) {
                // no motion of a gyro with such parameters can be followed
            }
        }
        time_s = best_s;
        prediction_ = std::move(prediction);
        set_rest(prediction_);
        if (best_s == from_s) continue;
        moved = true;
        moved_ = true;
    }
    return moved;
}

void TurnFit::find_columns() {
    columns_.clear();  // before the new ones are allocated
    columns_ = columns(parameters_, prediction_);
    columns_at_ = parameters_;
}

std::vector<TurnFit::Column> TurnFit::columns(const TurnParameters& at, const TurnModel::Prediction& prediction) const {
    const std::size_t n = model_->series().size();
    std::vector<Column> all;
    std::vector<double> ones(n, 1.0);
    all.push_back({"", "offset", ones});
    for (std::size_t k = 0; k <= drift_terms; ++k) {
        std::vector<double> drift(n);
        for (std::size_t i = 0; i < n; ++i) {
            const double x = 2.0 * static_cast<double>(i) / static_cast<double>(n - 1) - 1.0;
            drift[i] = prediction.frame.sign[i] * legendre(k, x);
        }
        all.push_back({"", "amplitude", std::move(drift)});
    }
    for (const AmplitudeSwing& swing : at.swings) {
        for (std::vector<double>& by : amplitude_by(swing, model_->series())) {
            all.push_back({"", "swing", std::move(by)});
        }
    }
    const auto change = [&](TurnParameters& p, double& value, double step) {
        const double here = value;
        const auto by = [&](double moved) {
            value = here + moved;
            TurnModel::Prediction changed = model_->predict(p);
            value = here;
            return difference(std::move(changed), prediction, moved);
        };
        try {
            return by(step);
        } catch (const RunError&) {
            return by(-step);  // at the edge of the parameters whose motion can be followed
        }
    };
    TurnParameters p = at;
    std::vector<double> rotation(n);
    const double c = units::two_pi / model_->series().setup.scale_factor_arcsec;
    for (std::size_t i = 1; i < n; ++i) rotation[i] = rotation[i - 1] + c * model_->interval(prediction, i).duration_s;
    all.push_back({"", "bias_deg_h", std::move(rotation)});
    all.push_back(
        {"", "lockin_threshold_deg_h", change(p, p.threshold_deg_h, 1e-3 * std::max(1.0, p.threshold_deg_h))});
    for (ActiveEffect& active : p.effects) {
        for (const effects::Parameter& parameter : active.effect->parameters()) {
            if (!fitted_in_phase(*active.effect, parameter.role)) continue;
            const std::string name(parameter.name);
            double& value = active.values.at(name);
            double step = 1e-4 * std::max(std::abs(value), 1e-2);
            // A frequency changes the phase over the whole record.
            if (parameter.role == effects::Role::frequency) step = 1e-4 / model_->series().time_s.back();
            const bool angle_only = changes_angle_only(*active.effect);
            // The time of a sudden change of the coupling shows in the turns that the step passes over.
            if (parameter.role == effects::Role::time && !angle_only) step = 2.0 * model_->series().interval_s;
            if (value + step > parameter.max) step = -step;
            if (angle_only) {
                const auto here = model_->added_rad(prediction, *active.effect, active.values);
                value += step;
                auto series = model_->added_rad(prediction, *active.effect, active.values);
                value -= step;
                for (std::size_t i = 0; i < n; ++i) series[i] = (series[i] - here[i]) / step;
                all.push_back({std::string(active.effect->name()), name, std::move(series)});
            } else {
                all.push_back({std::string(active.effect->name()), name, change(p, value, step)});
            }
        }
    }
    return all;
}

std::size_t TurnFit::nuisances() const { return nuisance_.size() + swing_columns * parameters_.swings.size(); }

std::size_t TurnFit::solved() const { return effects_ == Effects::held ? nuisances() + base_columns : columns_.size(); }

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
            if (!fitted_in_phase(*active.effect, parameter.role)) continue;
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
            if (!fitted_in_phase(*active.effect, parameter.role)) continue;
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

void TurnFit::set_rest(const TurnModel::Prediction& prediction) const {
    rest_.resize(model_->series().size());
    for (std::size_t i = 0; i < rest_.size(); ++i) {
        rest_[i] = model_->phase_rad()[i] - prediction.phase_rad[i];
        for (std::size_t k = 0; k < nuisance_.size(); ++k) rest_[i] -= nuisance_[k] * columns_[k].of.series[i];
    }
    for (const AmplitudeSwing& swing : parameters_.swings) {
        const auto by = amplitude_by(swing, model_->series());
        for (std::size_t i = 0; i < rest_.size(); ++i) {
            rest_[i] -= swing.cosine_rad * by[0][i] + swing.sine_rad * by[1][i];
        }
    }
}

double TurnFit::squares_left(const Whitening& whitening) const {
    const auto white = whitening.apply(rest_);
    double squares = 0.0;
    for (std::size_t i = 0; i < white.size(); ++i) squares += rows_[i] ? white[i] * white[i] : 0.0;
    return squares;
}

double TurnFit::objective_at(const TurnModel::Prediction& prediction) const {
    const Belief belief = belief_of(parameters_);
    return objective(prediction.frame, parameters_, rest_) +
           0.5 * (belief.bias * belief.bias + belief.threshold * belief.threshold);
}

TurnFit::Belief TurnFit::belief_of(const TurnParameters& parameters) const {
    const double declared = std::max(model_->series().setup.lockin_threshold_deg_h, 1.0);
    Belief belief{0.0, 0.0, options.turns.fit.bias_prior * declared, options.turns.fit.threshold_prior * declared};
    belief.bias = (model_->series().mean_rate_deg_h - parameters.bias_deg_h) / belief.bias_sd_deg_h;
    belief.threshold = (declared - parameters.threshold_deg_h) / belief.threshold_sd_deg_h;
    return belief;
}

/// A locked gyro shows only a combination of bias and threshold. Priors so weak that they do not matter for any other
/// record keep both finite.
void TurnFit::add_priors(const Eigen::VectorXd& scale, Eigen::MatrixXd& normal, Eigen::VectorXd* right) const {
    const auto bias = static_cast<Eigen::Index>(nuisances());
    const auto believe = [&](Eigen::Index k, double off, double sd) {
        normal(k, k) += 1.0 / (sd * sd * scale(k) * scale(k));
        if (right != nullptr) (*right)(k) += off / (sd * scale(k));
    };
    const Belief belief = belief_of(parameters_);
    believe(bias, belief.bias, belief.bias_sd_deg_h);
    believe(bias + 1, belief.threshold, belief.threshold_sd_deg_h);
}

ReadingErrors TurnFit::reading_errors() const {
    // The kick, linear about the phase that was read, has an error kick' v, of which only the unknown part of v
    // matters, and kick'' v^2 / 2, of which all but the mean matters: their variances are left kick'^2 and R^2 kick''^2
    // / 2. Models that are compared must be linear about the same phases, or one gains by the linearisation alone.
    // Therefore the limit is far below a visible effect.
    const double readout_rad2 = parameters_.readout_sd_rad * parameters_.readout_sd_rad;
    if (parameters_.injected_sd_rad > parameters_.readout_sd_rad) return {};
    ReadingErrors errors = ready().whitening_->reading_errors(rest_);
    const auto& left_rad2 = errors.variance_rad2;
    const double mean_rad2 =
        std::accumulate(left_rad2.begin(), left_rad2.end(), 0.0) / static_cast<double>(left_rad2.size());
    if (mean_rad2 * options.turns.fit.reading_errors_matter > 0.5 * readout_rad2 * readout_rad2) return {};
    return errors;
}

void TurnFit::finish() {
    if (moved_) find_columns();
    whiten();
    log_likelihood_ = -objective(parameters_, rest_);
    if (!std::isfinite(log_likelihood_)) throw RunError("the likelihood of these phases is not a number");
    is_ready_ = true;
}

void TurnFit::whiten() const {
    set_rest(prediction_);
    whitening_ = std::make_shared<Whitening>(prediction_.frame, model_->noise(parameters_));
    innovations_ = whitening_->apply(rest_);
    sd_rad_ = whitening_->sd_rad();
    for (std::size_t i = 0; i < sd_rad_.size(); ++i) sd_rad_[i] /= std::abs(1.0 - prediction_.frame.before_slope[i]);
}

void TurnFit::put_away() const {
    is_ready_ = false;
    has_basis_ = false;
    prediction_ = TurnModel::Prediction();
    columns_.clear();
    // Assignment of an empty vector would not release the memory.
    for (std::vector<double>* of_turns : {&rest_, &innovations_, &sd_rad_}) std::vector<double>().swap(*of_turns);
    whitening_.reset();
    basis_.resize(0, 0);
    model_->forget();
}

const TurnFit& TurnFit::ready() const {
    if (is_ready_) return *this;
    const std::lock_guard lock(getting_ready_);
    if (is_ready_) return *this;
    prediction_ = model_->predict(parameters_);
    columns_ = columns(columns_at_, columns_at_ == parameters_ ? prediction_ : model_->predict(columns_at_));
    whiten();
    is_ready_ = true;
    return *this;
}

/// The basis for scores.
const Eigen::MatrixXd& TurnFit::basis() const {
    if (has_basis_) return basis_;
    ready();
    const std::lock_guard lock(making_basis_);
    if (has_basis_) return basis_;
    Eigen::VectorXd scale;
    basis_ = dense::orthonormal_basis(whitened_columns(scale));
    has_basis_ = true;
    return basis_;
}

Eigen::VectorXd TurnFit::counted(const Whitening& whitening, const TurnFrame& frame, const Regressor& regressor) const {
    Eigen::VectorXd column = below(whitening.apply(regressor.series), 0.0);
    const std::size_t n = rows_.size();
    for (std::size_t i = 0; i < regressor.slope.size(); ++i) {
        if (rows_[i]) column(static_cast<Eigen::Index>(n + i)) = regressor.slope[i] / (1.0 - frame.before_slope[i]);
    }
    for (std::size_t i = 0; i < regressor.left.size(); ++i) {
        if (rows_[i]) column(static_cast<Eigen::Index>(n + i)) += regressor.left[i];
    }
    return column;
}

Eigen::VectorXd TurnFit::counted(const Whitening& whitening, const std::vector<double>& rest) const {
    return below(whitening.apply(rest), -1.0);
}

Eigen::MatrixXd TurnFit::counted(const Whitening& whitening, const TurnFrame& frame, std::size_t count,
                                 const RegressorAt& regressor, Eigen::VectorXd& norms) const {
    Eigen::MatrixXd x(static_cast<Eigen::Index>(2 * rows_.size()), static_cast<Eigen::Index>(count));
    norms.resize(x.cols());
    side_by_side(count, [&](std::size_t at) {
        const auto k = static_cast<Eigen::Index>(at);
        const Eigen::VectorXd column = counted(whitening, frame, regressor(at));
        norms(k) = std::max(column.norm(), 1e-300);
        x.col(k) = column / norms(k);
    });
    return x;
}

Eigen::VectorXd TurnFit::below(const std::vector<double>& white, double value) const {
    const std::size_t n = white.size();
    Eigen::VectorXd column(static_cast<Eigen::Index>(2 * n));
    for (std::size_t i = 0; i < n; ++i) {
        column(static_cast<Eigen::Index>(i)) = rows_[i] ? white[i] : 0.0;
        column(static_cast<Eigen::Index>(n + i)) = rows_[i] ? value : 0.0;
    }
    return column;
}

}  // namespace ringlock::closure
