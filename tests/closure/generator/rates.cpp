#include "tests/closure/generator/rates.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ringlock::test::closure {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

/// Sum of first-order Markov rates whose correlation times go up by `ratio`. One of variance s^2 and time T has the
/// one-sided density 4 s^2 T/(1 + (2 pi f T)^2); a sum over ln T in steps of ln(ratio) is s^2/(f ln(ratio)). Flicker of
/// B has B^2/(pi f) (Allan variance (2 ln 2/pi) B^2), hence s^2 = B^2 ln(ratio)/pi.
void add_flicker(double b_deg_h, std::uint64_t seed, std::span<const double> edges_s, std::vector<double>& rates) {
    constexpr double shortest_s = 0.03;
    constexpr double longest_s = 3e5;
    const double ratio = std::sqrt(10.0);
    const double sd = b_deg_h * std::sqrt(std::log(ratio) / std::numbers::pi);
    Random random(seed, Purpose::flicker);
    for (double time = shortest_s; time < 1.01 * longest_s; time *= ratio) {
        double now = sd * random.normal();
        for (std::size_t i = 0; i < rates.size(); ++i) {
            const double decay = std::exp(-(edges_s[i + 1] - edges_s[i]) / time);
            const double next = decay * now + sd * std::sqrt(1.0 - decay * decay) * random.normal();
            rates[i] += 0.5 * (now + next);
            now = next;
        }
    }
}

/// Chance alone decides how long a state lasts; the mean over an interval is the share of it spent in the upper one.
void add_telegraph(const RateTelegraph& truth, std::uint64_t seed, std::span<const double> edges_s,
                   std::vector<double>& rates) {
    Random random(seed, Purpose::telegraph);
    bool up = random.uniform() < 0.5;
    double until = edges_s.front() + truth.dwell_s * random.exponential();
    for (std::size_t i = 0; i < rates.size(); ++i) {
        double from = edges_s[i];
        double spent_up = 0.0;
        while (until < edges_s[i + 1]) {
            if (up) spent_up += until - from;
            from = until;
            up = !up;
            until += truth.dwell_s * random.exponential();
        }
        if (up) spent_up += edges_s[i + 1] - from;
        rates[i] += truth.step_deg_h * spent_up / (edges_s[i + 1] - edges_s[i]);
    }
}

double chirp_at(const RateChirp& chirp, double time_s) {
    const double turns = chirp.frequency_hz * time_s + 0.5 * chirp.chirp_hz_per_s * time_s * time_s;
    return chirp.rate_deg_h * std::sin(two_pi * (turns - std::floor(turns)) + chirp.phase_rad);
}

}  // namespace

Random::Random(std::uint64_t seed, Purpose purpose) {
    std::seed_seq words{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                        static_cast<std::uint32_t>(purpose), 0x72696e67U};
    engine_.seed(words);
}

double mean_of(const RateLine& line, double from_s, double to_s) {
    const double w = two_pi * line.frequency_hz;
    const double half = 0.5 * (to_s - from_s);
    const double turns = line.frequency_hz * 0.5 * (from_s + to_s);
    return line.rate_deg_h * std::sin(two_pi * (turns - std::floor(turns)) + line.phase_rad) * std::sin(w * half) /
           (w * half);
}

std::vector<double> mean_rates(const RateTruth& truth, std::uint64_t seed, std::span<const double> edges_s) {
    std::vector<double> rates(edges_s.empty() ? 0 : edges_s.size() - 1, 0.0);
    if (truth.quantum_noise_deg_rt_h != 0.0) {
        // N deg/sqrt(h) = 60 N arcsec/sqrt(s); an angle of variance N^2 dt over dt
        Random random(seed, Purpose::quantum_noise);
        for (std::size_t i = 0; i < rates.size(); ++i) {
            rates[i] += 60.0 * truth.quantum_noise_deg_rt_h * random.normal() / std::sqrt(edges_s[i + 1] - edges_s[i]);
        }
    }
    if (truth.bias_instability_deg_h != 0.0) add_flicker(truth.bias_instability_deg_h, seed, edges_s, rates);
    if (truth.rate_random_walk_deg_h_rt_h != 0.0) {
        // Mean of a Wiener process over dt: that of its ends, and a bridge of variance dt/12.
        Random random(seed, Purpose::rate_random_walk);
        double now = 0.0;
        for (std::size_t i = 0; i < rates.size(); ++i) {
            const double unit = truth.rate_random_walk_deg_h_rt_h * std::sqrt((edges_s[i + 1] - edges_s[i]) / 3600.0);
            const double next = now + unit * random.normal();
            rates[i] += 0.5 * (now + next) + unit * std::sqrt(1.0 / 12.0) * random.normal();
            now = next;
        }
    }
    if (truth.telegraph_bias.step_deg_h != 0.0) add_telegraph(truth.telegraph_bias, seed, edges_s, rates);
    const RateStep& step = truth.bias_step;
    for (std::size_t i = 0; i < rates.size(); ++i) {
        const double from = edges_s[i];
        const double to = edges_s[i + 1];
        const RateSettling& settling = truth.settling;
        if (settling.start_deg_h != 0.0) {
            const double lost = std::expm1(-(to - from) / settling.constant_s);
            rates[i] -=
                settling.start_deg_h * settling.constant_s / (to - from) * std::exp(-from / settling.constant_s) * lost;
        }
        if (step.step_deg_h != 0.0 && step.time_s < to) {
            rates[i] += step.step_deg_h * std::min(1.0, (to - step.time_s) / (to - from));
        }
        rates[i] += truth.bias_ramp_deg_h_per_h * 0.5 * (from + to) / 3600.0;
        if (truth.base_vibration.rate_deg_h != 0.0) rates[i] += mean_of(truth.base_vibration, from, to);
        if (truth.slow_swing.rate_deg_h != 0.0) rates[i] += mean_of(truth.slow_swing, from, to);
        if (truth.chirped_line.rate_deg_h != 0.0) {
            // Gauss's rule of three points: good to 1e-6 for an eighth of a period
            const double middle = 0.5 * (from + to);
            const double off = 0.5 * (to - from) * std::sqrt(0.6);
            rates[i] += (5.0 * chirp_at(truth.chirped_line, middle - off) + 8.0 * chirp_at(truth.chirped_line, middle) +
                         5.0 * chirp_at(truth.chirped_line, middle + off)) /
                        18.0;
        }
    }
    return rates;
}

}  // namespace ringlock::test::closure
