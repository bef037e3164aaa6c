#include "analysis/closure/whitening.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace ringlock::closure {

namespace {

using State = Whitening::State;

/// One step of a first-order Gauss-Markov rate and of its integral, the angle; what that gains goes to `angle`.
State rate_state(const PhaseRateTerm& term, double dt, State& angle) {
    const double x = dt / term.time_s;
    const double e = std::expm1(-x);  // exp(-x) - 1
    // 2 x - 3 + 4 exp(-x) - exp(-2 x): x^3 2/3 - x^4/2 + ..., which the closed form loses.
    const double variance =
        x < 0.02 ? x * x * x * (2.0 / 3.0 - x * (0.5 - x * (7.0 / 30.0 - x / 12.0))) : 2.0 * x + 2.0 * e - e * e;
    const double t = term.time_s;
    angle.noise += term.variance_rad2_s2 * t * t * variance;
    return {1.0 + e, -e * t, term.variance_rad2_s2 * -std::expm1(-2.0 * x), term.variance_rad2_s2 * t * e * e,
            term.variance_rad2_s2};
}

std::vector<State> states_of(const TurnNoise& noise, double dt) {
    std::vector<State> states(2);
    states[0].noise = noise.white_rad2_per_s * dt;
    states[1].noise = noise.wander_rad2;
    for (const PhaseRateTerm& term : noise.rates) {
        const State state = rate_state(term, dt, states[0]);
        states.push_back(state);
    }
    if (noise.walk_rad2_per_s3 > 0.0) {
        const double w = noise.walk_rad2_per_s3;
        states[0].noise += w * dt * dt * dt / 3.0;
        states.push_back({1.0, dt, w * dt, 0.5 * w * dt * dt, 0.0});
    }
    if (states.size() > Whitening::most_states) throw std::logic_error("Whitening: too many rates");
    return states;
}

/// The filter with D states, turn after turn. As each state but the angle keeps to itself, a step takes D^2 operations.
template <std::size_t D, class Turn>
void run(const TurnFrame& frame, const TurnNoise& noise, const std::vector<State>& states, Turn&& turn) {
    using Row = std::array<double, D>;
    Row decay{};
    Row gain_s{};
    Row added{};
    Row with_angle{};
    std::array<Row, D> p{};
    for (std::size_t s = 0; s < D; ++s) {
        decay[s] = states[s].decay;
        gain_s[s] = states[s].gain_s;
        added[s] = states[s].noise;
        with_angle[s] = states[s].with_angle;
        p[s][s] = states[s].start;
    }
    for (std::size_t i = 0; i < frame.sign.size(); ++i) {
        const double sign = frame.sign[i];
        const double through = 1.0 - frame.before_slope[i];
        const double kick = frame.kick_slope[i];
        Row gain;
        for (std::size_t s = 0; s < D; ++s) gain[s] = p[0][s] + sign * p[1][s];
        const double f =
            std::max(gain[0] + sign * gain[1] + noise.injected_rad2 + through * through * noise.readout_rad2, 1e-30);
        for (std::size_t s = 2; s < D; ++s) {
            gain[0] += gain_s[s] * gain[s];
            gain[s] *= decay[s];
        }
        gain[0] -= kick * through * noise.readout_rad2;
        // P <- T P T' + Q - gain gain'/f
        Row angle = p[0];
        for (std::size_t s = 2; s < D; ++s) {
            for (std::size_t j = 0; j < D; ++j) angle[j] += gain_s[s] * p[s][j];
        }
        for (std::size_t s = 2; s < D; ++s) angle[0] += gain_s[s] * angle[s];
        const double over = 1.0 / f;
        for (std::size_t s = 1; s < D; ++s) {
            const double share = gain[s] * over;
            for (std::size_t j = 1; j < D; ++j) p[s][j] = p[s][j] * (decay[s] * decay[j]) - share * gain[j];
            p[s][s] += added[s];
        }
        for (std::size_t j = 1; j < D; ++j) {
            p[0][j] = p[j][0] = angle[j] * decay[j] + with_angle[j] - gain[0] * over * gain[j];
        }
        p[0][0] = angle[0] + added[0] + kick * kick * noise.readout_rad2 - gain[0] * gain[0] * over;
        turn(i, f, over, gain);
    }
}

/// Calls `with` with the number of states as a constant.
template <std::size_t D = 2, class With>
void for_states(std::size_t states, With&& with) {
    if constexpr (D <= Whitening::most_states) {
        if (states == D) return with(std::integral_constant<std::size_t, D>{});
        for_states<D + 1>(states, with);
    }
}

/// State of the filter fed with a series.
template <std::size_t D>
struct Follower {
    std::array<double, D> x{};

    double innovation(double value, double sign) const { return value - x[0] - sign * x[1]; }
    /// `gain` per unit of innovation, on the way to the next turn.
    void step(const std::vector<State>& states, const double* gain, double innovation) {
        x[0] += gain[0] * innovation;
        x[1] += gain[1] * innovation;
        for (std::size_t s = 2; s < D; ++s) {
            x[0] += states[s].gain_s * x[s];
            x[s] = states[s].decay * x[s] + gain[s] * innovation;
        }
    }
};

}  // namespace

Whitening::Whitening(const TurnFrame& frame, const TurnNoise& noise)
    : frame_(frame), states_(states_of(noise, frame.interval_s)) {
    gains_.resize(frame.sign.size() * states_.size());
    sd_.resize(frame.sign.size());
    for_states(states_.size(), [&](auto d) {
        run<d>(frame, noise, states_, [&](std::size_t i, double f, double over, const auto& gain) {
            for (std::size_t s = 0; s < d; ++s) gains_[i * d + s] = gain[s] * over;
            sd_[i] = std::sqrt(f);
        });
    });
}

double Whitening::minus_log_likelihood(const TurnFrame& frame, const TurnNoise& noise, std::span<const double> series,
                                       std::span<const std::uint8_t> counts) {
    const std::vector<State> states = states_of(noise, frame.interval_s);
    double sum = 0.0;
    double product = 1.0;  // of variances, whose logarithms cost more than all the rest
    for_states(states.size(), [&](auto d) {
        Follower<d> follower;
        run<d>(frame, noise, states, [&](std::size_t i, double f, double over, auto gain) {
            const double innovation = follower.innovation(series[i], frame.sign[i]);
            if (counts[i]) {
                sum += 0.5 * innovation * innovation * over;
                const double through = 1.0 - frame.before_slope[i];
                product *= f / (through * through);
                if (!(product > 1e-200 && product < 1e200)) {
                    sum += 0.5 * std::log(product);
                    product = 1.0;
                }
            }
            for (double& g : gain) g *= over;
            follower.step(states, gain.data(), innovation);
        });
    });
    return sum + 0.5 * std::log(product);
}

std::vector<double> Whitening::apply(std::span<const double> series) const {
    std::vector<double> out(series.size());
    for_states(states_.size(), [&](auto d) {
        Follower<d> follower;
        for (std::size_t i = 0; i < series.size(); ++i) {
            const double innovation = follower.innovation(series[i], frame_.sign[i]);
            out[i] = innovation / sd_[i];
            follower.step(states_, gains_.data() + i * d, innovation);
        }
    });
    return out;
}

}  // namespace ringlock::closure
