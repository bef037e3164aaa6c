#include "analysis/noise/likelihood.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace ringlock::noise {
namespace {

using Matrix = Eigen::Matrix<double, term_count, term_count>;
using Vector = Eigen::Matrix<double, term_count, 1>;

}  // namespace

struct Likelihood::State {
    double deviance = std::numeric_limits<double>::infinity();
    Vector gradient = Vector::Zero();   ///< of the deviance
    Matrix curvature = Matrix::Zero();  ///< its expectation: twice the Fisher information
    double ramp = 0.0;
    double ramp_variance = 0.0;
    std::array<double, 2> corner{};
};

Likelihood::State Likelihood::evaluate(const TermValues& theta, const Model& model, bool derivatives) const {
    State s;
    double logs = 0.0;
    double power = 0.0;
    std::array<double, 2> uu{};
    std::array<double, 2> uz{};
    double dd = 0.0;
    double dz = 0.0;
    double du = 0.0;
    for (const Bin& b : bins_) {
        double v = 0.0;
        for (std::size_t i = 0; i < term_count; ++i) v += theta[i] * b.shape[i];
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
    std::array<Vector, 2> duu = {Vector::Zero(), Vector::Zero()};
    std::array<Vector, 2> duz = {Vector::Zero(), Vector::Zero()};
    Vector ddd = Vector::Zero();
    Vector ddu = Vector::Zero();
    for (const Bin& b : bins_) {
        const Eigen::Map<const Vector> g(b.shape.data());
        const double w = 1.0 / g.dot(Eigen::Map<const Vector>(theta.data()));
        const double w2 = w * w;
        const double residual_power = b.power + r * (r * b.ramp2 - 2.0 * b.ramp_data);
        s.gradient += (b.count * w - residual_power * w2) * g;
        s.curvature += b.count * w2 * (g * g.transpose());
        ddd -= b.ramp2 * w2 * g;
        ddu -= b.ramp_corner * w2 * g;
        for (std::size_t p = 0; p < 2; ++p) {
            duu[p] -= b.corner2[p] * w2 * g;
            duz[p] -= (b.corner_data[p] - (p == 1 ? r * b.ramp_corner : 0.0)) * w2 * g;
        }
    }
    for (std::size_t p = 0; p < 2; ++p) {
        const double c = uz[p];
        Vector denominator = q * duu[p];  // derivative of 1 + q uu
        denominator[quantisation] += uu[p];
        s.gradient += k[p] * denominator + q * c * c * k[p] * k[p] * denominator - 2.0 * q * k[p] * c * duz[p];
        s.gradient[quantisation] -= k[p] * c * c;
        if (p == 1 && restricted) {
            Vector change = ddd + q * k[1] * k[1] * du * du * denominator - 2.0 * q * k[1] * du * ddu;
            change[quantisation] -= k[1] * du * du;
            s.gradient += change / information;
        }
    }
    return s;
}

TermValues Likelihood::first_guess(const Model& model) const {
    // Each term alone would explain the whole power; an equal share of each.
    TermValues theta{};
    double power = 0.0;
    TermValues shape{};
    for (const Bin& b : bins_) {
        power += b.power;
        for (std::size_t i = 0; i < term_count; ++i) shape[i] += b.count * b.shape[i];
    }
    const auto terms = static_cast<double>(std::count(model.has.begin(), model.has.end(), true));
    for (std::size_t i = 0; i < term_count; ++i) {
        if (model.has[i]) theta[i] = power / (shape[i] * terms);
    }
    return theta;
}

Maximum Likelihood::maximise(const Model& model, const TermValues* start, std::size_t fixed, double fixed_value) const {
    constexpr int most_iterations = 100;
    constexpr double enough = 1e-7;  // of deviance, whose scale is 1
    TermValues theta = start != nullptr ? *start : first_guess(model);
    for (std::size_t i = 0; i < term_count; ++i) {
        if (!model.has[i]) theta[i] = 0.0;
    }
    if (fixed < term_count) theta[fixed] = fixed_value;

    State state = evaluate(theta, model, true);
    for (int iteration = 0; iteration < most_iterations; ++iteration) {
        std::array<Eigen::Index, term_count> free{};
        Eigen::Index count = 0;
        for (std::size_t i = 0; i < term_count; ++i) {
            const bool movable = model.has[i] && i != fixed;
            if (movable && (theta[i] > 0.0 || state.gradient[static_cast<Eigen::Index>(i)] < 0.0)) {
                free[static_cast<std::size_t>(count++)] = static_cast<Eigen::Index>(i);
            }
        }
        if (count == 0) break;
        Eigen::MatrixXd h(count, count);
        Eigen::VectorXd g(count);
        for (Eigen::Index a = 0; a < count; ++a) {
            g[a] = state.gradient[free[a]];
            for (Eigen::Index b = 0; b < count; ++b) h(a, b) = state.curvature(free[a], free[b]);
        }
        const Eigen::VectorXd scale = h.diagonal().cwiseSqrt().cwiseInverse();
        Eigen::MatrixXd scaled = scale.asDiagonal() * h * scale.asDiagonal();
        scaled.diagonal().array() += 1e-12;
        const Eigen::VectorXd step = -(scale.asDiagonal() * scaled.ldlt().solve(scale.asDiagonal() * g)).eval();
        double length = 1.0;
        bool moved = false;
        double gain = 0.0;
        for (int halving = 0; halving < 30; ++halving, length *= 0.5) {
            TermValues trial = theta;
            for (Eigen::Index a = 0; a < count; ++a) {
                double& t = trial[static_cast<std::size_t>(free[a])];
                t = std::max(0.0, t + length * step[a]);
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
    std::array<Eigen::Index, term_count> inside{};
    Eigen::Index count = 0;
    for (std::size_t i = 0; i < term_count; ++i) {
        if (model.has[i] && theta[i] > 0.0) inside[static_cast<std::size_t>(count++)] = static_cast<Eigen::Index>(i);
    }
    if (count > 0 && std::isfinite(state.deviance)) {
        Eigen::MatrixXd relative(count, count);  // information about ln theta
        for (Eigen::Index a = 0; a < count; ++a) {
            for (Eigen::Index b = 0; b < count; ++b) {
                relative(a, b) = 0.5 * state.curvature(inside[a], inside[b]) *
                                 theta[static_cast<std::size_t>(inside[a])] *
                                 theta[static_cast<std::size_t>(inside[b])];
            }
        }
        const Eigen::MatrixXd inverse = relative.completeOrthogonalDecomposition().pseudoInverse();
        for (Eigen::Index a = 0; a < count; ++a) {
            for (Eigen::Index b = 0; b < count; ++b) {
                const auto i = static_cast<std::size_t>(inside[a]);
                const auto k = static_cast<std::size_t>(inside[b]);
                out.covariance[i][k] = inverse(a, b) * theta[i] * theta[k];
            }
        }
    }
    return out;
}

}  // namespace ringlock::noise
