// The random part of the fit: standard deviations, by the likelihood of the residual phases.
#include <ceres/ceres.h>
#include <glog/logging.h>

#include <algorithm>
#include <boost/math/tools/minima.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <tuple>

#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/error.hpp"

namespace ringlock::closure {

namespace {

constexpr double no_noise = 1e-9;  // rad: far below any visible noise
constexpr const char* forgets_name = "amplitude_correlation_s";

double square(double value) { return value * value; }

/// A free parameter of the noise: a standard deviation, or another positive number, that is fitted by the likelihood.
struct FreeParameter {
    std::string effect, name;
    double* value;
};

/// The readout's noise must be the third.
std::vector<FreeParameter> free_parameters(TurnParameters& p, bool of_effects = true) {
    std::vector<FreeParameter> all{{"", "injected_noise_rad", &p.injected_sd_rad},
                                   {"", "amplitude_wander_rad", &p.wander_sd_rad},
                                   {"", "readout_noise_rad", &p.readout_sd_rad}};
    if (p.wander_forgets > 0.0) all.push_back({"", forgets_name, &p.wander_forgets});
    if (!of_effects) return all;
    for (ActiveEffect& active : p.effects) {
        for (const effects::Parameter& parameter : active.effect->parameters()) {
            if (parameter.role != effects::Role::deviation) continue;
            const std::string name(parameter.name);
            all.push_back({std::string(active.effect->name()), name, &active.values.at(name)});
        }
    }
    return all;
}

/// Innovations of residual phases over their standard deviations, and these.
struct Innovations {
    std::vector<double> white, sd_rad;

    Innovations(std::vector<double> of_white, std::vector<double> of_sd_rad)
        : white(std::move(of_white)), sd_rad(std::move(of_sd_rad)) {}
    Innovations(const TurnFrame& frame, const TurnNoise& noise, const std::vector<double>& rest) {
        Whitening::Innovations of = Whitening::innovations(frame, noise, rest);
        white = std::move(of.white);
        sd_rad = std::move(of.sd_rad);
    }

    /// Differences of the innovations and of the logarithms of their variances under another noise, in the rows that
    /// count. Their squares are Fisher's information on the change (Harvey 1989, 3.4).
    Eigen::VectorXd change(const Innovations& moved, const Rows& rows) const {
        const std::size_t n = white.size();
        Eigen::VectorXd by = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(2 * n));
        for (std::size_t i = 0; i < n; ++i) {
            if (!rows[i]) continue;
            const double ratio = moved.sd_rad[i] / sd_rad[i];
            by(static_cast<Eigen::Index>(i)) = moved.white[i] * ratio - white[i];
            by(static_cast<Eigen::Index>(n + i)) = std::numbers::sqrt2 * 0.5 * (square(ratio) - 1.0);
        }
        return by;
    }
};

// Bounds of the logarithm of a parameter.
constexpr double smallest_log = -25.0;
constexpr double largest_log = 12.0;

/// Minus the log-likelihood as a function of the logarithms of the parameters, increasing beyond their bounds. It
/// reports points where it cannot be computed, since Ceres ends the program if a value has no finite gradient.
class Objective final : public ceres::FirstOrderFunction {
   public:
    using Point = Eigen::VectorXd;
    using Values = std::function<std::vector<double>(const std::vector<Point>&)>;  // at many points at once
    Objective(Eigen::Index size, Values values) : size_(size), values_(std::move(values)) {}
    int NumParameters() const override { return static_cast<int>(size_); }
    bool Evaluate(const double* x, double* cost, double* gradient) const override {
        constexpr double step = 1e-2;
        std::vector<Point> points{Eigen::Map<const Point>(x, size_)};
        for (Eigen::Index k = 0; gradient != nullptr && k < 2 * size_; ++k) {
            points.push_back(points.front());
            points.back()(k / 2) += k % 2 == 0 ? step : -step;
        }
        const std::vector<double> values = values_(points);
        *cost = values.front();
        if (!std::isfinite(*cost)) return false;
        if (gradient == nullptr) return true;
        for (Eigen::Index i = 0; i < size_; ++i) {
            const auto k = static_cast<std::size_t>(2 * i);
            gradient[i] = (values[k + 1] - values[k + 2]) / (2.0 * step);
        }
        return std::all_of(gradient, gradient + size_, [](double g) { return std::isfinite(g); });
    }

