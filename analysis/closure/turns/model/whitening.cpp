#include "analysis/closure/turns/model/whitening.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "analysis/closure/stats/gauss_markov.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"

namespace ringlock::closure {

namespace {

/// One state of the filter (FilterNoises).
struct State {
    double decay = 1.0;
    double gain_s = 0.0;
    double noise = 0.0;
    double with_angle = 0.0;
    double start = 0.0;
};

State rate_state(const PhaseRateTerm& term, double dt, State& angle) {
    const GaussMarkovStep step(term.time_s, dt);
    const double variance = term.variance_rad2_s2;
    angle.noise += variance * step.angle_variance_s2;
    return {step.decay, step.gain_s, variance * step.rate_variance, variance * step.covariance_s, variance};
}

std::vector<State> states_of(const TurnNoise& noise, bool walks, double dt) {
    std::vector<State> states(2);
    states[0].noise = noise.white_rad2_per_s * dt;
    states[1].noise = noise.wander_rad2;
    if (noise.wander_forgets > 0.0) {
        states[1].decay = std::exp(-noise.wander_forgets);
        states[1].start = noise.wander_rad2 / -std::expm1(-2.0 * noise.wander_forgets);
    }
    for (const PhaseRateTerm& term : noise.rates) {
        const State state = rate_state(term, dt, states[0]);
        states.push_back(state);
    }
    if (walks) {
        const double w = noise.walk_rad2_per_s3;
        states[0].noise += w * dt * dt * dt / 3.0;
        states.push_back({1.0, dt, w * dt, 0.5 * w * dt * dt, 0.0});
    }
    if (states.size() > FilterNoises::most_states) throw std::logic_error("Whitening: too many rates");
    return states;
}

FilterNoises filter_noises(std::span<const TurnNoise> noises, double dt) {
    const bool walks =
        std::any_of(noises.begin(), noises.end(), [](const TurnNoise& n) { return n.walk_rad2_per_s3 > 0.0; });
    const std::size_t states = states_of(noises.front(), walks, dt).size();
    FilterNoises all(noises.size(), states);
    for (std::size_t k = 0; k < all.row; ++k) {
        const TurnNoise& noise = noises[std::min(k, noises.size() - 1)];
        const std::vector<State> of = states_of(noise, walks, dt);
        if (of.size() != states) throw std::logic_error("Whitening: noises with different rates");
        all.injected_rad2[k] = noise.injected_rad2;
        all.readout_rad2[k] = noise.readout_rad2;
        for (std::size_t s = 0; s < states; ++s) {
            const std::size_t at = s * all.row + k;
            all.decay[at] = of[s].decay;
            all.gain_s[at] = of[s].gain_s;
            all.noise[at] = of[s].noise;
            all.with_angle[at] = of[s].with_angle;
            all.start[at] = of[s].start;
        }
    }
    return all;
}

}  // namespace

Whitening::Whitening(const TurnFrame& frame, const TurnNoise& noise)
    : frame_(frame), noises_(filter_noises({&noise, 1}, frame.interval_s)) {
    gains_.resize(frame.sign.size() * noises_.states);
    sd_.resize(frame.sign.size());
    filter_gains(frame, noises_, gains_, sd_);
}

double Whitening::minus_log_likelihood(const TurnFrame& frame, const TurnNoise& noise, std::span<const double> series,
                                       std::span<const std::uint8_t> counts) {
    return minus_log_likelihoods(frame, {&noise, 1}, series, counts).front();
}

std::vector<double> Whitening::minus_log_likelihoods(const TurnFrame& frame, std::span<const TurnNoise> noises,
                                                     std::span<const double> series,
                                                     std::span<const std::uint8_t> counts) {
    constexpr std::size_t at_once = 8;  // number of lanes of the longest vectors
    std::vector<double> all(noises.size());
    side_by_side((noises.size() + at_once - 1) / at_once, [&](std::size_t part) {
        const auto some = noises.subspan(part * at_once, std::min(at_once, noises.size() - part * at_once));
        const auto found = filter_likelihoods(frame, filter_noises(some, frame.interval_s), series, counts);
        std::copy(found.begin(), found.end(), all.begin() + static_cast<std::ptrdiff_t>(part * at_once));
    });
    return all;
}

std::vector<double> Whitening::apply(std::span<const double> series) const {
    std::vector<double> out(series.size());
    FilterState state{};
    filter_innovations(frame_, noises_, gains_, sd_, 0, state, series, out);
    return out;
}

void Whitening::apply(std::size_t first, std::span<double> part, FilterState& state) const {
    filter_innovations(frame_, noises_, gains_, sd_, first, state, part, part);
}

Whitening::Innovations Whitening::innovations(const TurnFrame& frame, const TurnNoise& noise,
                                              std::span<const double> series) {
    Innovations of{std::vector<double>(series.size()), std::vector<double>(series.size())};
    filter_innovations_once(frame, filter_noises({&noise, 1}, frame.interval_s), series, of.white, of.sd_rad);
    return of;
}

ReadingErrors Whitening::reading_errors(std::span<const double> series) const {
    constexpr int most = FilterNoises::most_states;
    using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most, 1>;
    using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most, most>;
    const auto states = static_cast<Eigen::Index>(noises_.states);
    Matrix step = Matrix::Identity(states, states);
    for (Eigen::Index s = 1; s < states; ++s) {
        const std::size_t at = static_cast<std::size_t>(s) * noises_.row;
        step(s, s) = noises_.decay[at];
        if (s > 1) step(0, s) = noises_.gain_s[at];
    }
    const std::vector<double> innovations = apply(series);
    ReadingErrors errors;
    errors.mean_rad.resize(series.size());
    errors.variance_rad2.resize(series.size());
    // The information of later turns on the state, and its weight.
    Vector after = Vector::Zero(states);
    Matrix weight = Matrix::Zero(states, states);
    Vector seen = Vector::Zero(states);
    seen(0) = 1.0;
    for (std::size_t i = series.size(); i-- > 0;) {
        seen(1) = frame_.sign[i];
        const Eigen::Map<const Vector> gain(&gains_[i * noises_.states], states);
        const double readout = noises_.readout_rad2.front() * frame_.readout_at(i);
        const double through = 1.0 - frame_.before_slope[i];
        const double kick = frame_.kick_slope[i];
        const double over = 1.0 / (sd_[i] * sd_[i]);
        const double smoothing_error = innovations[i] / sd_[i] - gain.dot(after);
        const Vector weighed = weight * gain;
        errors.mean_rad[i] = readout * (through * smoothing_error - kick * after(0));
        errors.variance_rad2[i] = readout - readout * readout *
                                                (through * through * (over + gain.dot(weighed)) +
                                                 kick * kick * weight(0, 0) + 2.0 * through * kick * weighed(0));
        const Matrix on = step - gain * seen.transpose();
        after = (seen * smoothing_error + step.transpose() * after).eval();
        weight = (over * seen * seen.transpose() + on.transpose() * weight * on).eval();
    }
    return errors;
}

}  // namespace ringlock::closure
