#include "analysis/closure/turns/loop/competing_tests.hpp"

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

bool follows_column(const TurnResidualTest& test) {
    return test.result.where == Where::temperature || test.result.where == Where::rate ||
           test.result.where == Where::amplitude;
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
    auto tests = test_residual(fit);
    std::erase_if(tests,
                  [](const TurnResidualTest& test) { return !test.columns || test.result.evidence < options.tie; });
    std::sort(tests.begin(), tests.end(), [](const TurnResidualTest& a, const TurnResidualTest& b) {
        return a.result.evidence > b.result.evidence;
    });
    if (tests.size() > limits.tests_refitted) tests.resize(limits.tests_refitted);
    const bool on_beat = is_line_on_beat(fit, *choice.chosen);
    double competing = 0.0;
    for (const auto& alternative : choice.alternatives) competing = std::max(competing, alternative.evidence);
    std::optional<double> most;
    for (const TurnResidualTest& test : tests) {
        // In a gyro whose phases come in step, anything that follows the phase makes lines: kicks of first order in a
        // test count for more against a line at a harmonic of the beat.
        const bool of_phase = test.result.where == Where::phase;
        const double counts = on_beat && of_phase ? limits.phase_against_beat : 1.0;
        const double evidence = counts * refitted_evidence(fit, test, competing);
        const auto beats = [&](const Naming::Alternative& alternative) {
            const double tied = alternative.evidence - options.tie;
            const bool in_step = of_phase && changes_angle_only(*alternative.effect) && phases_in_step(fit);
            if (in_step) return evidence > std::min(tied, (1.0 - limits.first_order_error) * alternative.evidence);
            if (!is_random_rate(*alternative.effect)) return evidence > alternative.evidence + options.tie;
            // A random rate can follow jumps nearly as well as the jumps themselves, and a cause that is visible in a
            // noisy column better than the column does.
            if (follows_column(test)) {
                return evidence > std::min(tied, (1.0 - limits.noise_of_column) * alternative.evidence);
            }
            return evidence > (test.jumps ? tied : alternative.evidence + options.tie);
        };
        if (std::all_of(choice.alternatives.begin(), choice.alternatives.end(), beats)) {
            most = std::max(evidence, most.value_or(evidence));
        }
    }
    return most;
}

bool two_explain(const TurnProblem& problem, const Choice& choice, double evidence_of_test) {
    const Ranking ranking =
        rank_candidates(problem, *choice.chosen->fitted, options.turns.loop.second_of_coupling, Among::not_random);
    if (ranking.seen_in_other_columns || ranking.candidates.empty()) return false;
    const Candidate& second = ranking.candidates.front();
    if (!passes(second.p_value)) return false;
    if (!is_of_coupling(*choice.chosen->effect) && !is_of_coupling(*second.effect)) return false;
    return choice.chosen->evidence + second.evidence - cost_of_choice() > evidence_of_test;
}

Verification verify(const TurnFit& fit) {
    const TurnOptions::Loop& limits = options.turns.loop;
    Verification verification;
    auto tests = test_residual(fit);
    for (const TurnResidualTest& test : tests) verification.tests.push_back(test.result);
    const double threshold = options.level_of_residual / static_cast<double>(tests.size());
    std::erase_if(tests, [&](const TurnResidualTest& test) { return !(test.result.p_value < threshold); });
    if (tests.empty()) return verification;
    std::sort(tests.begin(), tests.end(), [](const TurnResidualTest& a, const TurnResidualTest& b) {
        return a.result.evidence > b.result.evidence ||
               (a.result.evidence == b.result.evidence && a.result.p_value < b.result.p_value);
    });
    verification.unexplained = tests.front().result;
    double most = 0.0;
    for (std::size_t k = 0; k < std::min(limits.tests_refitted, tests.size()) && tests[k].columns; ++k) {
        const bool on_beat = tests[k].hz && is_on_beat(fit, *tests[k].hz);
        const double evidence = refitted_evidence(fit, tests[k], std::numeric_limits<double>::infinity()) /
                                (on_beat ? limits.phase_against_beat : 1.0);
        if (evidence <= most) continue;
        most = evidence;
        verification.unexplained = tests[k].result;
    }
    return verification;
}

}  // namespace ringlock::closure