   private:
    Eigen::Index size_;
    Values values_;
};

/// Ceres warns on standard error if a line search makes no progress, which is its normal end here.
void quiet_solver() {
    static const bool done = [] {
        if (!google::IsGoogleLoggingInitialized()) FLAGS_minloglevel = google::GLOG_ERROR;
        return true;
    }();
    static_cast<void>(done);
}

}  // namespace

/// Starts the wander again in a record with injected noise. If the fit of the phases began with the wander's share in
/// the lock-in's, its noise has converged to zero, where the gradient in its logarithm does not lead back.
void TurnFit::try_wander() {
    if (parameters_.wander_sd_rad > 10.0 * no_noise) return;
    std::vector<TurnParameters> grid;
    const TurnOptions::Fit::Grid shares = options.turns.fit.wander_of_injected;
    for (double share = shares.first; share > shares.end; share *= shares.factor) {
        grid.push_back(parameters_);
        grid.back().wander_sd_rad = share * parameters_.injected_sd_rad;
    }
    const std::vector<double> values = objectives(prediction_.frame, grid, rest_);
    const auto least = std::min_element(values.begin(), values.end());
    if (*least < objective(parameters_, rest_)) try_from(grid[static_cast<std::size_t>(least - values.begin())]);
}

/// The likelihood can have two maxima: one with a small noise, and one without it, where the predicted phases account
/// for its contribution. This tries the other one. A noise larger than the readout's is visible by itself, and the
/// predicted phases do not follow it.
void TurnFit::try_other_noise() {
    const double readout = parameters_.readout_sd_rad;
    if (parameters_.injected_sd_rad > readout) return try_wander();
    for (const bool injected : {true, false}) {
        const auto own = [injected](TurnParameters& p) -> double& {
            return injected ? p.injected_sd_rad : p.wander_sd_rad;
        };
        TurnParameters other = parameters_;
        if (own(other) > 10.0 * no_noise && own(other) < readout) {
            own(other) = no_noise;
            try_from(other);
        }
        if (own(parameters_) > options.turns.fit.other_wander * readout) continue;
        // In place of the other noise.
        other = parameters_;
        other.injected_sd_rad = injected ? options.turns.fit.other_injected * readout : no_noise;
        other.wander_sd_rad = injected ? no_noise : options.turns.fit.other_wander * readout;
        try_from(other);
    }
}

std::unique_ptr<TurnFit> TurnFit::with_less_noise() const {
    ready();
    std::unique_ptr<TurnFit> least;
    for (double TurnParameters::*own : {&TurnParameters::wander_sd_rad, &TurnParameters::injected_sd_rad}) {
        TurnParameters less = least ? least->parameters_ : parameters_;
        if (less.*own < 10.0 * no_noise || less.*own > less.readout_sd_rad) continue;
        less.*own = no_noise;
        try {
            std::unique_ptr<TurnFit> without(
                new TurnFit(*this, std::move(less), options.turns.fit.passes_without_noise));
            if (without->log_likelihood() > log_likelihood_ - options.turns.fit.weak_noise) least = std::move(without);
        } catch (const RunError&) {
            // no motion of a gyro with such parameters can be followed
        }
    }
    return least;
}

