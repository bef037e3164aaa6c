#include "analysis/noise/model/likelihood.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "analysis/noise/model/lost_information.hpp"
#include "engine/core/dense.hpp"

namespace ringlock::noise {
namespace {

using Matrix = Eigen::Matrix<double, parameter_count, parameter_count>;
using Vector = Eigen::Matrix<double, parameter_count, 1>;

/// Variance of a bin's coefficients and its derivatives by the parameters.
class Variance {
   public:
    Variance(const Parameters& theta, const Model& model, std::size_t samples)
        : theta_(theta), correlated_(model.has[correlated]), shape_(theta[log_time], samples) {}
    double operator()(const Bin& b) const {
        double v = correlated_ ? theta_[correlated] * shape_(b.sin2).shape : 0.0;
        for (std::size_t i = 0; i < b.shape.size(); ++i) v += theta_[i] * b.shape[i];
        return v;
    }
    /// By the first `count` parameters: all of them, or those before `correlated`.
    template <int count>
    Eigen::Matrix<double, count, 1> derivatives(const Bin& b) const {
        Eigen::Matrix<double, count, 1> g;
        std::copy(b.shape.begin(), b.shape.end(), g.data());
        if constexpr (count > correlated) {
            const CorrelatedShape::Value there = shape_(b.sin2);
            g[correlated] = there.shape;
            g[log_time] = theta_[correlated] * there.slope;
        }
        return g;
    }

