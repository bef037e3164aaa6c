#include "engine/gyro/resonator.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <complex>

#include "engine/core/dense.hpp"
#include "engine/core/units.hpp"

namespace ringlock::gyro {

namespace {

using Eigen::Matrix2d;
using Eigen::Matrix4d;
using Eigen::Vector2d;
using Eigen::Vector4d;

/// Free motion of (x, x'/w) over an angle w t.
Matrix2d free_motion(double damping, double angle_rad) {
    const double root = std::sqrt(1.0 - damping * damping);
    const double decay = std::exp(-damping * angle_rad);
    const double c = decay * std::cos(root * angle_rad);
    const double s = decay * std::sin(root * angle_rad) / root;
    return Matrix2d{{c + damping * s, s}, {-s, c - damping * s}};
}

/// Steady motion under a constant force of amplitude 1: x = -cos(w t).
Vector2d steady_motion(double angle_rad) { return {-std::cos(angle_rad), std::sin(angle_rad)}; }

/// Transition of the state (u, q, loop's force, level). With `redraw` a new level replaces the old one.
Matrix4d keep_or_redraw(const Matrix4d& advance, bool redraw) {
    Matrix4d all = advance;
    if (redraw) all.row(3).setZero();
    return all;
}

/// P = A P A^T + W, summed by doubling.
Matrix4d stationary(Matrix4d a, Matrix4d w) {
    for (int i = 0; i < 60 && a.cwiseAbs().maxCoeff() > 1e-18; ++i) {
        w += a * w * a.transpose();
        a = a * a;
    }
    return w;
}

}  // namespace

Resonator::Resonator(const DriveNoise& noise) : noise_(noise), damping_(0.5 / noise.resonator_q) {
    // From a nominal turn to the next the sign of the turn changes: upright states change theirs.
    step_ = -free_motion(damping_, units::pi);
    held_input_ = Vector2d(1.0, 0.0) - step_ * Vector2d(1.0, 0.0);
    for (int i = 0; i < white_levels; ++i) {
        // At the turn at the beginning, a minimum, upright is minus; at its end, a maximum, it is plain.
        const double from = units::pi * i / white_levels;
        const double to = units::pi * (i + 1) / white_levels;
        const Vector2d added = steady_motion(to) - free_motion(damping_, to - from) * steady_motion(from);
        white_inputs_[static_cast<std::size_t>(i)] = free_motion(damping_, units::pi - to) * added;
    }
    if (noise.amplitude_loop_hz > 0.0) {
        // Open loop: k/(i f) with a first-order lag at the resonator's half bandwidth; k per half cycle.
        const double half_bandwidth_hz = damping_ * noise.frequency_hz;
        const double f = noise.amplitude_loop_hz;
        const double crossing = units::two_pi * f * std::hypot(f, half_bandwidth_hz) / half_bandwidth_hz;
        loop_gain_ = crossing * 0.5 / noise.frequency_hz;
    }
    const Matrix4d a = advance();
    decay_ = dense::spectral_radius(a.topLeftCorner<3, 3>());
    if (loop_gain_ == 0.0) decay_ = dense::spectral_radius(step_);
    if (noise.form == NoiseForm::sinusoidal) {
        // The product of the two sinusoids is a pair of lines at w +- m; each is answered by the resonator.
        const std::complex<double> i(0.0, 1.0);
        const double m = noise.modulation_hz / noise.frequency_hz;  // over w
        const auto answer = [&](double line) {
            return (1.0 / noise.resonator_q) / (1.0 - line * line + i * line / noise.resonator_q);
        };
        // sin(m t) sin(t) = Re[exp(i (1 - m) t) - exp(i (1 + m) t)]/2. x = Re[(g- exp(-i m t) - g+ exp(i m t)) exp(i
        // t)]/2; at a turn with exp(i t) = s, upright u = Re[g- exp(-i m t) - g+ exp(i m t)]/2 times -1 at minima,
        // where s is +1.
        const std::complex<double> below = answer(1.0 - m);
        const std::complex<double> above = answer(1.0 + m);
        // As Re[c exp(i m t)]: Re[g exp(-i a)] = Re[conj(g) exp(i a)].
        const std::complex<double> u = -0.5 * (std::conj(below) - above);
        const std::complex<double> slope = -0.5 * (std::conj(i * (1.0 - m) * below) - i * (1.0 + m) * above);
        // sin(a - lag) = Re[-i exp(-i lag) exp(i a)]
        response_ = {std::abs(u), -std::arg(i * u), std::abs(slope), -std::arg(i * slope)};
        looped_ = response_.u;
        if (loop_gain_ > 0.0) {
            // The loop answers the turns it sees, z = exp(i m pi) from each to the next.
            const std::complex<double> z = std::exp(i * (m * units::pi));
            const Eigen::Matrix3cd rest =
                z * Eigen::Matrix3cd::Identity() - a.topLeftCorner<3, 3>().cast<std::complex<double>>();
            const Eigen::Vector3cd driven = rest.fullPivLu().solve(Eigen::Vector3cd(0.0, 0.0, -loop_gain_ * u));
            looped_ = std::abs(u + driven(0));
        }
    }
    if (decay_ >= 1.0) return;
    const std::vector<double> covariance = autocovariance(2);
    rms_ = std::sqrt(covariance[0]);
    for (const std::size_t lag : {1U, 2U}) {
        change_[lag - 1] = std::sqrt(std::max(0.0, 2.0 * (1.0 - covariance[lag] / covariance[0])));
    }
}

double Resonator::settling_half_cycles() const {
    if (noise_.form == NoiseForm::sinusoidal && loop_gain_ == 0.0) return 0.0;
    return std::log(1e-9) / std::log(decay_);
}

Matrix4d Resonator::advance() const {
    Matrix4d a = Matrix4d::Zero();
    a.topLeftCorner<2, 2>() = step_;
    a.block<2, 1>(0, 2) = held_input_;
    a.block<2, 1>(0, 3) = held_input_;
    a(2, 0) = -loop_gain_;
    a(2, 2) = loop_gain_ > 0.0 ? 1.0 : 0.0;
    a(3, 3) = 1.0;
    return a;
}

std::vector<double> Resonator::autocovariance(int lags) const {
    std::vector<double> sums(static_cast<std::size_t>(lags) + 1, 0.0);
    if (noise_.form == NoiseForm::sinusoidal) {
        const double angle = units::pi * noise_.modulation_hz / noise_.frequency_hz;
        for (int lag = 0; lag <= lags; ++lag) {
            // A modulation of rms 1.
            sums[static_cast<std::size_t>(lag)] = looped_ * looped_ * std::cos(angle * lag);
        }
        return sums;
    }
    const Matrix4d a = advance();
    if (noise_.form == NoiseForm::white) {
        Matrix4d w = Matrix4d::Zero();
        for (const Vector2d& input : white_inputs_) w.topLeftCorner<2, 2>() += input * input.transpose();
        Matrix4d x = stationary(keep_or_redraw(a, true), w);
        for (double& sum : sums) {
            sum = x(0, 0);
            x = keep_or_redraw(a, true) * x;
        }
        return sums;
    }
    // From a redraw to the next one; then all phases between.
    const std::int64_t hold = noise_.hold_half_cycles;
    Matrix4d whole = Matrix4d::Identity();
    for (std::int64_t i = 0; i < hold; ++i) whole = keep_or_redraw(a, i + 1 == hold) * whole;
    const Matrix4d fresh = Vector4d(0.0, 0.0, 0.0, 1.0).asDiagonal();
    Matrix4d now = stationary(whole, fresh);
    for (std::int64_t phase = 0; phase < hold; ++phase) {
        Matrix4d x = now;
        for (int lag = 0; lag <= lags; ++lag) {
            sums[static_cast<std::size_t>(lag)] += x(0, 0) / static_cast<double>(hold);
            x = keep_or_redraw(a, (phase + lag + 1) % hold == 0) * x;
        }
        const bool redraw = phase + 1 == hold;
        const Matrix4d next = keep_or_redraw(a, redraw);
        now = next * now * next.transpose();
        if (redraw) now += fresh;
    }
    return sums;
}

}  // namespace ringlock::gyro
