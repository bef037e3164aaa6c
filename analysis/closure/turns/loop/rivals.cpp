#include "analysis/closure/turns/loop/rivals.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/model/effect_roles.hpp"

namespace ringlock::closure {

namespace {

bool follows_column(const TurnView& view) {
    return view.test.where == Where::temperature || view.test.where == Where::rate ||
           view.test.where == Where::amplitude;
}

/// Whether phases come in step: noise of a radian at the turns would prevent it.
bool phases_in_step(const TurnFit& fit) {
    return fit.parameters().injected_sd_rad < options.turns.loop.randomising_noise_rad;
}

}  // namespace

std::optional<double> frequency_hz_of(const TurnFit& fit, const effects::Effect& effect) {
    const effects::Parameter* frequency = effects::first_of(effect, effects::Role::frequency);
    if (frequency == nullptr) return std::nullopt;
    return fit.parameters().find(effect.name())->values.at(std::string(frequency->name));
}

bool is_on_beat(const TurnFit& fit, double hz) {
    if (!phases_in_step(fit)) return false;
    const TurnSeries& series = fit.model().series();
    const double beat_hz = fit.model().beat_hz();
    const double dither_hz = 0.5 / series.interval_s;
    for (int k = -harmonics_of_phase; k <= harmonics_of_phase; ++k) {
        const double apart_hz = std::abs(std::remainder(hz - k * beat_hz, dither_hz));
        if (k != 0 && apart_hz * series.time_s.back() < 1.0) return true;
    }
    return false;
}

bool is_line_on_beat(const TurnFit& fit, const Candidate& candidate) {
    const auto hz = frequency_hz_of(*candidate.fitted->fit, *candidate.effect);
    return hz && is_on_beat(fit, *hz);
}

std::optional<double> better_than_library(const TurnFit& fit, const Choice& choice) {
    const TurnOptions::Loop& limits = options.turns.loop;
    auto views = view_residual(fit);
    std::erase_if(views, [](const TurnView& view) { return !view.columns || view.test.merit < options.tie; });
    std::sort(views.begin(), views.end(),
              [](const TurnView& a, const TurnView& b) { return a.test.merit > b.test.merit; });
    if (views.size() > limits.tests_refitted) views.resize(limits.tests_refitted);
    const bool on_beat = is_line_on_beat(fit, *choice.chosen);
    double rival = 0.0;
    for (const auto& alternative : choice.alternatives) rival = std::max(rival, alternative.merit);
    std::optional<double> most;
    for (const TurnView& view : views) {
        // In a gyro whose phases come in step, anything that follows the phase makes lines: kicks of first order in a
        // test count for more against a line at a harmonic of the beat.
        const bool of_phase = view.test.where == Where::phase;
        const double counts = on_beat && of_phase ? limits.phase_against_beat : 1.0;
        const double merit = counts * refitted_merit(fit, view, rival);
        const auto beats = [&](const Naming::Alternative& alternative) {
            const double tied = alternative.merit - options.tie;
            const bool in_step = of_phase && changes_angle_only(*alternative.effect) && phases_in_step(fit);
            if (in_step) return merit > std::min(tied, (1.0 - limits.first_order_error) * alternative.merit);
            if (!is_random_rate(*alternative.effect)) return merit > alternative.merit + options.tie;
            // A random rate can follow jumps nearly as well as the jumps themselves, and a cause that is visible in a
            // noisy column better than the column does.
            if (follows_column(view)) {
                return merit > std::min(tied, (1.0 - limits.noise_of_column) * alternative.merit);
            }
            return merit > (view.jumps ? tied : alternative.merit + options.tie);
        };
        if (std::all_of(choice.alternatives.begin(), choice.alternatives.end(), beats)) {
            most = std::max(merit, most.value_or(merit));
        }
    }
    return most;
}

bool two_explain(const TurnProblem& problem, const Choice& choice, double merit_of_test) {
    const Ranking ranking =
        rank_candidates(problem, *choice.chosen->fitted, options.turns.loop.second_of_coupling, Among::not_random);
    if (ranking.seen_in_other_columns || ranking.candidates.empty()) return false;
    const Candidate& second = ranking.candidates.front();
    if (!passes(second.p_value)) return false;
    if (!is_of_coupling(*choice.chosen->effect) && !is_of_coupling(*second.effect)) return false;
    return choice.chosen->merit + second.merit - cost_of_choice() > merit_of_test;
}

Verification verify(const TurnFit& fit) {
    const TurnOptions::Loop& limits = options.turns.loop;
    Verification verification;
    auto views = view_residual(fit);
    for (const TurnView& view : views) verification.tests.push_back(view.test);
    const double threshold = options.level_of_residual / static_cast<double>(views.size());
    std::erase_if(views, [&](const TurnView& view) { return !(view.test.p_value < threshold); });
    if (views.empty()) return verification;
    std::sort(views.begin(), views.end(), [](const TurnView& a, const TurnView& b) {
        return a.test.merit > b.test.merit || (a.test.merit == b.test.merit && a.test.p_value < b.test.p_value);
    });
    verification.unexplained = views.front().test;
    double most = 0.0;
    for (std::size_t k = 0; k < std::min(limits.tests_refitted, views.size()) && views[k].columns; ++k) {
        const bool on_beat = views[k].hz && is_on_beat(fit, *views[k].hz);
        const double merit = refitted_merit(fit, views[k], std::numeric_limits<double>::infinity()) /
                             (on_beat ? limits.phase_against_beat : 1.0);
        if (merit <= most) continue;
        most = merit;
        verification.unexplained = views[k].test;
    }
    return verification;
}

}  // namespace ringlock::closure
