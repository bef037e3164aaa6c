#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

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

/// Frequency of the line that a step added, as it is read. Others may have come behind it: a motion that is told anew.
double line_hz(const SampleModel& model, int step) {
    for (std::size_t k = 0; k < model.resonances.size(); ++k) {
        if (model.resonance_steps[k] == step) return model.noise.resonances[k].hz;
    }
    const auto of_step = [step](const SampleColumn& c) { return c.step == step && c.name == "cosine"; };
    const auto found = std::find_if(model.columns.begin(), model.columns.end(), of_step);
    if (found == model.columns.end()) throw RunError("a line that was added is not in the model");
    return found->course.hz;
}

/// As a motion is told anew by what has come in, or has been drawn, beside it.
constexpr int most_motions = 6;

}  // namespace

/// Values that nothing is held out of: steps are chosen like any other effect.
std::vector<double> SampleLoop::chosen_increments() const {
    std::vector<double> values;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
        if (rows_[i]) values.push_back(series_.increment[i]);
    }
    return values;
}

void SampleLoop::take_lattice(Closure& closure) {
    if (series_.counted) {
        closure.notes.push_back(fmt::format(
            "counts are whole by their kind: steps of {:.6g} arcsec are no missing effect", counted_step()));
        find_coarse_steps(closure);
        if (rounded_.drawn()) closure.heldout_before = score(*now_.fit).error;
        return;
    }
    lattice_ = find_lattice(chosen_increments(), now_.fit->sd(series_.size() / 2));
    if (lattice_.step_arcsec == 0.0) return;
    const double step = lattice_.step_arcsec;
    const double sd = now_.fit->sd(series_.size() / 2);
    // Steps add step^2/12 to the variance: less than a thousandth of it changes nothing that is told here.
    if (step * step / 12.0 < 1e-3 * sd * sd) {
        closure.notes.push_back(fmt::format(
            "values come in steps of {:.6g} arcsec, too fine to matter beside {:.3g} arcsec of noise", step, sd));
        return;
    }
    const bool blurred = lattice_.step_arcsec > 1.5 * lattice_.printed_arcsec;
    if (blurred) {
        closure.notes.push_back(fmt::format(
            "values are written in steps of {:.6g} arcsec; beneath them is a coarser one, of which {:.0f} % "
            "of the characteristic function is left",
            lattice_.printed_arcsec, 100.0 * lattice_.strength));
    }
    Step taken;
    taken.effect = effects::find("count_quantization");
    taken.p_value = lattice_.p_value;
    const SampleScore before = score_of(*now_.fit, reported_, 0.0);
    // Blurred steps are not where the values are: the digits are.
    used_step_ = blurred ? lattice_.printed_arcsec : step;
    find_coarse_steps(closure);
    const SampleScore after = score(*now_.fit);
    taken.heldout_error_before = before.error;
    taken.heldout_error_after = after.error;
    taken.heldout_log_score_gain = after.log_score - before.log_score;
    taken.parameters.push_back({"count_quantization", "step_arcsec", step, lattice_.step_sd_arcsec});
    now_.steps.push_back(std::move(taken));
    now_.told.push_back({"count_quantization", next_step_++});
}

/// Steps whose rounding follows the angle.
void SampleLoop::find_coarse_steps(Closure& closure) {
    const bool blurred = lattice_.step_arcsec > 1.5 * lattice_.printed_arcsec;
    const double step = series_.counted ? counted_step() : blurred ? 0.0 : lattice_.step_arcsec;
    if (!RoundedSamples::show(*now_.fit, step)) return;
    now_.fit = rounded_.begin(*now_.fit, step);
    closure.notes.push_back(
        fmt::format("steps of {:.6g} arcsec are large beside the noise, and their rounding follows the angle: what "
                    "was rounded is drawn by the model, and white_angle_arcsec is the noise before it was rounded",
                    step));
}

