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
    maximise();
    for (int round = 0; round < options.turns.fit.most_time_rounds && place_times(); ++round) maximise();
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

void TurnFit::maximise() {
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
            if (!is_fitted_in_phase(*active.effect, parameter.role)) continue;
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
    const Prior prior = prior_of(parameters_);
    return objective(prediction.frame, parameters_, rest_) +
           0.5 * (prior.bias * prior.bias + prior.threshold * prior.threshold);
}

TurnFit::Prior TurnFit::prior_of(const TurnParameters& parameters) const {
    const double declared = std::max(model_->series().setup.lockin_threshold_deg_h, 1.0);
    Prior prior{0.0, 0.0, options.turns.fit.bias_prior * declared, options.turns.fit.threshold_prior * declared};
    prior.bias = (model_->series().mean_rate_deg_h - parameters.bias_deg_h) / prior.bias_sd_deg_h;
    prior.threshold = (declared - parameters.threshold_deg_h) / prior.threshold_sd_deg_h;
    return prior;
}

/// A locked gyro shows only a combination of bias and threshold. Priors so weak that they do not matter for any other
/// record keep both finite.
void TurnFit::add_priors(const Eigen::VectorXd& scale, Eigen::MatrixXd& normal, Eigen::VectorXd* right) const {
    const auto bias = static_cast<Eigen::Index>(nuisances());
    const auto believe = [&](Eigen::Index k, double off, double sd) {
        normal(k, k) += 1.0 / (sd * sd * scale(k) * scale(k));
        if (right != nullptr) (*right)(k) += off / (sd * scale(k));
    };
    const Prior prior = prior_of(parameters_);
    believe(bias, prior.bias, prior.bias_sd_deg_h);
    believe(bias + 1, prior.threshold, prior.threshold_sd_deg_h);
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

void TurnFit::release() const {
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
