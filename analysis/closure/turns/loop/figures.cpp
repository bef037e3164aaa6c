#include "analysis/closure/turns/loop/figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/loop/competing_tests.hpp"
#include "analysis/closure/turns/screen/side_channels.hpp"

namespace ringlock::closure {

namespace {

/// Frequency of the dither by its own turns: the slope of their times. Its error follows from the scatter of means over
/// stretches with their correlation (Newey and West, Econometrica 55, 1987, 703), which a varying input causes.
Estimate dither_frequency(const TurnFit& fit) {
    constexpr std::size_t stretches = options.turns.loop.frequency_stretches;
    const auto& turn_s = fit.prediction().turn_s;
    const double interval_s = fit.model().series().interval_s;
    std::vector<double> at;
    std::vector<double> late_s;
    for (std::size_t s = 0; s < stretches; ++s) {
        // Whole cycles, since minima and maxima may be late by different times.
        const std::size_t begin = (turn_s.size() * s / stretches) & ~std::size_t{1};
        const std::size_t end = (turn_s.size() * (s + 1) / stretches) & ~std::size_t{1};
        double sum = 0.0;
        for (std::size_t i = begin; i < end; ++i) sum += turn_s[i] - interval_s * static_cast<double>(i);
        late_s.push_back(sum / static_cast<double>(end - begin));
        at.push_back(0.5 * static_cast<double>(begin + end - 1));
    }
    const double mean = std::accumulate(at.begin(), at.end(), 0.0) / stretches;
    const double mean_late_s = std::accumulate(late_s.begin(), late_s.end(), 0.0) / stretches;
    double squares = 0.0;
    double slope_s = 0.0;
    for (std::size_t s = 0; s < stretches; ++s) {
        squares += (at[s] - mean) * (at[s] - mean);
        slope_s += (at[s] - mean) * late_s[s];
    }
    slope_s /= squares;
    constexpr std::size_t memory = options.turns.loop.frequency_memory;
    double scatter = 0.0;
    std::vector<double> pull;
    for (std::size_t s = 0; s < stretches; ++s) {
        const double off_s = late_s[s] - mean_late_s - slope_s * (at[s] - mean);
        scatter += off_s * off_s / (stretches - 2);
        pull.push_back(off_s * (at[s] - mean));
    }
    double variance = 0.0;
    for (std::size_t lag = 0; lag < memory; ++lag) {
        const double weight = (lag == 0 ? 1.0 : 2.0) * (1.0 - static_cast<double>(lag) / memory);
        for (std::size_t s = lag; s < stretches; ++s) variance += weight * pull[s] * pull[s - lag];
    }
    variance = std::max(scatter / squares, variance / (squares * squares));
    const double turns_s = interval_s + slope_s;
    return {"", "dither_frequency_hz", 0.5 / turns_s, 0.5 / (turns_s * turns_s) * std::sqrt(variance)};
}

/// Amplitude and frequency of the dither: means over the record.
void add_dither(std::vector<Estimate>& base, const Fitted& fitted) {
    const gyro::Setup& setup = fitted.series().setup;
    const auto n = static_cast<double>(fitted.series().size());
    base.push_back(dither_frequency(*fitted.fit));
    base.push_back(
        {"", "dither_peak_rate_deg_s", setup.dither_peak_rate_deg_s,
         setup.dither_peak_rate_deg_s * fitted.fit->sd_rad().front() / (fitted.series().amplitude_rad * std::sqrt(n))});
}

}  // namespace

bool is_rounding(double heldout_error_rad) { return heldout_error_rad < options.turns.loop.rounding_rad; }

HeldoutScore heldout(const TurnFit& fit) {
    HeldoutScore score;
    double count = 0.0;
    for (std::size_t i = 0; i < fit.innovations().size(); ++i) {
        if (fit.rows()[i]) continue;
        const double e = fit.innovations()[i];
        const double sd = fit.sd_rad()[i];
        score.error_rad += e * e * sd * sd;
        score.floor_rad += sd * sd;
        score.log_score -= 0.5 * e * e + std::log(sd);
        count += 1.0;
    }
    score.error_rad = std::sqrt(score.error_rad / count);
    score.floor_rad = std::sqrt(score.floor_rad / count);
    return score;
}

void take_figures(const record::Turns& turns, const Fitted& whole, Closure& closure) {
    for (const Estimate& estimate : whole.fit->estimates()) {
        if (estimate.effect.empty()) {
            closure.base.push_back(estimate);
            continue;
        }
        for (Step& step : closure.steps) {
            if (step.effect->name() == estimate.effect) step.parameters.push_back(estimate);
        }
    }
    for (const Candidate& candidate : screen_side_channels(turns, *whole.fit, whole.joined(), true)) {
        for (Step& step : closure.steps) {
            if (step.effect != candidate.effect) continue;
            for (const effects::Parameter& parameter : candidate.effect->parameters()) {
                const std::string name(parameter.name);
                const auto sd = candidate.sd.find(name);
                step.parameters.push_back(
                    {std::string(step.effect->name()), name, candidate.values.at(name),
                     sd == candidate.sd.end() ? std::numeric_limits<double>::quiet_NaN() : sd->second});
            }
        }
    }
    add_dither(closure.base, whole);
}

void take_residual(const record::Turns& turns, const Fitted& fitted, Closure& closure) {
    const HeldoutScore last = heldout(*fitted.fit);
    closure.heldout_after = last.error_rad;
    closure.noise_floor = last.floor_rad;
    closure.residual.time_s = turns.time_s;
    for (std::size_t i = 0; i < turns.size(); ++i) {
        const double sd = fitted.fit->sd_rad()[i];
        closure.residual.innovation.push_back(fitted.fit->innovations()[i] * sd);
        closure.residual.sd.push_back(sd);
        closure.residual.reported.push_back(fitted.fit->rows()[i] ? 0 : 1);
        closure.mean_input_rate_deg_h += fitted.series().input_rate_deg_h[i] / static_cast<double>(turns.size());
    }
}

std::string note_on_frequency(const TurnFit& without, const TurnFit& with, const effects::Effect& effect) {
    const auto hz = frequency_hz_of(with, effect);
    if (!hz) return {};
    std::string others;
    for (const double other : frequencies_as_likely(without, effect, *hz, 2.0 * options.tie)) {
        others += (others.empty() ? "" : " or ") + fmt::format("{:.4g}", other);
    }
    if (others.empty()) return {};
    return fmt::format(
        "{} of {:.4g} Hz: a frequency of {} Hz explains the record nearly as well, "
        "because the kicks of the lock-in shift either frequency to the other by the beat of the input rate; "
        "to distinguish them, record at another input rate",
        effect.name(), *hz, others);
}

}  // namespace ringlock::closure