/// Adds what earns its place, until nothing does.
void SampleLoop::add_all(Closure& closure, bool random_rates) {
    while (now_.steps.size() < options.most_steps) {
        check_interrupt();
        monitor_.tell("searching the library");
        const SampleChoice choice = choose_on_samples(
            record_.declared, {now_.fit, now_.lines_hz, next_step_, random_rates}, whole_, lattice_step());
        nearest_ = choice.nearest;
        if (!choice.chosen) break;
        if (!earlier_ && is_random_rate(choice.chosen->candidate.effect)) earlier_ = now_;
        take(choice, closure);
    }
}

/// What was rounded was drawn by the model without a random rate, and says little of which one it is: the rounded
/// values say that. The likelier is taken, with the fit to what was drawn by it.
const SampleContender& SampleLoop::take_likelier(const SampleChoice& choice, Step& step) {
    now_.fit = choice.chosen->fit;
    if (!rounded_.drawn() || !choice.other_random) return *choice.chosen;
    const auto drawn = rounded_.draw(choice.chosen->fit, draws_of_step);
    const double without = score(*drawn).log_likelihood;
    now_.fit = rounded_.draw(choice.other_random->fit, draws_of_step);
    const double gain = score(*now_.fit).log_likelihood - without;
    const bool other = gain > 0.0;
    if (!other) now_.fit = rounded_.draw(drawn, 1);
    const SampleContender& taken = other ? *choice.other_random : *choice.chosen;
    const SampleContender& left = other ? *choice.chosen : *choice.other_random;
    auto& tied = step.confounded_with;
    std::erase_if(tied, [&](const effects::Effect* other) {
        return other->name() == left.candidate.effect || other->name() == taken.candidate.effect;
    });
    if (std::abs(gain) < options.tie) tied.push_back(effects::find(left.candidate.effect));
    if (other) step.p_value = taken.candidate.p_value;
    return taken;
}

/// Adds an effect to the model.
void SampleLoop::take(const SampleChoice& choice, Closure& closure) {
    Step step;
    step.p_value = choice.p_value;
    for (const std::string& name : choice.confounded_with) step.confounded_with.push_back(effects::find(name));
    const SampleScore before = score(*now_.fit);
    const SampleContender& best = take_likelier(choice, step);
    const std::string effect = best.candidate.effect;
    step.effect = effects::find(effect);
    for (const auto& [partner, names] : now_.of_partners) {
        if (partner != effect) continue;
        for (const std::string& name : names) {
            const auto& named = step.confounded_with;
            const effects::Effect* other = effects::find(name);
            if (std::find(named.begin(), named.end(), other) == named.end()) step.confounded_with.push_back(other);
        }
    }
    now_.of_partners.insert(now_.of_partners.end(), choice.of_partners.begin(), choice.of_partners.end());
    if (!step.confounded_with.empty()) step.experiment = experiment_for(*step.effect, step.confounded_with);
    drop_needless(effect);
    for (int k = 0; k < most_motions && move_anew();) ++k;
    now_.fit = std::make_shared<SampleFit>(place_in_gaps(*now_.fit, rows_, whole_));
    now_.told.push_back({.effect = effect,
                         .step = next_step_++,
                         .witness = best.candidate.witness,
                         .strong = best.candidate.strong,
                         .other_hz = choice.other_hz});
    if (rounded_.drawn()) {
        now_.fit = rounded_.draw(now_.fit, draws_of_step);
        // What was drawn without a motion tells little of it.
        for (int k = 0; k < most_motions && move_anew(); ++k) now_.fit = rounded_.draw(now_.fit, 1);
    } else if (series_.counted || used_step_ > 0.0) {
        // What has been taken off may have been what the rounding was small beside.
        find_coarse_steps(closure);
    }
    const SampleScore after = score(*now_.fit);
    step.heldout_error_before = before.error;
    step.heldout_error_after = after.error;
    step.heldout_log_score_gain = after.log_score - before.log_score;
    if (is_line(effect)) {
        const double hz = line_hz(now_.fit->model(), now_.told.back().step);
        now_.lines_hz.push_back(alias(hz, series_.rate_hz).hz);
        now_.told.back().hz = now_.lines_hz.back();
        if (best.candidate.wanders) {
            now_.notes.push_back(
                fmt::format("the line at {:.6g} Hz does not keep its phase over the record; it is foretold from the "
                            "samples before as a narrow resonance",
                            now_.lines_hz.back()));
        }
    }
    monitor_.tell(fmt::format("added {}", step.effect->name()));
    now_.steps.push_back(std::move(step));
}