   private:
    const Parameters& theta_;
    bool correlated_;
    CorrelatedShape shape_;
};

/// Derivatives of the sums over bins that make up the deviance, by the parameters.
struct DerivativeSums {
    Vector gradient = Vector::Zero();
    Matrix curvature = Matrix::Zero();
    std::array<Vector, 2> uu = {Vector::Zero(), Vector::Zero()};
    std::array<Vector, 2> uz = {Vector::Zero(), Vector::Zero()};
    Vector dd = Vector::Zero();
    Vector du = Vector::Zero();
};

template <int count>
DerivativeSums derivative_sums(const std::vector<Bin>& bins, const Variance& variance, double ramp) {
    using Part = Eigen::Matrix<double, count, 1>;
    Part gradient = Part::Zero(), dd = Part::Zero(), du = Part::Zero();
    Eigen::Matrix<double, count, count> curvature = Eigen::Matrix<double, count, count>::Zero();
    std::array<Part, 2> uu = {Part::Zero(), Part::Zero()};
    std::array<Part, 2> uz = {Part::Zero(), Part::Zero()};
    for (const Bin& b : bins) {
        const Part g = variance.derivatives<count>(b);
        const double w = 1.0 / variance(b);
        const Part gw2 = w * w * g;
        gradient += b.count * w * g - (b.power + ramp * (ramp * b.ramp2 - 2.0 * b.ramp_data)) * gw2;
        curvature += b.count * (gw2 * g.transpose());
        dd -= b.ramp2 * gw2;
        du -= b.ramp_corner * gw2;
        for (std::size_t p = 0; p < 2; ++p) {
            uu[p] -= b.corner2[p] * gw2;
            uz[p] -= (b.corner_data[p] - (p == 1 ? ramp * b.ramp_corner : 0.0)) * gw2;
        }
    }
    DerivativeSums out;
    out.gradient.template head<count>() = gradient;
    out.curvature.template topLeftCorner<count, count>() = curvature;
    out.dd.template head<count>() = dd;
    out.du.template head<count>() = du;
    for (std::size_t p = 0; p < 2; ++p) {
        out.uu[p].template head<count>() = uu[p];
        out.uz[p].template head<count>() = uz[p];
    }
    return out;
}

/// The parameters that a step may move: those of the model but for a variance that is zero and would rather be less.
/// A correlation time has a meaning where there is something correlated only.
std::vector<Eigen::Index> movable(const Model& model, const Parameters& theta, std::size_t fixed, const Vector* slope) {
    std::vector<Eigen::Index> out;
    for (std::size_t i = 0; i < term_count; ++i) {
        if (!model.has[i] || i == fixed) continue;
        const auto index = static_cast<Eigen::Index>(i);
        if (theta[i] > 0.0 || (slope != nullptr && (*slope)[index] < 0.0)) out.push_back(index);
    }
    if (model.has[correlated] && theta[correlated] > 0.0 && fixed != log_time) {
        out.push_back(static_cast<Eigen::Index>(log_time));
    }
    return out;
}

/// Variances of a record with missing samples: correlations are taken to be those of a whole one.
void widen(const LostInformation& lost, const std::vector<Eigen::Index>& inside, Maximum& out) {
    const std::vector<std::size_t> terms(inside.begin(), inside.end());
    for (const std::size_t i : terms) out.inflation[i] = lost.inflation(terms, i);
    for (const std::size_t i : terms) {
        for (const std::size_t k : terms) out.covariance[i][k] *= std::sqrt(out.inflation[i] * out.inflation[k]);
    }
}

}  // namespace

struct Likelihood::State {
    double deviance = std::numeric_limits<double>::infinity();
    Vector gradient = Vector::Zero();   ///< of the deviance
    Matrix curvature = Matrix::Zero();  ///< its expectation: twice the Fisher information
    double ramp = 0.0;
    double ramp_variance = 0.0;
    Vector ramp_information_slope = Vector::Zero();
    std::array<double, 2> corner{};
};

Likelihood::State Likelihood::evaluate(const Parameters& theta, const Model& model, bool derivatives) const {
    State s;
    double logs = 0.0;
    double power = 0.0;
    std::array<double, 2> uu{};
    std::array<double, 2> uz{};
    double dd = 0.0;
    double dz = 0.0;
    double du = 0.0;
    const Variance variance(theta, model, samples_);
    for (const Bin& b : bins_) {
        const double v = variance(b);
        if (!(v > 0.0)) return s;
        const double w = 1.0 / v;
        logs -= b.count * std::log(w);
        power += b.power * w;
        for (std::size_t p = 0; p < 2; ++p) {
            uu[p] += b.corner2[p] * w;
            uz[p] += b.corner_data[p] * w;
        }
        dd += b.ramp2 * w;
        dz += b.ramp_data * w;
        du += b.ramp_corner * w;
    }
    const double q = theta[quantisation];
    const std::array<double, 2> k = {1.0 / (1.0 + q * uu[0]), 1.0 / (1.0 + q * uu[1])};
    double information = 0.0;
    if (model.ramp) {
        information = dd - q * k[1] * du * du;
        if (information > 0.0) {
            s.ramp_variance = 1.0 / information;
            s.ramp = (dz - q * k[1] * du * uz[1]) * s.ramp_variance;
        }
    }
    const double r = s.ramp;
    power += r * (r * dd - 2.0 * dz);
    uz[1] -= r * du;
    s.deviance = logs + power;
    for (std::size_t p = 0; p < 2; ++p) {
        s.deviance += std::log1p(q * uu[p]) - q * k[p] * uz[p] * uz[p];
        s.corner[p] = q * k[p] * uz[p];
    }
    const bool restricted = model.restricted && information > 0.0;
    if (restricted) s.deviance += std::log(information);
    if (!derivatives) return s;

    // By the envelope theorem the ramp may be held while the variances move.
    const DerivativeSums sums = model.has[correlated] ? derivative_sums<parameter_count>(bins_, variance, r)
                                                      : derivative_sums<correlated>(bins_, variance, r);
    s.gradient = sums.gradient;
    s.curvature = sums.curvature;
    for (std::size_t p = 0; p < 2; ++p) {
        const double c = uz[p];
        Vector denominator = q * sums.uu[p];  // derivative of 1 + q uu
        denominator[quantisation] += uu[p];
        s.gradient += k[p] * denominator + q * c * c * k[p] * k[p] * denominator - 2.0 * q * k[p] * c * sums.uz[p];
        s.gradient[quantisation] -= k[p] * c * c;
        if (p == 1 && information > 0.0) {
            s.ramp_information_slope =
                sums.dd + q * k[1] * k[1] * du * du * denominator - 2.0 * q * k[1] * du * sums.du;
            s.ramp_information_slope[quantisation] -= k[1] * du * du;
            if (restricted) s.gradient += s.ramp_information_slope / information;
        }
    }
    return s;
}

Parameters Likelihood::first_guess(const Model& model) const {
    // Each term alone would explain the whole power; an equal share of each.
    Parameters theta{};
    const LogTimes range = log_times(samples_);
    theta[log_time] = 0.5 * (range.lo + range.hi);
    const CorrelatedShape of_correlated(theta[log_time], samples_);
    double power = 0.0;
    std::array<double, term_count> shape{};
    for (const Bin& b : bins_) {
        power += b.power;
        for (std::size_t i = 0; i < b.shape.size(); ++i) shape[i] += b.count * b.shape[i];
        if (model.has[correlated]) shape[correlated] += b.count * of_correlated(b.sin2).shape;
    }
    const auto terms = static_cast<double>(std::count(model.has.begin(), model.has.end(), true));
    for (std::size_t i = 0; i < term_count; ++i) {
        if (model.has[i]) theta[i] = power / (shape[i] * terms);
    }
    return theta;
}

Maximum Likelihood::maximise(const Model& model, const Parameters* start, std::size_t fixed, double fixed_value) const {
    constexpr int most_iterations = 100;
    constexpr double enough = 1e-7;  // of deviance, whose scale is 1
    Parameters theta = start != nullptr ? *start : first_guess(model);
    for (std::size_t i = 0; i < term_count; ++i) {
        if (!model.has[i]) theta[i] = 0.0;
    }
    if (fixed < parameter_count) theta[fixed] = fixed_value;
    const LogTimes times = log_times(samples_);

    State state = evaluate(theta, model, true);
    for (int iteration = 0; iteration < most_iterations; ++iteration) {
        const std::vector<Eigen::Index> free = movable(model, theta, fixed, &state.gradient);
        const auto count = static_cast<Eigen::Index>(free.size());
        if (count == 0) break;
        Eigen::MatrixXd h(count, count);
        Eigen::VectorXd g(count);
        for (Eigen::Index a = 0; a < count; ++a) {
            g[a] = state.gradient[free[static_cast<std::size_t>(a)]];
            for (Eigen::Index b = 0; b < count; ++b) {
                h(a, b) = state.curvature(free[static_cast<std::size_t>(a)], free[static_cast<std::size_t>(b)]);
            }
        }
        const Eigen::VectorXd scale = h.diagonal().cwiseSqrt().cwiseInverse();
        Eigen::MatrixXd scaled = scale.asDiagonal() * h * scale.asDiagonal();
        scaled.diagonal().array() += 1e-12;
        const Eigen::VectorXd step =
            -(scale.asDiagonal() * dense::solve_symmetric(scaled, scale.asDiagonal() * g)).eval();
        if (-0.5 * g.dot(step) < enough) break;
        double length = 1.0;
        bool moved = false;
        double gain = 0.0;
        for (int halving = 0; halving < 30; ++halving, length *= 0.5) {
            Parameters trial = theta;
            for (Eigen::Index a = 0; a < count; ++a) {
                const auto i = static_cast<std::size_t>(free[static_cast<std::size_t>(a)]);
                const double change = length * step[a];
                trial[i] = i == log_time ? std::clamp(theta[i] + std::clamp(change, -1.0, 1.0), times.lo, times.hi)
                                         : std::max(0.0, theta[i] + change);
            }
            const State there = evaluate(trial, model, false);
            if (there.deviance < state.deviance) {
                gain = state.deviance - there.deviance;
                theta = trial;
                moved = true;
                break;
            }
        }
        if (!moved) break;
        state = evaluate(theta, model, true);
        if (gain < enough) break;
    }

    Maximum out;
    out.theta = theta;
    out.ramp = state.ramp;
    out.ramp_variance = state.ramp_variance;
    out.deviance = state.deviance;
    out.corner = state.corner;
    // Of the logarithms, so that sizes do not matter; a term that is held is given as if it were not.
    const std::vector<Eigen::Index> inside = movable(model, theta, parameter_count, nullptr);
    if (inside.empty() || !std::isfinite(state.deviance)) return out;
    const auto count = static_cast<Eigen::Index>(inside.size());
    const auto scale = [&](Eigen::Index a) {
        const auto i = static_cast<std::size_t>(inside[static_cast<std::size_t>(a)]);
        return i == log_time ? 1.0 : theta[i];
    };
    Eigen::MatrixXd relative(count, count);
    for (Eigen::Index a = 0; a < count; ++a) {
        for (Eigen::Index b = 0; b < count; ++b) {
            relative(a, b) = 0.5 *
                             state.curvature(inside[static_cast<std::size_t>(a)], inside[static_cast<std::size_t>(b)]) *
                             scale(a) * scale(b);
        }
    }
    const Eigen::MatrixXd inverse = dense::MinimumNorm(relative).pseudo_inverse();
    for (Eigen::Index a = 0; a < count; ++a) {
        for (Eigen::Index b = 0; b < count; ++b) {
            out.covariance[static_cast<std::size_t>(inside[static_cast<std::size_t>(a)])]
                          [static_cast<std::size_t>(inside[static_cast<std::size_t>(b)])] =
                inverse(a, b) * scale(a) * scale(b);
        }
    }
    if (lost_ != nullptr) widen(*lost_, inside, out);
    // V = 1/information: 2 V^2 over the variance of V
    double variance = 0.0;
    for (Eigen::Index a = 0; a < count; ++a) {
        for (Eigen::Index b = 0; b < count; ++b) {
            const auto i = static_cast<std::size_t>(inside[static_cast<std::size_t>(a)]);
            const auto k = static_cast<std::size_t>(inside[static_cast<std::size_t>(b)]);
            variance += out.covariance[i][k] * state.ramp_information_slope[static_cast<Eigen::Index>(i)] *
                        state.ramp_information_slope[static_cast<Eigen::Index>(k)];
        }
    }
    const double relative_variance = variance * out.ramp_variance * out.ramp_variance;
    if (relative_variance > 2e-9) out.ramp_degrees = 2.0 / relative_variance;
    if (lost_ != nullptr) {
        out.ramp_variance *= lost_->ramp_inflation;
        out.ramp_degrees = std::max(1.0, out.ramp_degrees);  // a variance that is hardly known has few of them
    }
    return out;
}

}  // namespace ringlock::noise
