#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/decide/verdict.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/fit/motion.hpp"
#include "analysis/closure/samples/fit/repeats_and_witness.hpp"
#include "analysis/closure/samples/fit/steps.hpp"
#include "analysis/closure/samples/loop/loop.hpp"
#include "analysis/closure/samples/screen/screen.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"

namespace ringlock::closure {

namespace {

/// Frequency, as the record shows it, of the line that was added in that step. It need not be the last component of the
/// model, since a motion that is fitted again moves to the end.
double line_hz(const SampleModel& model, int step) {
    for (std::size_t k = 0; k < model.resonances.size(); ++k) {
        if (model.resonances[k].step == step) return model.noise.resonances[k].hz;
    }
    const auto of_step = [step](const SampleColumn& c) { return c.step == step && c.name == "cosine"; };
    const auto found = std::find_if(model.columns.begin(), model.columns.end(), of_step);
    if (found == model.columns.end()) throw RunError("a line that was added is not in the model");
    return found->track.hz;
}

}  // namespace

/// Increments of the training rows, which select the step of a quantisation like any other effect.
std::vector<double> SampleLoop::chosen_increments() const {
    std::vector<double> values;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
        if (rows_[i]) values.push_back(series_.increment[i]);
    }
    return values;
}

void SampleLoop::take_lattice(Closure& closure) {
    if (series_.counted) {
        closure.notes.push_back(
            fmt::format("the data are integer counts: their steps of {:.6g} arcsec are expected "
                        "and are not a missing effect",
                        counted_step()));
        find_coarse_steps(closure);
        if (rounded_.drawn()) closure.heldout_before = score(*now_.fit).error;
        return;
    }
    lattice_ = find_lattice(chosen_increments(), now_.fit->typical_sd());
    const effects::Effect* effect = first_that_shows(OnSamples::resolution);
    if (lattice_.step_arcsec == 0.0 || effect == nullptr) return;
    const double step = lattice_.step_arcsec;
    const double sd = now_.fit->typical_sd();
    // Quantisation adds step^2/12 to the variance.
    if (step * step / 12.0 < options.samples.loop.negligible_steps * sd * sd) {
        closure.notes.push_back(fmt::format(
            "values come in steps of {:.6g} arcsec, which are negligible against {:.3g} arcsec of noise", step, sd));
        return;
    }
    const bool blurred = lattice_.step_arcsec > options.samples.loop.coarser_than_printed * lattice_.printed_arcsec;
    if (blurred) {
        closure.notes.push_back(
            fmt::format("values are written in steps of {:.6g} arcsec; under them is a coarser step, "
                        "of whose characteristic function {:.0f} % remains",
                        lattice_.printed_arcsec, 100.0 * lattice_.strength));
    }
    AddedEffect added(*effect, next_id_++);
    Step& taken = added.step;
    taken.p_value = lattice_.p_value;
    const SampleScore before = score_of(*now_.fit, reported_, 0.0);
    // Values are not multiples of the blurred step, but of that of the printed digits.
    used_step_ = blurred ? lattice_.printed_arcsec : step;
    find_coarse_steps(closure);
    const SampleScore after = score(*now_.fit);
    taken.heldout_error_before = before.error;
    taken.heldout_error_after = after.error;
    taken.heldout_log_score_gain = after.log_score - before.log_score;
    taken.parameters.push_back(step_of_lattice(*effect));
    now_.added.push_back(std::move(added));
}

/// Replaces increments in coarse steps, whose rounding follows the angle, by increments that are imputed within the
/// steps.
void SampleLoop::find_coarse_steps(Closure& closure) {
    const bool blurred = lattice_.step_arcsec > options.samples.loop.coarser_than_printed * lattice_.printed_arcsec;
    const double step = series_.counted ? counted_step() : blurred ? 0.0 : lattice_.step_arcsec;
    const SampleNoise& noise = now_.fit->model().noise;
    if (noise.dither || noise.count_error.harmonics > 0 || !RoundedSamples::show(*now_.fit, step)) return;
    now_.fit = rounded_.begin(*now_.fit, step);
    closure.notes.push_back(
        fmt::format("steps of {:.6g} arcsec are large compared with the noise, and their rounding follows the angle: "
                    "the model draws the values before rounding, and white_angle_arcsec is the noise before rounding",
                    step));
}

