// The random part of the fit: standard deviations, by the likelihood of what the deterministic part leaves.
#include <ceres/ceres.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <boost/math/tools/minima.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <tuple>

#include "analysis/closure/turn_fit.hpp"

namespace ringlock::closure {

namespace {

constexpr double least_radius_sd_rad = 1e-7;  // below: a radius that shows no noise tells nothing of the phase's

double square(double value) { return value * value; }

/// A standard deviation of the model that the likelihood decides.
struct Knob {
    std::string effect, name;
    double* value;
};

std::vector<Knob> knobs(TurnParameters& p, bool of_effects = true) {
    std::vector<Knob> all{{"", "injected_noise_rad", &p.injected_sd_rad},
                          {"", "amplitude_wander_rad", &p.wander_sd_rad},
                          {"", "readout_noise_rad", &p.readout_sd_rad}};
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

// Of a knob's logarithm: nothing is so small or so large.
constexpr double smallest = -25.0;
constexpr double largest = 12.0;

/// Minus the log-likelihood by the logarithms of the knobs, rising beyond their bounds. Says where it cannot be had:
/// Ceres ends the program where a value has no finite gradient.
class Objective final : public ceres::FirstOrderFunction {
   public:
    Objective(std::size_t size, std::function<double(const double*)> value) : size_(size), value_(std::move(value)) {}
    int NumParameters() const override { return static_cast<int>(size_); }
    bool Evaluate(const double* x, double* cost, double* gradient) const override {
        *cost = value_(x);
        if (!std::isfinite(*cost)) return false;
        if (gradient == nullptr) return true;
        constexpr double step = 1e-2;
        std::vector<double> values(2 * size_);
        oneapi::tbb::parallel_for(std::size_t{0}, values.size(), [&](std::size_t k) {
            std::vector<double> at(x, x + size_);
            at[k / 2] += k % 2 == 0 ? step : -step;
            values[k] = value_(at.data());
        });
        for (std::size_t i = 0; i < size_; ++i) gradient[i] = (values[2 * i] - values[2 * i + 1]) / (2.0 * step);
        return std::all_of(gradient, gradient + size_, [](double g) { return std::isfinite(g); });
    }

   private:
    std::size_t size_;
    std::function<double(const double*)> value_;
};

}  // namespace

/// The likelihood can have two summits: a small noise, or none at all, where what it does to the phases is foretold by
/// their course. Of the one that is not stood on. What is larger than the readout's noise shows itself, and behind it
/// there is no course.
void TurnFit::try_other_noise() {
    constexpr double none = 1e-9;
    const double readout = parameters_.readout_sd_rad;
    if (parameters_.injected_sd_rad > readout) return;
    for (const bool injected : {true, false}) {
        const auto own = [injected](TurnParameters& p) -> double& {
            return injected ? p.injected_sd_rad : p.wander_sd_rad;
        };
        TurnParameters other = parameters_;
        if (own(other) > 10.0 * none && own(other) < readout) {
            own(other) = none;
            try_from(other);
        }
        if (own(parameters_) > 1e-3 * readout) continue;
        // In place of the other one.
        other = parameters_;
        other.injected_sd_rad = injected ? 0.05 * readout : none;
        other.wander_sd_rad = injected ? none : 1e-3 * readout;
        try_from(other);
    }
}

void TurnFit::try_from(const TurnParameters& other) {
    const TurnParameters from = parameters_;
    const std::vector<double> nuisance_from = nuisance_;
    const std::vector<double> rest_from = rest_;
    const TurnModel::Prediction prediction_from = prediction_;
    const double before = objective(parameters_, rest_);
    // Summits are near one another, or one of them is none.
    constexpr double near = 20.0;
    parameters_ = other;
    fit_noise();
    if (objective(parameters_, rest_) < before + near) climb();
    if (objective(parameters_, rest_) < before) return;
    parameters_ = from;
    nuisance_ = nuisance_from;
    rest_ = rest_from;
    prediction_ = prediction_from;
}

double TurnFit::objective(const TurnFrame& frame, const TurnParameters& parameters,
                          const std::vector<double>& rest) const {
    double sum = Whitening::minus_log_likelihood(frame, model_->noise(parameters), rest, rows_);
    // The radius of the quadrature has the noise of the phase: as many degrees of freedom again.
    const double radius = model_->series().radius_sd_rad;
    if (radius > least_radius_sd_rad) {
        const double over = radius / std::max(parameters.readout_sd_rad, 1e-12);
        sum += static_cast<double>(rest.size()) * (0.5 * over * over + std::log(parameters.readout_sd_rad));
    }
    return sum;
}

void TurnFit::fit_noise() {
    TurnParameters trial = parameters_;
    if (trial.injected_sd_rad == 0.0) {
        std::vector<std::pair<double, double>> grid;
        for (double injected = 1e-4; injected < 1e3; injected *= 4.0) {
            for (double wander = 1e-7; wander < 1e2; wander *= 10.0) grid.emplace_back(injected, wander);
        }
        std::vector<double> values(grid.size());
        oneapi::tbb::parallel_for(std::size_t{0}, grid.size(), [&](std::size_t k) {
            TurnParameters at = parameters_;
            std::tie(at.injected_sd_rad, at.wander_sd_rad) = grid[k];
            values[k] = objective(at, rest_);
        });
        const auto best = std::min_element(values.begin(), values.end()) - values.begin();
        std::tie(parameters_.injected_sd_rad, parameters_.wander_sd_rad) = grid[static_cast<std::size_t>(best)];
        trial = parameters_;
    }
    parameters_ = with_noise_of(prediction_.frame, trial, rest_);
}

TurnParameters TurnFit::with_noise_of(const TurnFrame& frame, const TurnParameters& start,
                                      const std::vector<double>& rest) const {
    constexpr double least = 1e-9;
    TurnParameters trial = start;
    std::vector<double> x;
    const bool of_effects = effects_ == Effects::fitted;
    for (const Knob& knob : knobs(trial, of_effects)) x.push_back(std::log(std::max(*knob.value, least)));
    const auto size = static_cast<Eigen::Index>(x.size());
    const Eigen::VectorXd from = Eigen::Map<const Eigen::VectorXd>(x.data(), size);
    const auto with = [&](const Eigen::VectorXd& at) {
        TurnParameters changed = start;
        Eigen::Index k = 0;
        for (const Knob& knob : knobs(changed, of_effects)) {
            *knob.value = std::exp(std::clamp(at(k++), smallest, largest));
        }
        return changed;
    };
    // From here in units of what the information says of them, beside so weak a belief that none goes far at once:
    // what BFGS takes for its first guess of the curvature.
    Eigen::MatrixXd information = Eigen::MatrixXd::Identity(size, size);
    {
        constexpr double step = 1e-3;
        const auto innovations = [&](const Eigen::VectorXd& at) {
            const Whitening whitening(frame, model_->noise(with(at)));
            return std::pair(whitening.apply(rest), whitening.sd_rad());
        };
        const auto [white, sd] = innovations(from);
        const std::size_t n = rest.size();
        std::vector<Eigen::VectorXd> derivatives(x.size(), Eigen::VectorXd::Zero(static_cast<Eigen::Index>(2 * n)));
        oneapi::tbb::parallel_for(std::size_t{0}, x.size(), [&](std::size_t k) {
            Eigen::VectorXd at = from;
            at(static_cast<Eigen::Index>(k)) += step;
            const auto [moved, moved_sd] = innovations(at);
            for (std::size_t i = 0; i < n; ++i) {
                if (!rows_[i]) continue;
                const double ratio = moved_sd[i] / sd[i];
                derivatives[k](static_cast<Eigen::Index>(i)) = (moved[i] * ratio - white[i]) / step;
                derivatives[k](static_cast<Eigen::Index>(n + i)) = std::numbers::sqrt2 * (ratio - 1.0) / step;
            }
        });
        for (Eigen::Index i = 0; i < size; ++i) {
            for (Eigen::Index j = 0; j < size; ++j) {
                information(i, j) +=
                    derivatives[static_cast<std::size_t>(i)].dot(derivatives[static_cast<std::size_t>(j)]);
            }
        }
        if (model_->series().radius_sd_rad > least_radius_sd_rad) information(2, 2) += 2.0 * static_cast<double>(n);
    }
    const Eigen::LLT<Eigen::MatrixXd> root(information);
    const auto logarithms = [&](const double* at) -> Eigen::VectorXd {
        return from + root.matrixU().solve(Eigen::Map<const Eigen::VectorXd>(at, size));
    };
    const auto value = [&](const double* at) {
        const Eigen::VectorXd logs = logarithms(at);
        const double beyond = (logs.array() - logs.array().max(smallest).min(largest)).square().sum();
        return objective(frame, with(logs), rest) + beyond;
    };
    std::fill(x.begin(), x.end(), 0.0);
    ceres::GradientProblem problem(new Objective(x.size(), value));
    ceres::GradientProblemSolver::Options options;
    options.logging_type = ceres::SILENT;
    options.max_num_iterations = 60;
    options.function_tolerance = 1e-9;
    options.gradient_tolerance = 1e-4;
    ceres::GradientProblemSolver::Summary summary;
    ceres::Solve(options, problem, x.data(), &summary);
    return with(logarithms(x.data()));
}

/// By Fisher's information on the variances, from the innovations' derivatives (Harvey 1989, 3.4): logarithms know
/// nothing of a variance that is next to zero, which others may be confounded with all the same.
void TurnFit::add_noise_estimates(std::vector<Estimate>& estimates) const {
    constexpr double seen = 0.1;  // of a standard error: as long as steps must be
    TurnParameters trial = parameters_;
    const std::vector<Knob> turned = knobs(trial);
    const std::size_t n = rest_.size();
    struct Derivative {
        double variance;
        std::vector<double> innovation, size;  // over the innovation's standard deviation; relative, of its square
    };
    const auto derivative = [&](const Knob& knob, double step) {
        Derivative d{square(*knob.value), std::vector<double>(n, 0.0), std::vector<double>(n, 0.0)};
        const double value = *knob.value;
        *knob.value = std::sqrt(d.variance + step);
        const Whitening moved(prediction_.frame, model_->noise(trial));
        *knob.value = value;
        const auto white = moved.apply(rest_);
        for (std::size_t i = 0; i < n; ++i) {
            if (!rows_[i]) continue;
            const double ratio = moved.sd_rad()[i] / whitening_->sd_rad()[i];
            d.innovation[i] = (white[i] * ratio - innovations_[i]) / step;
            d.size[i] = (square(ratio) - 1.0) / step;
        }
        return d;
    };
    const auto information = [&](const Derivative& a, const Derivative& b) {
        double sum = 0.0;
        for (std::size_t i = 0; i < n; ++i) sum += 0.5 * a.size[i] * b.size[i] + a.innovation[i] * b.innovation[i];
        return sum;
    };
    std::vector<Derivative> derivatives;
    for (const Knob& knob : turned) {
        double step = std::max(1e-2 * square(*knob.value), 1e-20);
        Derivative d = derivative(knob, step);
        for (int i = 0; i < 40 && !(square(step) * information(d, d) > square(seen)); ++i) {
            step *= 10.0;
            d = derivative(knob, step);
        }
        derivatives.push_back(std::move(d));
    }
    const auto size = static_cast<Eigen::Index>(turned.size());
    Eigen::MatrixXd matrix(size, size);
    for (Eigen::Index i = 0; i < size; ++i) {
        for (Eigen::Index j = 0; j <= i; ++j) {
            matrix(i, j) = matrix(j, i) =
                information(derivatives[static_cast<std::size_t>(i)], derivatives[static_cast<std::size_t>(j)]);
        }
        // The radius of the quadrature tells of the readout's noise as much again.
        if (turned[static_cast<std::size_t>(i)].name == "readout_noise_rad" &&
            model_->series().radius_sd_rad > least_radius_sd_rad) {
            matrix(i, i) += 0.5 * static_cast<double>(n) / square(derivatives[static_cast<std::size_t>(i)].variance);
        }
    }
    const Eigen::VectorXd scale = matrix.diagonal().cwiseMax(1e-300).cwiseSqrt();
    const Eigen::MatrixXd scaled = scale.cwiseInverse().asDiagonal() * matrix * scale.cwiseInverse().asDiagonal();
    const Eigen::MatrixXd inverse = scaled.completeOrthogonalDecomposition().pseudoInverse();
    for (std::size_t k = 0; k < turned.size(); ++k) {
        const auto index = static_cast<Eigen::Index>(k);
        const double variance = derivatives[k].variance;
        const double value = std::sqrt(variance);
        double sd = std::numeric_limits<double>::infinity();
        if (inverse(index, index) > 0.0) {
            const double of_variance = std::sqrt(inverse(index, index)) / scale(index);
            // Of a deviation that may be zero: how large it may be.
            sd = of_variance < variance ? 0.5 * of_variance / value : std::sqrt(variance + of_variance) - value;
        }
        estimates.push_back({turned[k].effect, turned[k].name, value, sd});
    }
}

TurnFit::Spread TurnFit::spread(const ActiveEffect& effect, const std::string& parameter, double most) const {
    TurnParameters trial = parameters_;
    trial.effects.push_back(effect);
    double& deviation = trial.effects.back().values.at(parameter);
    const double without = objective(parameters_, rest_);
    const auto gain = [&](double logarithm) {
        deviation = std::exp(logarithm);
        return without - objective(trial, rest_);
    };
    const double step = std::log(10.0);
    double best = std::log(most);
    double best_gain = 0.0;
    double x = best;
    for (int k = 0; k < 11; ++k, x -= step) {
        const double here = gain(x);
        if (here <= best_gain) continue;
        best_gain = here;
        best = x;
    }
    if (best_gain <= 0.0) return {};
    const auto [at, value] =
        boost::math::tools::brent_find_minima([&](double l) { return -gain(l); }, best - step, best + step, 12);
    return {std::exp(at), 2.0 * std::max(-value, best_gain)};
}

}  // namespace ringlock::closure