/// The model without what that step added, if it may only have stood in for the effect that was added last.
std::optional<SampleLoop::Stripped> SampleLoop::stripped(const SampleStep& told, const std::string& added) const {
    Stripped without{now_.fit->model()};
    SampleModel& model = without.model;
    if (told.effect == "rate_random_walk") {
        model.walk = false;
        model.noise.walk_arcsec2_s3 = 0.0;
    } else if (told.effect == "bias_instability") {
        model.flicker = false;
        model.noise.terms.clear();
    } else if (told.effect.starts_with("bias_") || told.effect == "scale_factor_error") {
        std::erase_if(model.columns, [&](const SampleColumn& c) { return c.effect == told.effect; });
        if (told.effect == "bias_step") without.parameters = 2;
    } else if (is_line(told.effect) && added == "resampling") {
        // Of a line that was resampled there are images, each a line to who does not know that.
        const auto of_step = [&](const SampleColumn& c) { return c.step == told.step; };
        const auto cosine = std::find_if(model.columns.begin(), model.columns.end(), of_step);
        if (cosine == model.columns.end()) return std::nullopt;
        without.parameters = 2 + static_cast<int>(cosine->course.free);
        std::erase_if(model.columns, of_step);
    } else {
        return std::nullopt;
    }
    return without;
}

/// Effects that stood in for the one added last are no longer needed beside it.
void SampleLoop::drop_needless(const std::string& added) {
    for (std::size_t k = now_.told.size(); k-- > 0;) {
        auto without = stripped(now_.told[k], added);
        if (!without) continue;
        auto fitted = std::make_shared<SampleFit>(series_, std::move(without->model), rows_, SampleFit::Noise::near);
        const double chi2 = 2.0 * (now_.fit->gain_over(*fitted));
        if (passes_on_samples(chi2_tail(chi2, without->parameters))) continue;
        now_.fit = std::move(fitted);
        if (is_line(now_.told[k].effect)) {
            std::erase(now_.lines_hz, now_.told[k].hz);
            now_.notes.push_back(
                fmt::format("a line at {:.6g} Hz was in the model until {} came in, beside which it is nothing",
                            now_.told[k].hz, added));
        }
        now_.steps.erase(now_.steps.begin() + static_cast<std::ptrdiff_t>(k));
        now_.told.erase(now_.told.begin() + static_cast<std::ptrdiff_t>(k));
    }
}

/// What a witness told of a motion, and what it left, was told beside the noise as it was, which what has been added
/// was a part of.
bool SampleLoop::move_anew() {
    bool any = false;
    for (SampleStep& told : now_.told) {
        if (told.effect != "case_motion") continue;
        const SampleFit still(series_, without_motion(now_.fit->model()), rows_, SampleFit::Noise::held);
        auto moved = std::make_shared<SampleFit>(series_, moved_as(still, told.witness, told.step), rows_,
                                                 SampleFit::Noise::near);
        const double more = told.strong ? 1.0 : 2.0 * witness_lags(series_.rate_hz) - 1.0;
        if (!(moved->gain_over(*now_.fit) > more)) continue;
        now_.fit = std::move(moved);
        told.strong = true;
        any = true;
    }
    return any;
}

/// A motion of the case that is known to be there, by two numbers or lag by lag.
void SampleLoop::move_case(SampleStep& told, SampleFit::Noise noise) {
    SampleModel model = now_.fit->model();
    add_motion(model, series_, told.witness, told.step);
    auto weak = std::make_shared<SampleFit>(series_, std::move(model), rows_, noise);
    auto strong = std::make_shared<SampleFit>(series_, moved_as(*now_.fit, told.witness, told.step), rows_,
                                              SampleFit::Noise::near);
    const double more = 2.0 * witness_lags(series_.rate_hz) - 1.0;
    told.strong = strong->gain_over(*weak) > more;
    now_.fit = told.strong ? std::move(strong) : std::move(weak);
}

}  // namespace ringlock::closure