/// Adds effects until none improves the model by enough.
void SampleLoop::add_all(Closure& closure, bool random_rates) {
    while (now_.added.size() < options.most_steps) {
        check_interrupt();
        monitor_.tell("searching the library");
        const SampleChoice choice = choose_on_samples(
            record_.declared, {now_.fit, now_.lines_hz, next_id_, random_rates, source_ ? &*source_ : nullptr}, whole_,
            lattice_step());
        nearest_ = choice.nearest;
        if (!choice.chosen) break;
        if (!earlier_ && is_random_rate(*choice.chosen->effect)) earlier_ = now_;
        take(choice, closure);
        find_turns_again(closure);
    }
}

/// Takes the more likely of two random rates. Increments that were imputed by a model without a random rate carry
/// little information on its kind; the likelihood of the rounded increments decides.
const SampleCandidate& SampleLoop::take_likelier(const SampleChoice& choice, Step& step) {
    now_.fit = choice.chosen->fit;
    if (!rounded_.drawn() || !choice.other_random) return *choice.chosen;
    const auto drawn = rounded_.draw(choice.chosen->fit, options.samples.loop.draws);
    const double without = score(*drawn).log_likelihood;
    now_.fit = rounded_.draw(choice.other_random->fit, options.samples.loop.draws);
    const double gain = score(*now_.fit).log_likelihood - without;
    const bool other = gain > 0.0;
    if (!other) now_.fit = rounded_.draw(drawn, 1);
    const SampleCandidate& taken = other ? *choice.other_random : *choice.chosen;
    const SampleCandidate& left = other ? *choice.chosen : *choice.other_random;
    auto& tied = step.confounded_with;
    std::erase_if(tied, [&](const effects::Effect* one) { return one == left.effect || one == taken.effect; });
    if (std::abs(gain) < options.tie) tied.push_back(left.effect);
    if (other) step.p_value = taken.p_value;
    return taken;
}

/// Adds an effect to the model.
void SampleLoop::take(const SampleChoice& choice, Closure& closure) {
    Step step;
    step.p_value = choice.p_value;
    step.confounded_with = choice.confounded_with;
    const SampleScore before = score(*now_.fit);
    const SampleCandidate& best = take_likelier(choice, step);
    const effects::Effect& effect = *best.effect;
    step.effect = &effect;
    auto& tied = step.confounded_with;
    for (const auto& [partner, alternatives] : now_.of_partners) {
        if (partner != &effect) continue;
        for (const effects::Effect* one : alternatives) {
            if (std::find(tied.begin(), tied.end(), one) == tied.end()) tied.push_back(one);
        }
    }
    now_.of_partners.insert(now_.of_partners.end(), choice.of_partners.begin(), choice.of_partners.end());
    if (!tied.empty()) step.experiment = experiment_for(effect, tied);
    drop_needless(effect);
    for (int k = 0; k < options.samples.loop.most_motions && move_anew();) ++k;
    now_.fit = std::make_shared<SampleFit>(place_in_gaps(*now_.fit, rows_, whole_));
    AddedEffect& added = now_.added.emplace_back(effect, next_id_++);
    added.step = std::move(step);
    added.witness = best.witness;
    added.strong = best.strong;
    added.other_hz = choice.other_hz;
    if (rounded_.drawn()) {
        now_.fit = rounded_.draw(now_.fit, options.samples.loop.draws);
        // Increments that were imputed without a motion carry little information on it.
        for (int k = 0; k < options.samples.loop.most_motions && move_anew(); ++k)
            now_.fit = rounded_.draw(now_.fit, 1);
    } else if (series_.counted || used_step_ > 0.0) {
        // The rounding may have been small only against the effect that is now in the model.
        find_coarse_steps(closure);
    }
    const SampleScore after = score(*now_.fit);
    added.step.heldout_error_before = before.error;
    added.step.heldout_error_after = after.error;
    added.step.heldout_log_score_gain = after.log_score - before.log_score;
    if (is_line(effect)) {
        const double hz = line_hz(now_.fit->model(), added.id);
        now_.lines_hz.push_back(alias(hz, series_.rate_hz).hz);
        added.hz = now_.lines_hz.back();
        if (best.wanders) {
            now_.notes.push_back(
                fmt::format("the line at {:.6g} Hz does not keep its phase over the record; "
                            "it is modelled as a narrow resonance and predicted from the preceding samples",
                            now_.lines_hz.back()));
        }
    }
    monitor_.tell(fmt::format("added {}", effect.name()));
}