void TurnFit::try_from(const TurnParameters& other) {
    const double before = objective(parameters_, rest_);
    const TurnParameters from = parameters_;
    parameters_ = other;
    fit_noise();
    if (!(objective(parameters_, rest_) < before + options.turns.fit.maxima_apart)) {
        parameters_ = from;
        return;
    }
    const std::vector<double> nuisance_from = nuisance_;
    const TurnParameters columns_from = columns_at_;
    const TurnModel::Prediction prediction_from = prediction_;
    const bool moved_from = moved_;
    maximise();
    if (objective(parameters_, rest_) < before) return;
    parameters_ = from;
    nuisance_ = nuisance_from;
    prediction_ = prediction_from;
    set_rest(prediction_);
    moved_ = moved_from;
    if (!(columns_at_ == columns_from)) {
        // If the parameters have moved far, the columns are computed again before they are used.
        if (!moved_) columns_ = columns(columns_from, model_->predict(columns_from));
        columns_at_ = columns_from;
    }
}

std::vector<double> TurnFit::objectives(const TurnFrame& frame, const std::vector<TurnParameters>& parameters,
                                        const std::vector<double>& rest) const {
    std::vector<TurnNoise> noises;
    for (const TurnParameters& p : parameters) noises.push_back(model_->noise(p));
    std::vector<double> sums = Whitening::minus_log_likelihoods(frame, noises, rest, rows_);
    double left = 0.0;
    for (std::size_t i = 0; i < frame.shape_left.size(); ++i) left += rows_[i] ? frame.shape_left[i] : 0.0;
    for (double& sum : sums) sum += left;
    // The radius of the quadrature has the noise of the phase, with the same number of degrees of freedom.
    const double radius = model_->series().radius_sd_rad;
    for (std::size_t k = 0; k < sums.size() && radius > options.turns.fit.least_radius_sd_rad; ++k) {
        const double readout = parameters[k].readout_sd_rad;
        const double over = radius / std::max(readout, 1e-12);
        sums[k] += static_cast<double>(rest.size()) * (0.5 * over * over + std::log(readout));
    }
    return sums;
}

double TurnFit::objective(const TurnFrame& frame, const TurnParameters& parameters,
                          const std::vector<double>& rest) const {
    return objectives(frame, {parameters}, rest).front();
}

/// Estimates the density from the innovations of normal noise. The lock-in is not correct yet then, so it is repeated.
void TurnFit::shape_noise() {
    const int passes = parameters_.shape ? 1 : options.turns.fit.passes_of_shape;
    const auto& series = model_->series();
    for (int pass = 0; pass < passes; ++pass) {
        const TurnKicks kicks = model_->mean_kicks(parameters_);
        const Innovations now(prediction_.frame, model_->noise(parameters_), rest_);
        std::vector<double> counted_rad;
        std::vector<double> predicted_rad(rest_.size());
        for (std::size_t i = 0; i < rest_.size(); ++i) {
            const double innovation_rad = now.white[i] * now.sd_rad[i];
            const double psi = model_->phase_rad()[i];
            predicted_rad[i] = psi - kicks.at(series.direction[i], psi).before_rad - innovation_rad;
            if (rows_[i]) counted_rad.push_back(innovation_rad);
        }
        auto shape = NoiseShape::of(counted_rad, kicks, series.direction, predicted_rad);
        // A density that was given may be that of the residual of another model.
        if (!shape && !parameters_.shape) return;
        parameters_.shape = std::move(shape);
        prediction_ = model_->predict(parameters_);
        moved_ = true;
        maximise();
    }
}

void TurnFit::fit_noise() {
    TurnParameters trial = parameters_;
    if (trial.injected_sd_rad == 0.0) {
        std::vector<TurnParameters> grid;
        const TurnOptions::Fit::Grid injected = options.turns.fit.injected_rad;
        const TurnOptions::Fit::Grid wander = options.turns.fit.wander_rad;
        for (double sd_rad = injected.first; sd_rad < injected.end; sd_rad *= injected.factor) {
            trial.injected_sd_rad = sd_rad;
            for (double of_rad = wander.first; of_rad < wander.end; of_rad *= wander.factor) {
                trial.wander_sd_rad = of_rad;
                grid.push_back(trial);
            }
        }
        const std::vector<double> values = objectives(prediction_.frame, grid, rest_);
        trial = grid[static_cast<std::size_t>(std::min_element(values.begin(), values.end()) - values.begin())];
    }
    parameters_ = with_noise_of(prediction_.frame, trial, rest_);
}

