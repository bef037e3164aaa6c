#include "analysis/closure/whitening.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace ringlock::closure {

namespace {

/// One step of a first-order Gauss-Markov rate and its integral (the angle).
struct RateStep {
    double decay, gain_s;
    double angle_variance, covariance, rate_variance;
};

RateStep step_of(const PhaseRateTerm& term, double dt) {
    const double x = dt / term.time_s;
    const double e = std::expm1(-x);  // exp(-x) - 1
    // 2 x - 3 + 4 exp(-x) - exp(-2 x): x^3 2/3 - x^4/2 + ..., which the closed form loses.
    const double angle =
        x < 0.02 ? x * x * x * (2.0 / 3.0 - x * (0.5 - x * (7.0 / 30.0 - x / 12.0))) : 2.0 * x + 2.0 * e - e * e;
    const double t = term.time_s;
    return {1.0 + e, -e * t, term.variance_rad2_s2 * t * t * angle, term.variance_rad2_s2 * t * e * e,
            term.variance_rad2_s2 * -std::expm1(-2.0 * x)};
}

/// Transition, noise and start of the states: a, m, then the rates.
struct System {
    Eigen::MatrixXd transition, noise, start;
};

/// Gains and standard deviations of the filter with D states.
template <int D>
void run(const TurnFrame& frame, const TurnNoise& noise, const System& system, std::vector<double>& gains,
         std::vector<double>& sd) {
    using Matrix = Eigen::Matrix<double, D, D>;
    using Vector = Eigen::Matrix<double, D, 1>;
    const Matrix t = system.transition;
    const Matrix q = system.noise;
    Matrix p = system.start;
    Vector h = Vector::Zero();
    h(0) = 1.0;
    for (std::size_t i = 0; i < frame.sign.size(); ++i) {
        h(1) = frame.sign[i];
        const double through = 1.0 - frame.before_slope[i];
        const double kick = frame.kick_slope[i];
        const double r = noise.injected_rad2 + through * through * noise.readout_rad2;
        const Vector ph = p * h;
        const double f = std::max(ph.dot(h) + r, 1e-30);
        Vector gain = t * ph;
        gain(0) -= kick * through * noise.readout_rad2;
        p = (t * p * t.transpose() + q - gain * gain.transpose() / f).eval();
        p(0, 0) += kick * kick * noise.readout_rad2;
        gain /= f;
        for (int s = 0; s < D; ++s) gains[i * D + static_cast<std::size_t>(s)] = gain(s);
        sd[i] = std::sqrt(f);
    }
}

template <int D>
void run_with(int states, const TurnFrame& frame, const TurnNoise& noise, const System& system,
              std::vector<double>& gains, std::vector<double>& sd) {
    if constexpr (D <= Whitening::most_states) {
        if (states == D) return run<D>(frame, noise, system, gains, sd);
        run_with<D + 1>(states, frame, noise, system, gains, sd);
    }
}

}  // namespace

Whitening::Whitening(const TurnFrame& frame, const TurnNoise& noise) : frame_(frame) {
    const std::size_t n = frame.sign.size();
    const double dt = frame.interval_s;
    const bool walks = noise.walk_rad2_per_s3 > 0.0;
    states_ = 2 + noise.rates.size() + (walks ? 1 : 0);
    const auto d = static_cast<Eigen::Index>(states_);
    System system{Eigen::MatrixXd::Identity(d, d), Eigen::MatrixXd::Zero(d, d), Eigen::MatrixXd::Zero(d, d)};
    auto& [t, q, p] = system;
    q(1, 1) = noise.wander_rad2;
    q(0, 0) = noise.white_rad2_per_s * dt;
    Eigen::Index at = 2;
    const auto add = [&](const RateStep& step, double start_variance) {
        rate_decay_.push_back(step.decay);
        rate_gain_s_.push_back(step.gain_s);
        t(at, at) = step.decay;
        t(0, at) = step.gain_s;
        q(0, 0) += step.angle_variance;
        q(0, at) = q(at, 0) = step.covariance;
        q(at, at) = step.rate_variance;
        p(at, at) = start_variance;
        ++at;
    };
    for (const PhaseRateTerm& term : noise.rates) add(step_of(term, dt), term.variance_rad2_s2);
    if (walks) {
        const double w = noise.walk_rad2_per_s3;
        add({1.0, dt, w * dt * dt * dt / 3.0, 0.5 * w * dt * dt, w * dt}, 0.0);
    }
    if (states_ > most_states) throw std::logic_error("Whitening: too many rates");
    gains_.resize(n * states_);
    sd_.resize(n);
    run_with<2>(static_cast<int>(states_), frame, noise, system, gains_, sd_);
}

std::vector<double> Whitening::apply(std::span<const double> series) const {
    std::vector<double> out(series.size());
    std::vector<double> state(states_, 0.0);
    for (std::size_t i = 0; i < series.size(); ++i) {
        const double innovation = series[i] - state[0] - frame_.sign[i] * state[1];
        out[i] = innovation / sd_[i];
        const double* gain = gains_.data() + i * states_;
        state[0] += gain[0] * innovation;
        state[1] += gain[1] * innovation;
        for (std::size_t s = 2; s < states_; ++s) {
            state[0] += rate_gain_s_[s - 2] * state[s];
            state[s] = rate_decay_[s - 2] * state[s] + gain[s] * innovation;
        }
    }
    return out;
}

}  // namespace ringlock::closure
