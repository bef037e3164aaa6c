#include "analysis/closure/turns/loop/loop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/decide/rows.hpp"
#include "analysis/closure/decide/verdict.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/normality.hpp"
#include "analysis/closure/turns/loop/contest.hpp"
#include "analysis/closure/turns/residual/views.hpp"
#include "analysis/closure/turns/screen/dither_amplitude.hpp"
#include "analysis/closure/turns/screen/dither_shape.hpp"
#include "analysis/closure/turns/screen/side_channels.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// What is left below is of sums of so many rounded numbers, here and where the record was made.
constexpr double numerics_rad = 1e-6;

struct Score {
    double error = 0.0;
    double log_score = 0.0;
    double floor = 0.0;
};

/// One-step predictions of the turns that do not count.
Score heldout(const TurnFit& fit) {
    Score score;
    double count = 0.0;
    for (std::size_t i = 0; i < fit.innovations().size(); ++i) {
        if (fit.rows()[i]) continue;
        const double e = fit.innovations()[i];
        const double sd = fit.sd_rad()[i];
        score.error += e * e * sd * sd;
        score.floor += sd * sd;
        score.log_score -= 0.5 * e * e + std::log(sd);
        count += 1.0;
    }
    score.error = std::sqrt(score.error / count);
    score.floor = std::sqrt(score.floor / count);
    return score;
}