/// The model without that effect, if it may only have substituted for the effect that was added last.
std::optional<SampleLoop::Stripped> SampleLoop::stripped(const AddedEffect& of, const effects::Effect& last) const {
    Stripped without{now_.fit->model()};
    SampleModel& model = without.model;
    const OnSamples as = on_samples(of.effect());
    if (as == OnSamples::walk) {
        model.walk = false;
        model.noise.walk_arcsec2_s3 = 0.0;
    } else if (as == OnSamples::flicker) {
        model.flicker = false;
        model.noise.terms.clear();
    } else if (as == OnSamples::rate || as == OnSamples::step) {
        std::erase_if(model.columns, [&](const SampleColumn& c) { return c.effect == of.step.effect; });
        if (as == OnSamples::step) without.parameters = 2;
    } else if (is_line(of.effect()) && on_samples(last) == OnSamples::transport) {
        // A resampled line has images, each of which looks like a line until the resampling is in the model.
        const auto of_step = [&](const SampleColumn& c) { return c.step == of.id; };
        const auto cosine = std::find_if(model.columns.begin(), model.columns.end(), of_step);
        if (cosine == model.columns.end()) return std::nullopt;
        without.parameters = 2 + static_cast<int>(cosine->track.free);
        std::erase_if(model.columns, of_step);
    } else {
        return std::nullopt;
    }
    return without;
}

/// Removes effects that only substituted for the one that was added last.
void SampleLoop::drop_needless(const effects::Effect& last) {
    for (std::size_t k = now_.added.size(); k-- > 0;) {
        const AddedEffect& one = now_.added[k];
        auto without = stripped(one, last);
        if (!without) continue;
        auto fitted = std::make_shared<SampleFit>(series_, std::move(without->model), rows_, SampleFit::Noise::near);
        const double chi2 = 2.0 * (now_.fit->gain_over(*fitted));
        if (passes_on_samples(chi2_tail(chi2, without->parameters))) continue;
        now_.fit = std::move(fitted);
        if (is_line(one.effect())) {
            std::erase(now_.lines_hz, one.hz);
            now_.notes.push_back(
                fmt::format("a line at {:.6g} Hz was removed from the model: with {} the record does not need it",
                            one.hz, last.name()));
        }
        now_.added.erase(now_.added.begin() + static_cast<std::ptrdiff_t>(k));
    }
}

/// Fits motions of the case again: their response to the witness was estimated with noise that included the effect
/// which has been added since.
/// \return whether any fit improved
bool SampleLoop::move_anew() {
    bool any = false;
    for (AddedEffect& added : now_.added) {
        if (!is_motion(added.step.effect)) continue;
        const SampleFit still(series_, without_motion(now_.fit->model()), rows_, SampleFit::Noise::held);
        auto moved = std::make_shared<SampleFit>(series_, moved_as(still, added.effect(), added.witness, added.id),
                                                 rows_, SampleFit::Noise::near);
        const double more =
            added.strong ? options.samples.fit.motion_refitted : 2.0 * witness_lags(series_.rate_hz) - 1.0;
        if (!(moved->gain_over(*now_.fit) > more)) continue;
        now_.fit = std::move(moved);
        added.strong = true;
        any = true;
    }
    return any;
}

/// Fits a motion of the case that is known to be there: by two numbers, or lag by lag where that explains more.
void SampleLoop::move_case(AddedEffect& motion, SampleFit::Noise noise) {
    SampleModel model = now_.fit->model();
    add_motion(model, series_, motion.effect(), motion.witness, motion.id);
    auto weak = std::make_shared<SampleFit>(series_, std::move(model), rows_, noise);
    auto strong = std::make_shared<SampleFit>(series_, moved_as(*now_.fit, motion.effect(), motion.witness, motion.id),
                                              rows_, SampleFit::Noise::near);
    const double more = 2.0 * witness_lags(series_.rate_hz) - 1.0;
    motion.strong = strong->gain_over(*weak) > more;
    now_.fit = motion.strong ? std::move(strong) : std::move(weak);
}

}  // namespace ringlock::closure