TurnParameters TurnFit::with_noise_of(const TurnFrame& frame, const TurnParameters& start,
                                      const std::vector<double>& rest) const {
    TurnParameters trial = start;
    const bool of_effects = effects_ == Effects::fitted;
    const std::vector<FreeParameter> turned = free_parameters(trial, of_effects);
    const auto size = static_cast<Eigen::Index>(turned.size());
    Eigen::VectorXd from(size);
    for (Eigen::Index k = 0; k < size; ++k) {
        from(k) = std::log(std::max(*turned[static_cast<std::size_t>(k)].value, no_noise));
    }
    const auto with = [&](const Eigen::VectorXd& at) {
        TurnParameters changed = start;
        Eigen::Index k = 0;
        for (const FreeParameter& parameter : free_parameters(changed, of_effects)) {
            *parameter.value = std::exp(std::clamp(at(k++), smallest_log, largest_log));
        }
        return changed;
    };
    // The parameters are in units of the information at this point, with a prior so weak that no step is too long: this
    // is the first estimate of the curvature for BFGS.
    Eigen::MatrixXd information = Eigen::MatrixXd::Identity(size, size);
    {
        constexpr double step = 1e-3;
        const Innovations here(frame, model_->noise(with(from)), rest);
        Eigen::MatrixXd derivatives(2 * rest.size(), size);
        side_by_side(size, [&](Eigen::Index k) {
            Eigen::VectorXd at = from;
            at(k) += step;
            derivatives.col(k) = here.change(Innovations(frame, model_->noise(with(at)), rest), rows_) / step;
        });
        information += derivatives.transpose() * derivatives;
        if (model_->series().radius_sd_rad > options.turns.fit.least_radius_sd_rad) {
            information(2, 2) += 2.0 * static_cast<double>(rest.size());
        }
    }
    // The identity makes it positive definite, unless a derivative is not finite.
    const Eigen::MatrixXd root = dense::cholesky(information).value_or(Eigen::MatrixXd::Identity(size, size));
    const auto logarithms = [&](const Objective::Point& at) -> Eigen::VectorXd {
        return from + dense::solve_transposed(root, at);
    };
    const auto values = [&](const std::vector<Objective::Point>& points) {
        std::vector<TurnParameters> changed;
        for (const auto& point : points) changed.push_back(with(logarithms(point)));
        std::vector<double> found = objectives(frame, changed, rest);
        for (std::size_t k = 0; k < points.size(); ++k) {
            const Eigen::VectorXd logs = logarithms(points[k]);
            found[k] += (logs.array() - logs.array().max(smallest_log).min(largest_log)).square().sum();
        }
        return found;
    };
    Objective::Point x = Objective::Point::Zero(size);
    ceres::GradientProblem problem(new Objective(size, values));
    ceres::GradientProblemSolver::Options solver;
    solver.logging_type = ceres::SILENT;
    solver.max_num_iterations = 60;
    solver.function_tolerance = 1e-9;
    solver.gradient_tolerance = 1e-4;
    ceres::GradientProblemSolver::Summary summary;
    quiet_solver();
    ceres::Solve(solver, problem, x.data(), &summary);
    return with(logarithms(x));
}