/// Frequency of the dither by its own turns: the slope of their times, its error from the scatter of means over
/// stretches and its correlation (Newey and West, Econometrica 55, 1987, 703), as an input that moves leaves some.
Estimate dither_frequency(const TurnFit& fit) {
    constexpr std::size_t stretches = 40;
    const auto& turn_s = fit.prediction().turn_s;
    const double interval_s = fit.model().series().interval_s;
    std::vector<double> at;
    std::vector<double> late_s;
    for (std::size_t s = 0; s < stretches; ++s) {
        // Whole cycles: minima and maxima may be late by different times.
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
    constexpr std::size_t memory = 10;
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
    const gyro::Setup& setup = fitted.series.setup;
    const auto n = static_cast<double>(fitted.series.size());
    base.push_back(dither_frequency(*fitted.fit));
    base.push_back(
        {"", "dither_peak_rate_deg_s", setup.dither_peak_rate_deg_s,
         setup.dither_peak_rate_deg_s * fitted.fit->sd_rad().front() / (fitted.series.amplitude_rad * std::sqrt(n))});
}

bool follows_column(const TurnView& view) {
    return view.test.where == Where::temperature || view.test.where == Where::rate ||
           view.test.where == Where::amplitude;
}

/// Whether a line is where what follows the phase makes one in a gyro whose phases come in step: at a harmonic of their
/// beat, give or take the dither's frequency, to within what the record can tell.
bool is_on_beat(const TurnFit& fit, double hz) {
    if (!(fit.parameters().injected_sd_rad < 1.0)) return false;
    const TurnSeries& series = fit.model().series();
    const double beat_hz = fit.model().beat_hz();
    const double dither_hz = 0.5 / series.interval_s;
    for (int k = -harmonics_of_phase; k <= harmonics_of_phase; ++k) {
        const double apart_hz = std::abs(std::remainder(hz - k * beat_hz, dither_hz));
        if (k != 0 && apart_hz * series.time_s.back() < 1.0) return true;
    }
    return false;
}

std::optional<double> frequency_hz_of(const TurnFit& fit, const effects::Effect& effect) {
    const effects::Parameter* frequency = effects::first_of(effect, effects::Role::frequency);
    if (frequency == nullptr) return std::nullopt;
    return fit.parameters().find(effect.name())->values.at(std::string(frequency->name));
}

bool is_line_on_beat(const TurnFit& fit, const Contender& contender) {
    const auto hz = frequency_hz_of(*contender.fitted->fit, *contender.candidate.effect);
    return hz && is_on_beat(fit, *hz);
}

/// What a view of the phase counts beside a line on the beat.
constexpr double beside_beat = 2.0;

/// Whether some view of the residual explains more than the best effect, the noise fitted anew beside either: then
/// that one is only what comes nearest to something that the library does not have.
///
/// A gyro whose phases come in step makes lines of whatever follows them: a rate must explain more than they do, who
/// are kicks of first order only; where it is at a harmonic of the phases' beat, these count twice.
/// Injected noise of a radian leaves nothing of that.
///
/// Gives the most that such a view explains.
std::optional<double> something_else(const TurnFit& fit, const Choice& choice) {
    constexpr std::size_t looked_at = 4;
    constexpr double first_order = 0.02;
    constexpr double noise_of_column = 0.1;
    auto views = view_residual(fit);
    std::erase_if(views, [](const TurnView& view) { return !view.columns || view.test.merit < options.tie; });
    std::sort(views.begin(), views.end(),
              [](const TurnView& a, const TurnView& b) { return a.test.merit > b.test.merit; });
    if (views.size() > looked_at) views.resize(looked_at);
    const bool on_beat = is_line_on_beat(fit, *choice.chosen);
    double rival = 0.0;
    for (const Held& held : choice.held) rival = std::max(rival, held.merit);
    std::optional<double> most;
    for (const TurnView& view : views) {
        const double counts = on_beat && view.test.where == Where::phase ? beside_beat : 1.0;
        const double merit = counts * refitted_merit(fit, view, rival);
        const bool beats_all = std::all_of(choice.held.begin(), choice.held.end(), [&](const Held& held) {
            const bool in_step =
                view.test.where == Where::phase && held.effect->adds_angle() && fit.parameters().injected_sd_rad < 1.0;
            if (in_step) return merit > std::min(held.merit - options.tie, (1.0 - first_order) * held.merit);
            if (!is_random_rate(*held.effect)) return merit > held.merit + options.tie;
            // A random rate can follow what jumps nearly as well as the jumps themselves, and what follows another
            // column better than a column with noise of its own.
            const double least = std::min(held.merit - options.tie, (1.0 - noise_of_column) * held.merit);
            return merit > (follows_column(view) ? least
                            : view.jumps         ? held.merit - options.tie
                                                 : held.merit + options.tie);
        });
        if (beats_all) most = std::max(merit, most.value_or(merit));
    }
    return most;
}

/// Two effects, one of the coupling, may look like something else where either is looked at alone: whether one beside
/// the chosen one makes up for what a view explains. Rates by twos could follow nearly anything.
bool two_explain(const record::Record& record, const Rows& rows, const Choice& choice, double merit_of_view) {
    constexpr std::size_t looked_at = 3;
    const Contest beside = hold_contest(record, *choice.chosen->fitted, rows, looked_at, Among::not_random);
    if (beside.side || beside.contenders.empty() || !passes(beside.contenders.front().p_value)) return false;
    if (!is_of_coupling(*choice.chosen->candidate.effect) &&
        !is_of_coupling(*beside.contenders.front().candidate.effect)) {
        return false;
    }
    return choice.chosen->merit + beside.contenders.front().merit - cost_of_choice() > merit_of_view;
}

/// Tests of what the model has left; where structure lies, if any passes the level.
///
/// Of the views that fail, the regression that explains most, the noise fitted anew beside it; where none does, the
/// test that is least probable by chance. Lines on the beat of phases that come in step count half.
void test_what_is_left(const TurnFit& fit, Closure& closure) {
    constexpr std::size_t looked_at = 4;
    auto views = view_residual(fit);
    closure.tests.clear();
    for (const TurnView& view : views) closure.tests.push_back(view.test);
    const double threshold = options.level_of_residual / static_cast<double>(views.size());
    closure.unexplained.reset();
    const auto fails = [&](const TurnView& view) { return view.test.p_value < threshold; };
    if (std::none_of(views.begin(), views.end(), fails)) return;
    std::erase_if(views, [&](const TurnView& view) { return !fails(view); });
    std::sort(views.begin(), views.end(), [](const TurnView& a, const TurnView& b) {
        return a.test.merit > b.test.merit || (a.test.merit == b.test.merit && a.test.p_value < b.test.p_value);
    });
    closure.unexplained = views.front().test;
    if (!views.front().columns) return;
    double most = 0.0;
    for (std::size_t k = 0; k < std::min(looked_at, views.size()) && views[k].columns; ++k) {
        const bool on_beat = views[k].hz && is_on_beat(fit, *views[k].hz);
        const double merit =
            refitted_merit(fit, views[k], std::numeric_limits<double>::infinity()) / (on_beat ? beside_beat : 1.0);
        if (merit <= most) continue;
        most = merit;
        closure.unexplained = views[k].test;
    }
}

/// What times and accelerations say of the dither's shape depends on the rates in the model and on each other.
void read_shape_again(const record::Record& record, const Rows& rows, std::shared_ptr<Fitted>& now) {
    constexpr int most = 3;
    for (int pass = 0; pass < most; ++pass) {
        const auto told = shape_read_again(*record.turns, *now->fit);
        if (!told) return;
        auto fitted = fit_or_none(record, *told, rows);
        if (!fitted) return;
        now = std::move(fitted);
    }
}

bool is_shape(const effects::Effect& effect) {
    return effect.name() == "dither_asymmetry" || effect.name() == "dither_second_harmonic";
}

/// Effects that stood in for the one added last are no longer needed beside it.
void drop_needless(const record::Record& record, const Rows& rows, std::shared_ptr<Fitted>& now,
                   std::vector<Step>& steps) {
    for (std::size_t k = steps.size(); k-- > 0;) {
        const effects::Effect* effect = effects::find(steps[k].effect);
        const bool shape = is_shape(*effect);
        if (!shape && told_by_other_columns(*effect)) continue;
        if (shape) {
            const auto told = screen_side_channels(*record.turns, *now->fit, now->joined, true);
            const auto same =
                std::find_if(told.begin(), told.end(), [&](const Candidate& c) { return c.effect == effect; });
            if (same == told.end() || passes(same->p_value)) continue;
        }
        TurnParameters without = now->fit->parameters();
        std::erase_if(without.effects, [&](const ActiveEffect& active) { return active.effect == effect; });
        const auto fitted = fit_or_none(record, without, rows);
        if (!fitted) continue;
        const double gain = now->fit->log_likelihood() - fitted->fit->log_likelihood();
        if (!shape && passes(p_of_gain(gain, *effect))) continue;
        now = fitted;
        steps.erase(steps.begin() + static_cast<std::ptrdiff_t>(k));
    }
}

/// Of a line that may as well be another one, which the lock-in's kicks turn into it; else nothing.
std::string note_on_frequency(const TurnFit& without, const TurnFit& with, const effects::Effect& effect) {
    const auto hz = frequency_hz_of(with, effect);
    if (!hz) return {};
    std::string others;
    for (const double other : frequencies_as_likely(without, effect, *hz, 2.0 * options.tie)) {
        others += (others.empty() ? "" : " or ") + fmt::format("{:.4g}", other);
    }
    if (others.empty()) return {};
    return fmt::format(
        "{} of {:.4g} Hz: one of {} Hz would explain nearly as much, since the lock-in's kicks let either be seen "
        "at the other by the beat of the input rate; a record at another input rate would tell",
        effect.name(), *hz, others);
}

/// The figures of the final model: fitted to the whole record.
void take_figures(const record::Turns& turns, const Fitted& whole, Closure& closure) {
    for (const Estimate& estimate : whole.fit->estimates()) {
        if (estimate.effect.empty()) {
            closure.base.push_back(estimate);
            continue;
        }
        for (Step& step : closure.steps) {
            if (step.effect == estimate.effect) step.parameters.push_back(estimate);
        }
    }
    for (const Candidate& candidate : screen_side_channels(turns, *whole.fit, whole.joined, true)) {
        for (Step& step : closure.steps) {
            if (step.effect != candidate.effect->name()) continue;
            for (const effects::Parameter& parameter : candidate.effect->parameters()) {
                const std::string name(parameter.name);
                const auto sd = candidate.sd.find(name);
                step.parameters.push_back(
                    {step.effect, name, candidate.values.at(name),
                     sd == candidate.sd.end() ? std::numeric_limits<double>::quiet_NaN() : sd->second});
            }
        }
    }
    add_dither(closure.base, whole);
}

/// What is left by a model fitted to all blocks but the reported ones.
void take_residual(const record::Turns& turns, const Fitted& fitted, Closure& closure) {
    const Score last = heldout(*fitted.fit);
    closure.heldout_after = last.error;
    closure.noise_floor = last.floor;
    closure.residual.time_s = turns.time_s;
    for (std::size_t i = 0; i < turns.size(); ++i) {
        const double sd = fitted.fit->sd_rad()[i];
        closure.residual.innovation.push_back(fitted.fit->innovations()[i] * sd);
        closure.residual.sd.push_back(sd);
        closure.residual.reported.push_back(fitted.fit->rows()[i] ? 0 : 1);
        closure.mean_input_rate_deg_h += fitted.series.input_rate_deg_h[i] / static_cast<double>(turns.size());
    }
}

/// The first fit. Where the declared device, or the standard one, cannot have made such turns, nothing else will do.
std::shared_ptr<Fitted> fit_base(const record::Record& record, const Rows& rows) {
    try {
        return fit_record(record, {}, rows);
    } catch (const RunError&) {
        throw InputError(
            "/turns: half cycles of so few fringes beside so strong a lock-in cannot be followed, since the phase "
            "never "
            "runs fast in them; record with more dither, or declare lock-in threshold and scale factor where they are "
            "wrong or missing");
    }
}

}  // namespace

