#include "analysis/closure/turns/loop/loop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/decide/rows.hpp"
#include "analysis/closure/decide/verdict.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/normality.hpp"
#include "analysis/closure/turns/loop/competing_tests.hpp"
#include "analysis/closure/turns/loop/figures.hpp"
#include "analysis/closure/turns/model/effect_roles.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
#include "analysis/closure/turns/screen/dither_amplitude.hpp"
#include "analysis/closure/turns/screen/dither_shape.hpp"
#include "analysis/closure/turns/screen/side_channels.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"

namespace ringlock::closure {

namespace {

bool is_among(const std::vector<const effects::Effect*>& effects, const effects::Effect* effect) {
    return std::find(effects.begin(), effects.end(), effect) != effects.end();
}

void add_once(std::vector<const effects::Effect*>& effects, const effects::Effect* effect) {
    if (!is_among(effects, effect)) effects.push_back(effect);
}

/// Effects with times and phases for a clock that begins with the first turn, as in the fit (TurnFit::estimates
/// converts back).
std::vector<ActiveEffect> since_first_turn(std::vector<ActiveEffect> effects, const record::Record& record) {
    for (ActiveEffect& active : effects) {
        set_back_clock(*active.effect, active.values, record.turns->time_s.front());
    }
    return effects;
}

std::vector<Step> steps_of(const std::vector<ActiveEffect>& effects) {
    std::vector<Step> steps;
    for (const ActiveEffect& active : effects) steps.emplace_back().effect = active.effect;
    return steps;
}

}  // namespace

TurnLoop::TurnLoop(const record::Record& record, const Monitor& monitor)
    : problem_(record, training_rows(record.turns->size())), monitor_(monitor) {}

/// The previous fit releases its memory of the length of the record.
void TurnLoop::go_on_with(std::shared_ptr<Fitted> fitted) {
    if (now_ && now_ != fitted) now_->fit->release();
    now_ = std::move(fitted);
}

/// If no motion of the declared device, or of the standard one, can be followed, no other model can be fitted.
void TurnLoop::fit_base() {
    try {
        now_ = problem_.fit({});
    } catch (const RunError&) {
        throw InputError(
            "/turns: the lock-in threshold is too high for the number of fringes in a half cycle: "
            "the phase never runs freely, so that its motion cannot be followed; "
            "record with more dither, or declare lock-in threshold and scale factor where they are wrong or missing");
    }
    const TurnSeries& series = now_->series();
    if (!series.scale_factor_declared) {
        closure_.notes.push_back(
            fmt::format("the record declares no scale factor; {:g} arcsec per fringe is assumed, "
                        "and all rates are proportional to it",
                        series.setup.scale_factor_arcsec));
    }
    if (!series.all_phases_come) {
        closure_.notes.push_back(
            "the turns occur in only a part of the fringe, as in a locked gyro: "
            "bias and threshold are determined only together, and the shape of the dither is not estimated");
    }
    closure_.heldout_before = heldout(*now_->fit).error_rad;
    base_log_likelihood_ = now_->log_likelihood();
}

/// Adds changes of the dither's amplitude, which are no effect of the library but part of the dither itself.
bool TurnLoop::add_amplitude(const Ranking& ranking, const Choice& choice) {
    // The lock-in of a locked gyro absorbs changes of the amplitude unless noise is injected.
    const TurnParameters& found = now_->parameters();
    const bool shows = now_->series().all_phases_come || found.injected_sd_rad > found.readout_sd_rad;
    if (ranking.seen_in_other_columns || !shows) return false;
    auto amplitude = find_amplitude_swing(problem_, *now_);
    if (!amplitude) amplitude = find_amplitude_memory(problem_, *now_);
    if (!amplitude) return false;
    if (choice.chosen != nullptr && !(amplitude->evidence > choice.alternatives.front().evidence - options.tie))
        return false;
    go_on_with(amplitude->fitted);
    if (closure_.steps.empty()) closure_.heldout_before = heldout(*now_->fit).error_rad;
    return true;
}

/// Whether the library explains more than any residual test. May change the choice to an effect of the coupling.
bool TurnLoop::library_explains_most(Ranking& ranking, Choice& choice) const {
    if (ranking.seen_in_other_columns) return true;
    const TurnFit& fit = *now_->fit;
    const auto evidence = better_than_library(fit, choice);
    if (!evidence) return true;
    if (!is_line_on_beat(fit, *choice.chosen)) return two_explain(problem_, choice, *evidence);
    // A line on the beat follows the phase: an effect of the coupling by itself may explain it.
    std::erase_if(ranking.candidates,
                  [&](const Candidate& c) { return is_line_on_beat(fit, c) || is_random_rate(*c.effect); });
    choice = choose(problem_, ranking);
    if (choice.chosen == nullptr || !is_of_coupling(*choice.chosen->effect)) return false;
    return !better_than_library(fit, choice);
}

/// Searches one more effect and adds it.
/// \return false if the record supports no further effect
bool TurnLoop::add_one() {
    check_interrupt();
    monitor_.tell("searching the library");
    Ranking ranking = rank_candidates(problem_, *now_, options.most_finalists);
    Choice choice = choose(problem_, ranking);
    if (add_amplitude(ranking, choice)) return true;
    if (choice.chosen == nullptr || !library_explains_most(ranking, choice)) return false;
    take(choice);
    return true;
}

/// An effect that was chosen in a set is confounded with the effects with which the others of the set are.
void TurnLoop::confound_with_partners(const Choice& choice, Step& step) {
    const auto expected = std::find(partners_.begin(), partners_.end(), step.effect);
    if (expected != partners_.end()) {
        partners_.erase(expected);
        for (const effects::Effect* other : closure_.steps.back().confounded_with) {
            if (other != step.effect) add_once(step.confounded_with, other);
        }
    } else {
        partners_.clear();
    }
    for (const effects::Effect* partner : choice.partners) add_once(partners_, partner);
}

void TurnLoop::take(const Choice& choice) {
    const Candidate& best = *choice.chosen;
    Step step;
    step.effect = best.effect;
    step.p_value = choice.p_value;
    step.confounded_with = choice.confounded_with;
    confound_with_partners(choice, step);
    if (!step.confounded_with.empty()) step.experiment = experiment_for(*step.effect, step.confounded_with);
    if (!earlier_ && choice.on_random) earlier_ = {now_, closure_.steps, step.effect};
    const HeldoutScore before = heldout(*now_->fit);
    step.note = note_on_frequency(*now_->fit, *best.fitted->fit, *best.effect);
    go_on_with(best.fitted);
    read_shape_again();
    drop_needless();
    const HeldoutScore after = heldout(*now_->fit);
    step.heldout_error_before = before.error_rad;
    step.heldout_error_after = after.error_rad;
    step.heldout_log_score_gain = after.log_score - before.log_score;
    monitor_.tell(fmt::format("added {}", step.effect->name()));
    closure_.steps.push_back(std::move(step));
}

/// Evaluates the dither's shape again: it depends on the rates in the model, and both shape effects on each other.
void TurnLoop::read_shape_again() {
    for (int pass = 0; pass < options.turns.loop.shape_readings; ++pass) {
        const auto shape = shape_read_again(problem_.turns(), *now_->fit);
        if (!shape) return;
        now_->fit->release();
        auto fitted = problem_.fit_or_none(*shape);
        if (!fitted) return;
        go_on_with(std::move(fitted));
    }
}

/// Removes effects that only substituted for the one added last.
void TurnLoop::drop_needless() {
    for (std::size_t k = closure_.steps.size(); k-- > 0;) {
        const effects::Effect* effect = closure_.steps[k].effect;
        if (changes_reading(*effect)) continue;
        const bool shape = estimated_from_other_columns(*effect);
        if (shape) {
            const auto screened = screen_side_channels(problem_.turns(), *now_->fit, now_->joined(), true);
            const auto same =
                std::find_if(screened.begin(), screened.end(), [&](const Candidate& c) { return c.effect == effect; });
            if (same == screened.end() || passes(same->p_value)) continue;
        }
        TurnParameters without = now_->parameters();
        std::erase_if(without.effects, [&](const ActiveEffect& active) { return active.effect == effect; });
        now_->fit->release();
        auto fitted = problem_.fit_or_none(without);
        if (!fitted) continue;
        if (!shape && passes(p_of_gain(gain_over(*now_, *fitted), *effect))) continue;
        go_on_with(std::move(fitted));
        closure_.steps.erase(closure_.steps.begin() + static_cast<std::ptrdiff_t>(k));
    }
}

void TurnLoop::test_residual() {
    Verification verification = verify(*now_->fit);
    closure_.tests = std::move(verification.tests);
    closure_.unexplained = std::move(verification.unexplained);
}

/// The residual fails although a random rate was added: the library has no effect for this rate, and the random rate
/// was only the most similar one. The residual without it shows the location of the structure.
void TurnLoop::take_back_random() {
    const bool on_random = earlier_ && std::any_of(closure_.steps.begin(), closure_.steps.end(), [&](const Step& step) {
                               return step.effect == earlier_->effect || is_random_rate(*step.effect);
                           });
    if (!on_random || !closure_.unexplained || closure_.unexplained->where == Where::phase) return;
    const ResidualTest with_random = *closure_.unexplained;
    go_on_with(earlier_->now);
    closure_.steps = std::move(earlier_->steps);
    test_residual();
    const auto same = std::find_if(closure_.tests.begin(), closure_.tests.end(),
                                   [&](const ResidualTest& test) { return test.subject == with_random.subject; });
    closure_.unexplained = same == closure_.tests.end() ? with_random : *same;
}

void TurnLoop::verify_model() {
    monitor_.tell("testing the residual");
    if (is_rounding(heldout(*now_->fit).error_rad)) {
        closure_.notes.push_back(
            fmt::format("the residual is below {:g} rad, the size of rounding errors, and is not tested",
                        options.turns.loop.rounding_rad));
    } else {
        test_residual();
    }
    take_back_random();
}

void TurnLoop::finish() {
    if (is_of_even_density(now_->fit->innovations(), now_->fit->rows())) {
        closure_.notes.push_back(
            "the distribution of the injected noise is flatter than a normal distribution: "
            "the size of the residual over the phase is not tested");
    }
    for (const Step& step : closure_.steps) {
        if (!step.note.empty()) closure_.notes.push_back(step.note);
    }
    for (std::string& note : notes_on_amplitude(*now_)) closure_.notes.push_back(std::move(note));
    if (std::string note = note_on_acceleration(problem_.turns(), *now_->fit); !note.empty()) {
        closure_.notes.push_back(std::move(note));
    }
    closure_.log_likelihood_gain = now_->log_likelihood() - base_log_likelihood_;
    take_residual(problem_.turns(), *now_, closure_);
    now_->fit->release();
    monitor_.tell("fitting the whole record");
    const TurnProblem whole = problem_.whole();
    take_figures(problem_.turns(), *whole.fit(now_->parameters()), closure_);
    if (!closure_.steps.empty()) {
        Closure alone;
        take_figures(problem_.turns(), *whole.fit({}), alone);
        closure_.base_alone = std::move(alone.base);
    }
    closure_.verdict = verdict_of(closure_);
}

Closure TurnLoop::run() {
    closure_.unit = "rad";
    closure_.level = options.level;
    monitor_.tell("fitting the base model");
    fit_base();
    // Effects that only substituted for others are removed, and changes of the dither are no steps, so there may be
    // more rounds than steps.
    const std::size_t most_rounds = options.turns.loop.rounds_per_step * options.most_steps;
    for (std::size_t round = 0; round < most_rounds && closure_.steps.size() < options.most_steps; ++round) {
        if (is_rounding(heldout(*now_->fit).error_rad) || !add_one()) break;
    }
    verify_model();
    finish();
    return std::move(closure_);
}

Closure close_turns(const record::Record& record, const Monitor& monitor) {
    return on_threads_for(record.turns->size(), [&] { return TurnLoop(record, monitor).run(); });
}

Closure fit_turns(const record::Record& record, const std::vector<ActiveEffect>& effects) {
    Closure closure;
    closure.unit = "rad";
    closure.level = options.level;
    const TurnProblem training(record, training_rows(record.turns->size()));
    TurnParameters start;
    start.effects = since_first_turn(effects, record);
    const auto whole = training.whole().fit(start);
    const auto trained = training.fit(whole->parameters());
    closure.log_likelihood_gain = gain_over(*trained, *training.fit({}));
    closure.steps = steps_of(effects);
    take_residual(training.turns(), *trained, closure);
    closure.heldout_before = closure.heldout_after;
    Verification verification = verify(*whole->fit);
    closure.tests = std::move(verification.tests);
    closure.unexplained = std::move(verification.unexplained);
    take_figures(training.turns(), *whole, closure);
    closure.verdict = verdict_of(closure);
    return closure;
}

std::vector<Estimate> information_on_turns(const record::Record& record, const std::vector<ActiveEffect>& effects) {
    const TurnProblem problem(record, Rows(record.turns->size(), 1));
    TurnParameters start;
    start.effects = since_first_turn(effects, record);
    const auto fitted = problem.fit(start, TurnFit::Effects::held);
    Closure closure;
    closure.steps = steps_of(effects);
    take_figures(problem.turns(), *fitted, closure);
    std::vector<Estimate> estimates;
    for (Step& step : closure.steps) {
        for (Estimate& estimate : step.parameters) estimates.push_back(std::move(estimate));
    }
    return estimates;
}

}  // namespace ringlock::closure