/// Standard errors by Fisher's information on the variances, from the derivatives of the innovations (Harvey 1989,
/// 3.4). The logarithm of a variance near zero has no information, although the variance may be correlated with others.
void TurnFit::add_noise_estimates(std::vector<Estimate>& estimates) const {
    constexpr double seen = 0.1;  // of a standard error: the length of the differences
    TurnParameters trial = parameters_;
    const std::vector<FreeParameter> turned = free_parameters(trial);
    const Innovations here{innovations_, whitening_->sd_rad()};
    const auto derivative = [&](const FreeParameter& parameter, double step) -> Eigen::VectorXd {
        const double value = *parameter.value;
        *parameter.value = std::sqrt(square(value) + step);
        const Innovations moved(prediction_.frame, model_->noise(trial), rest_);
        *parameter.value = value;
        return here.change(moved, rows_) / step;
    };
    const auto size = static_cast<Eigen::Index>(turned.size());
    Eigen::MatrixXd derivatives(2 * rest_.size(), size);
    for (Eigen::Index k = 0; k < size; ++k) {
        const FreeParameter& parameter = turned[static_cast<std::size_t>(k)];
        double step = std::max(1e-2 * square(*parameter.value), 1e-20);
        derivatives.col(k) = derivative(parameter, step);
        for (int i = 0; i < 40 && !(step * derivatives.col(k).norm() > seen); ++i) {
            step *= 10.0;
            derivatives.col(k) = derivative(parameter, step);
        }
    }
    Eigen::MatrixXd matrix = derivatives.transpose() * derivatives;
    // The radius of the quadrature has the same information on the readout's noise.
    if (model_->series().radius_sd_rad > options.turns.fit.least_radius_sd_rad) {
        matrix(2, 2) += 0.5 * static_cast<double>(rest_.size()) / square(square(*turned[2].value));
    }
    const Eigen::VectorXd scale = matrix.diagonal().cwiseMax(1e-300).cwiseSqrt();
    const Eigen::MatrixXd scaled = scale.cwiseInverse().asDiagonal() * matrix * scale.cwiseInverse().asDiagonal();
    const Eigen::MatrixXd inverse = dense::MinimumNorm(scaled).pseudo_inverse();
    for (std::size_t k = 0; k < turned.size(); ++k) {
        const auto index = static_cast<Eigen::Index>(k);
        const double value = *turned[k].value;
        const double variance = square(value);
        double sd = std::numeric_limits<double>::infinity();
        if (inverse(index, index) > 0.0) {
            const double of_variance = std::sqrt(inverse(index, index)) / scale(index);
            // For a standard deviation that may be zero: the largest value that is compatible.
            sd = of_variance < variance ? 0.5 * of_variance / value : std::sqrt(variance + of_variance) - value;
        }
        estimates.push_back({turned[k].effect, turned[k].name, value, sd});
        if (turned[k].name != forgets_name) continue;
        Estimate& time = estimates.back();
        time.value = model_->series().interval_s / value;
        time.sd = time.value * sd / value;
    }
}

TurnFit::Spread TurnFit::spread(const ActiveEffect& effect, const std::string& parameter, double most) const {
    ready();
    TurnParameters trial = parameters_;
    trial.effects.push_back(effect);
    double& deviation = trial.effects.back().values.at(parameter);
    const double without = objective(parameters_, rest_);
    const auto gain = [&](double logarithm) {
        deviation = std::exp(logarithm);
        return without - objective(trial, rest_);
    };
    const double step = std::log(10.0);
    std::vector<TurnParameters> grid;
    for (int k = 0; k < options.turns.fit.decades_of_spread; ++k) {
        deviation = most * std::pow(10.0, -k);
        grid.push_back(trial);
    }
    const std::vector<double> values = objectives(prediction_.frame, grid, rest_);
    const auto least = std::min_element(values.begin(), values.end());
    const double best_gain = without - *least;
    if (!(best_gain > 0.0)) return {};
    const double best = std::log(most) - step * static_cast<double>(least - values.begin());
    const auto [at, value] =
        boost::math::tools::brent_find_minima([&](double l) { return -gain(l); }, best - step, best + step, 12);
    return {std::exp(at), 2.0 * std::max(-value, best_gain)};
}

}  // namespace ringlock::closure