Closure close_turns(const record::Record& record) {
    Closure closure;
    closure.unit = "rad";
    closure.level = options.level;
    const record::Turns& turns = *record.turns;
    const Rows rows = training_rows(turns.size());
    auto now = fit_base(record, rows);
    if (!now->series.scale_factor_declared) {
        closure.notes.push_back(
            fmt::format("the record declares no scale factor; {:g} arcsec per fringe assumed, with "
                        "which all rates scale",
                        now->series.setup.scale_factor_arcsec));
    }
    if (!now->series.all_phases_come) {
        closure.notes.push_back(
            "turns come at a part of the fringe only, as in a locked gyro: bias and threshold are told together, and "
            "the dither's shape is not looked for");
    }
    closure.heldout_before = heldout(*now->fit).error;
    const double base_log_likelihood = now->fit->log_likelihood();
    // Before the first effect that was taken on the strength of a random rate.
    struct Earlier {
        std::shared_ptr<Fitted> now;
        std::vector<Step> steps;
        std::string effect;
    };
    std::optional<Earlier> earlier;
    std::vector<std::string> partners;  // of the effects that were added last, still to come

    // What stood in for another is dropped again, and what is the dither's own is no step: more rounds than steps.
    for (std::size_t round = 0; round < 3 * options.most_steps && closure.steps.size() < options.most_steps; ++round) {
        if (heldout(*now->fit).error < numerics_rad) break;
        Contest contest = hold_contest(record, *now, rows, options.most_contenders);
        Choice choice = choose(record, contest, rows);
        // A locked gyro's lock-in takes amplitudes up, unless noise is injected.
        const TurnParameters& found = now->fit->parameters();
        const bool shows = now->series.all_phases_come || found.injected_sd_rad > found.readout_sd_rad;
        if (!contest.side && shows) {
            auto amplitude = find_amplitude_swing(record, *now, rows);
            if (!amplitude) amplitude = find_amplitude_memory(record, *now, rows);
            if (amplitude && (choice.chosen == nullptr || amplitude->merit > choice.held.front().merit - options.tie)) {
                now = amplitude->fitted;
                if (closure.steps.empty()) closure.heldout_before = heldout(*now->fit).error;
                continue;
            }
        }
        if (choice.chosen == nullptr) break;
        if (!contest.side) {
            const auto view = something_else(*now->fit, choice);
            if (view && is_line_on_beat(*now->fit, *choice.chosen)) {
                // What follows the phase may be an effect of the coupling by itself, rather than anything else.
                std::erase_if(contest.contenders, [&](const Contender& c) {
                    return is_line_on_beat(*now->fit, c) || is_random_rate(*c.candidate.effect);
                });
                choice = choose(record, contest, rows);
                if (choice.chosen == nullptr || !is_of_coupling(*choice.chosen->candidate.effect)) break;
                if (something_else(*now->fit, choice)) break;
            } else if (view && !two_explain(record, rows, choice, *view)) {
                break;
            }
        }
        const Contender& best = *choice.chosen;
        Step step;
        step.effect = std::string(best.candidate.effect->name());
        step.p_value = choice.p_value;
        step.confounded_with = choice.confounded_with;
        const auto expected = std::find(partners.begin(), partners.end(), step.effect);
        if (expected != partners.end()) {
            partners.erase(expected);
            // What explains as much as all of them did without this one.
            for (const std::string& name : closure.steps.back().confounded_with) {
                auto& named = step.confounded_with;
                if (name != step.effect && std::find(named.begin(), named.end(), name) == named.end()) {
                    named.push_back(name);
                }
            }
        } else {
            partners.clear();
        }
        for (const std::string& name : choice.partners) {
            if (std::find(partners.begin(), partners.end(), name) == partners.end()) partners.push_back(name);
        }
        if (!step.confounded_with.empty()) step.experiment = experiment_for(step.effect, step.confounded_with);
        if (!earlier && choice.on_random) earlier = {now, closure.steps, step.effect};
        const Score before = heldout(*now->fit);
        step.note = note_on_frequency(*now->fit, *best.fitted->fit, *best.candidate.effect);
        now = best.fitted;
        read_shape_again(record, rows, now);
        drop_needless(record, rows, now, closure.steps);
        const Score after = heldout(*now->fit);
        step.heldout_error_before = before.error;
        step.heldout_error_after = after.error;
        step.heldout_log_score_gain = after.log_score - before.log_score;
        closure.steps.push_back(std::move(step));
    }

    if (heldout(*now->fit).error < numerics_rad) {
        closure.notes.push_back(fmt::format(
            "what the model leaves is below {:g} rad, where numbers are rounded: it is not tested", numerics_rad));
    } else {
        test_what_is_left(*now->fit, closure);
    }
    const bool on_random = earlier && std::any_of(closure.steps.begin(), closure.steps.end(), [&](const Step& step) {
                               return step.effect == earlier->effect || is_random_rate(*effects::find(step.effect));
                           });
    if (on_random && closure.unexplained && closure.unexplained->where != Where::phase) {
        // A rate is left that is none of the library's: the random one has only come nearest to it. What it cannot
        // follow tells where.
        const ResidualTest told = *closure.unexplained;
        now = earlier->now;
        closure.steps = std::move(earlier->steps);
        test_what_is_left(*now->fit, closure);
        const auto same = std::find_if(closure.tests.begin(), closure.tests.end(),
                                       [&](const ResidualTest& test) { return test.view == told.view; });
        closure.unexplained = same == closure.tests.end() ? told : *same;
    }
    if (is_of_even_density(now->fit->innovations(), now->fit->rows())) {
        closure.notes.push_back(
            "the injected noise is flatter than a normal one: the size of the residual over the phase is not tested");
    }
    for (const Step& step : closure.steps) {
        if (!step.note.empty()) closure.notes.push_back(step.note);
    }
    for (std::string& note : notes_on_amplitude(*now)) closure.notes.push_back(std::move(note));
    if (std::string note = note_on_acceleration(turns, *now->fit); !note.empty()) {
        closure.notes.push_back(std::move(note));
    }
    closure.log_likelihood_gain = now->fit->log_likelihood() - base_log_likelihood;
    take_residual(turns, *now, closure);
    take_figures(turns, *fit_record(record, now->fit->parameters(), Rows(turns.size(), 1)), closure);
    closure.verdict = verdict_of(closure);
    return closure;
}

/// From the record's clock to one that begins with the first turn, as the fit's does (TurnFit::estimates: back again).
std::vector<ActiveEffect> since_first_turn(std::vector<ActiveEffect> effects, const record::Record& record) {
    const double start_s = record.turns->time_s.front();
    for (ActiveEffect& active : effects) {
        if (!active.effect->adds_angle()) continue;
        const auto of = [&](effects::Role role) -> double* {
            const effects::Parameter* found = effects::first_of(*active.effect, role);
            return found == nullptr ? nullptr : &active.values.at(std::string(found->name));
        };
        if (double* time = of(effects::Role::time)) *time = std::max(0.0, *time - start_s);
        double* phase = of(effects::Role::phase);
        const double* frequency = of(effects::Role::frequency);
        if (phase == nullptr || frequency == nullptr) continue;
        *phase = std::remainder(*phase + units::two_pi * *frequency * start_s, units::two_pi);
    }
    return effects;
}

Closure fit_turns(const record::Record& record, const std::vector<ActiveEffect>& effects) {
    Closure closure;
    closure.unit = "rad";
    closure.level = options.level;
    const record::Turns& turns = *record.turns;
    TurnParameters start;
    start.effects = since_first_turn(effects, record);
    const auto whole = fit_record(record, start, Rows(turns.size(), 1));
    const Rows rows = training_rows(turns.size());
    const auto train = fit_record(record, whole->fit->parameters(), rows);
    closure.log_likelihood_gain = train->fit->log_likelihood() - fit_record(record, {}, rows)->fit->log_likelihood();
    for (const ActiveEffect& active : effects) closure.steps.emplace_back().effect = std::string(active.effect->name());
    take_residual(turns, *train, closure);
    closure.heldout_before = closure.heldout_after;
    test_what_is_left(*whole->fit, closure);
    take_figures(turns, *whole, closure);
    closure.verdict = verdict_of(closure);
    return closure;
}

std::vector<Estimate> information_on_turns(const record::Record& record, const std::vector<ActiveEffect>& effects) {
    TurnParameters start;
    start.effects = since_first_turn(effects, record);
    const auto fitted = fit_record(record, start, Rows(record.turns->size(), 1), TurnFit::Effects::held);
    Closure closure;
    for (const ActiveEffect& active : effects) closure.steps.emplace_back().effect = std::string(active.effect->name());
    take_figures(*record.turns, *fitted, closure);
    std::vector<Estimate> estimates;
    for (Step& step : closure.steps) {
        for (Estimate& estimate : step.parameters) estimates.push_back(std::move(estimate));
    }
    return estimates;
}

}  // namespace ringlock::closure
