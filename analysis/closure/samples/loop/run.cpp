#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/decide/verdict.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/declared/count_error.hpp"
#include "analysis/closure/samples/declared/declared_reader.hpp"
#include "analysis/closure/samples/declared/dither_noise.hpp"
#include "analysis/closure/samples/declared/turn_pattern.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/fit/motion.hpp"
#include "analysis/closure/samples/fit/steps.hpp"
#include "analysis/closure/samples/loop/loop.hpp"
#include "analysis/closure/samples/model/gaps.hpp"
#include "analysis/closure/samples/residual/rate_beat.hpp"
#include "analysis/closure/samples/screen/known.hpp"

namespace ringlock::closure {

namespace {

constexpr std::string_view note_on_dither = "the declared reader leaves the noise of the dither in the samples";
constexpr std::string_view note_on_counts = "the declared reader counts whole quarter fringes";
constexpr std::string_view note_on_late = "the declared reader leaves some of the noise of the dither";
constexpr std::string_view note_on_turns = "the white noise of the rate comes in kicks at the turns of the dither";

std::string note_of(const DitherNoise& noise) {
    if (!noise.rows) {
        return fmt::format("{}: sidebands of {:.4g} arcsec rms about {:.7g} Hz, {:.3g} Hz wide", note_on_dither,
                           noise.sidebands.arcsec, noise.sidebands.hz, noise.sidebands.width_hz);
    }
    return fmt::format("{}: {:.0f} % of the variance of the white angle noise, at {:.7g} Hz", note_on_dither,
                       100.0 * noise.share, 0.5 * noise.turn_hz);
}

std::string note_of(const SampleNoise::CountError& error) {
    return fmt::format("{} of {:.6g} arcsec: their error is noise at {:.6g} Hz, {:.3g} Hz wide, and {} harmonics",
                       note_on_counts, error.step_arcsec, error.hz, error.width_hz, error.harmonics - 1);
}

std::string note_of_late(const SampleNoise::Resonance& noise) {
    return fmt::format(
        "{}: {:.3g} arcsec rms of the amplitude's noise, {:.3g} Hz wide, as in zero crossings that are measured late",
        note_on_late, noise.arcsec, noise.width_hz);
}

/// In a short record a motion of the case has a few cycles only. Its part that no witness predicts then looks like a
/// random rate, or like a line: these are tied to the motion.
void tie_to_motion(Step& step, const SampleSeries& series) {
    const double duration_s = series.interval_s * static_cast<double>(series.size());
    if (series.witnesses.empty() || duration_s >= options.samples.loop.motion_determined_s) return;
    const bool slow_line =
        is_line(*step.effect) && value_of(step, effects::Role::frequency) < options.samples.screen.fast_hz;
    if (!slow_line && !is_random_rate(*step.effect)) return;
    const effects::Effect* motion = first_that_shows(OnSamples::motion);
    auto& tied = step.confounded_with;
    if (motion == nullptr || std::find(tied.begin(), tied.end(), motion) != tied.end()) return;
    tied.push_back(motion);
    step.experiment = experiment_for(*step.effect, tied);
}

}  // namespace

/// All rows except those at gaps, and those at the ends of the record for which a witness has no values at all lags. At
/// the start more rows are excluded, since a narrow motion remembers the unpredicted part before the start.
Rows SampleLoop::all_rows() const {
    Rows all(series_.size(), 1);
    if (!series_.missing.empty()) {
        const Rows gaps = rows_about_gaps(series_.missing);
        for (std::size_t i = 0; i < all.size(); ++i) all[i] = gaps[i] ? 0 : 1;
    }
    if (series_.witnesses.empty()) return all;
    const auto lags = static_cast<std::size_t>(witness_lags(series_.rate_hz));
    const std::size_t most = all.size() / options.samples.loop.edge_parts;
    std::fill_n(all.begin(), std::min(options.samples.loop.remembered_lags * lags, most), 0);
    std::fill_n(all.rbegin(), std::min(lags, most), 0);
    return all;
}

/// The base model. The turns of the declared dither are a part of it where the record shows them.
std::shared_ptr<SampleFit> SampleLoop::fit_base(Closure& closure) const {
    if (const auto filtered = filtered_rows(record_)) {
        SampleModel model;
        model.noise.kicks = filtered;
        model.noise.kick_share = 1.0;
        model.noise.turn_hz = series_.rate_hz;
        return std::make_shared<SampleFit>(series_, std::move(model), rows_);
    }
    auto fit = std::make_shared<SampleFit>(series_, SampleModel{}, rows_);
    if (auto with = with_turns(*fit, closure)) return with;
    return fit;
}

/// The same model with the turns of the declared dither and the error of counts at its zero crossings, where the record
/// shows them; else null. A resampled record does not show the turns.
std::shared_ptr<SampleFit> SampleLoop::with_turns(const SampleFit& fit, Closure& closure) const {
    for (const std::string_view own : {note_on_counts, note_on_late, note_on_dither, note_on_turns}) {
        std::erase_if(closure.notes, [own](const std::string& other) { return other.starts_with(own); });
    }
    std::shared_ptr<SampleFit> found = with_count_error(fit, record_);
    if (found) closure.notes.push_back(note_of(found->model().noise.count_error));
    if (auto with = with_late_crossings(found ? *found : fit, record_)) {
        closure.notes.push_back(note_of_late(with->model().noise.sidebands));
        found = std::move(with);
    }
    if (fit.model().noise.from_hz > 0.0) return found;
    if (auto with = with_interpolated_errors(found ? *found : fit, record_)) found = std::move(with);
    if (const auto dither = find_dither_noise(fit, record_)) {
        SampleModel model = fit.model();
        take_dither_noise(*dither, model.noise);
        closure.notes.push_back(note_of(*dither));
        found = std::make_shared<SampleFit>(series_, std::move(model), rows_);
    }
    // Next to the noise of the dither the kicks may be significant, too.
    const SampleFit& best = found ? *found : fit;
    if (const auto pattern = find_turn_pattern(best, record_.declared)) {
        SampleModel model = best.model();
        take_turn_pattern(*pattern, model.noise);
        closure.notes.push_back(fmt::format("{}, {:.7g} a second: {:.4g} in a sample", note_on_turns, pattern->turn_hz,
                                            pattern->turn_hz * series_.interval_s));
        found = std::make_shared<SampleFit>(series_, std::move(model), rows_);
    }
    return found;
}

/// Searches for the turns again after an effect was added: before, its contribution was part of the noise, so that the
/// share of the kicks seemed smaller, or they were not significant. The turns belong to the base model, which gets them
/// as well.
void SampleLoop::find_turns_again(Closure& closure) {
    const SampleNoise& noise = now_.fit->model().noise;
    if (rounded_.drawn() || filtered_rows(record_)) return;
    std::shared_ptr<SampleFit> without = now_.fit;
    if (noise.kicks || noise.dither || noise.sidebands.arcsec > 0.0 || noise.count_error.harmonics > 0 ||
        noise.swing_hz > 0.0) {
        SampleModel model = now_.fit->model();
        drop_turn_pattern(model.noise);
        without = std::make_shared<SampleFit>(series_, std::move(model), rows_, SampleFit::Noise::near);
    }
    std::vector<std::string> notes = closure.notes;
    auto with = with_turns(*without, closure);
    if (!with || !(with->log_likelihood() > now_.fit->log_likelihood())) {
        closure.notes = std::move(notes);
        return;
    }
    SampleModel base = base_->model();
    copy_turn_pattern(with->model().noise, base.noise);
    base_ = std::make_shared<SampleFit>(series_, std::move(base), rows_);
    now_.fit = std::move(with);
}

void SampleLoop::begin(Closure& closure) {
    closure.unit = "arcsec";
    closure.level = options.level;
    whole_ = all_rows();
    rounded_.restore();
    rows_.resize(chosen_.size());
    reported_.resize(chosen_.size());
    for (std::size_t i = 0; i < chosen_.size(); ++i) {
        rows_[i] = whole_[i] && chosen_[i] ? 1 : 0;
        reported_[i] = whole_[i] && !chosen_[i] ? 1 : 0;
    }
    if (series_.scale_factor_assumed) {
        closure.notes.push_back(
            fmt::format("the record declares no scale factor; {:g} arcsec per fringe is assumed, "
                        "and all rates are proportional to it",
                        series_.scale_factor_arcsec));
    }
    if (series_.input_late_s > 0.0) {
        closure.notes.push_back(
            fmt::format("the known input agrees with the samples best when it is {:.3g} s later: "
                        "the times of the samples are not the ends of their intervals",
                        series_.input_late_s));
    }
    now_ = {};
    next_id_ = 0;
    now_.fit = fit_base(closure);
    closure.heldout_before = score_of(*now_.fit, reported_, 0.0).error;
    if (disturbed_.rows.empty()) disturbed_ = find_disturbed(*now_.fit, whole_);
    if (disturbed_.share >= options.samples.loop.most_disturbed) disturbed_.rows.assign(disturbed_.rows.size(), 0);
    if (disturbed_.share > 0.0 && disturbed_.share < options.samples.loop.most_disturbed) {
        const double with = closure.heldout_before;
        for (std::size_t i = 0; i < rows_.size(); ++i) {
            if (!disturbed_.rows[i]) continue;
            rows_[i] = reported_[i] = whole_[i] = 0;
        }
        now_.fit = fit_base(closure);
        closure.notes.push_back(fmt::format(
            "{:.1f} % of the record is disturbed, with up to {:.3g} times the usual variance, most at {:.6g} s; "
            "fits and held-out errors leave it out (with it the held-out error of the base model is {:.6g} arcsec)",
            100.0 * disturbed_.share, disturbed_.worst, disturbed_.at_s, with));
        closure.heldout_before = score_of(*now_.fit, reported_, 0.0).error;
    }
    base_ = now_.fit;
}

SampleScore SampleLoop::score(const SampleFit& fit) const {
    return rounded_.drawn() ? rounded_.score_of(fit, reported_) : score_of(fit, reported_, used_step_);
}

/// Stretches that are excluded from the fit, by the record's clock.
void SampleLoop::take_disturbed(Closure& closure) const {
    for (std::size_t i = 0; i < disturbed_.rows.size(); ++i) {
        if (!disturbed_.rows[i]) continue;
        if (i == 0 || !disturbed_.rows[i - 1]) {
            closure.disturbed.push_back({series_.time_s[i] - series_.interval_s, series_.time_s[i]});
        }
        closure.disturbed.back().to_s = series_.time_s[i];
        closure.disturbed_share += 1.0 / static_cast<double>(disturbed_.rows.size());
    }
}

/// Spans of the record whose samples are missing, and a note.
void SampleLoop::take_gaps(Closure& closure) const {
    if (series_.missing.empty()) return;
    std::size_t count = 0;
    for (std::size_t i = 0; i < series_.missing.size(); ++i) {
        if (!series_.missing[i]) continue;
        ++count;
        if (i == 0 || !series_.missing[i - 1]) {
            closure.gaps.push_back({series_.time_s[i] - series_.interval_s, series_.time_s[i]});
        }
        closure.gaps.back().to_s = series_.time_s[i];
    }
    const Rows all = rows_about_gaps(series_.missing);
    const auto left_out = std::count(all.begin(), all.end(), 1);
    closure.notes.push_back(
        fmt::format("{} samples are missing in {} gap{}, the first at {:.6g} s; "
                    "with the rows after {} in which the angle is estimated anew, {} of {} rows are not used",
                    count, closure.gaps.size(), closure.gaps.size() == 1 ? "" : "s", closure.gaps.front().from_s,
                    closure.gaps.size() == 1 ? "it" : "them", left_out, all.size()));
}

/// Fills in the report: errors on the held-out blocks, and parameters of a last fit to the whole record.
void SampleLoop::finish(Closure& closure) {
    const SampleScore last = score(*now_.fit);
    closure.heldout_after = last.error;
    closure.noise_floor = last.floor;
    closure.log_likelihood_gain = last.log_likelihood - score(*base_).log_likelihood;
    take_disturbed(closure);
    take_gaps(closure);
    closure.residual.time_s = series_.time_s;
    for (std::size_t i = 0; i < series_.size(); ++i) {
        closure.residual.innovation.push_back(now_.fit->innovations()[i] * now_.fit->sd(i));
        closure.residual.sd.push_back(now_.fit->sd(i));
    }
    closure.residual.reported = reported_;
    double input = record_.declared.input_rate_deg_h.value_or(0.0);
    if (!series_.input_rate_deg_h.empty()) {
        input = 0.0;
        for (const double x : series_.input_rate_deg_h) input += x / static_cast<double>(series_.size());
    }
    closure.mean_input_rate_deg_h = input;
    monitor_.tell("fitting the whole record");
    SampleFigures figures = figures_from(now_.fit->model(), now_.added);
    closure.rounding_in_noise = !rounded_.drawn();
    closure.base = std::move(figures.base);
    if (!now_.added.empty()) closure.base_alone = figures_of(*base_, {}, record_.declared).base;
    std::optional<RateBeat> beat;
    if (closure.unexplained) beat = find_rate_beat(*base_, record_.declared);
    if (beat) {
        std::string& detail = closure.unexplained->detail;
        detail += fmt::format("{}{}", detail.empty() ? "" : "; ", text_of(*beat));
    }
    for (std::size_t k = 0; k < now_.added.size(); ++k) {
        Step& step = closure.steps.emplace_back(now_.added[k].step);
        if (step.parameters.empty()) step.parameters = std::move(figures.steps[k]);
        tie_to_motion(step, series_);
        std::string why;
        if (beat && may_be_of_beat(step, *beat)) {
            why = fmt::format(
                "{} was fitted only as a placeholder for lines of the beat of the input rate, and is not reported",
                step.effect->name());
        } else if (!accounted_by_reader(step, record_, why)) {
            closure.notes.insert(closure.notes.end(), figures.step_notes[k].begin(), figures.step_notes[k].end());
            continue;
        }
        closure.steps.pop_back();
        closure.notes.push_back(std::move(why));
    }
    for (const auto* notes : {&now_.notes, &figures.notes}) {
        closure.notes.insert(closure.notes.end(), notes->begin(), notes->end());
    }
    closure.verdict = verdict_of(closure);
}

/// Rows that are disturbed with the present model, among all rows.
Disturbed SampleLoop::still_disturbed() const {
    // With all rows, as the time of a step may be determined by disturbed rows alone.
    const Rows all = all_rows();
    SampleFit whole(series_, now_.fit->model(), all, SampleFit::Noise::held);
    whole = refine_steps(std::move(whole), all);
    return find_disturbed(whole, all);
}

/// Restores rows that seemed disturbed and that are explained by an effect which was added since.
/// \return whether they are enough for the loop to start again
bool SampleLoop::restore() {
    if (disturbed_.share == 0.0) return false;
    const Disturbed still = still_disturbed();
    double before = 0.0;
    double left = 0.0;
    Disturbed less = still;
    for (std::size_t i = 0; i < less.rows.size(); ++i) {
        less.rows[i] = disturbed_.rows[i] && still.rows[i] ? 1 : 0;
        before += disturbed_.rows[i];
        left += less.rows[i];
    }
    if (!(left < (1.0 - options.samples.loop.restored) * before)) return false;
    less.share = left / static_cast<double>(less.rows.size());
    disturbed_ = std::move(less);
    return true;
}

/// Parameters and their errors, from a fit to the whole record.
SampleFigures SampleLoop::figures_from(const SampleModel& model, const std::vector<AddedEffect>& added) {
    const auto of = [&](const SampleFit& fit) {
        return figures_of(refine_steps(refine_lines(fit, whole_), whole_), added, record_.declared);
    };
    const SampleFit whole(series_, model, whole_, SampleFit::Noise::near);
    return rounded_.drawn() ? rounded_.figures_of(whole, of) : of(whole);
}

Closure SampleLoop::run() {
    Closure closure;
    for (int look = 0; look < options.samples.loop.most_looks; ++look) {
        closure = {};
        monitor_.tell("fitting the base model");
        close(closure);
        if (!restore()) break;
    }
    monitor_.tell("testing the residual");
    test_what_is_left(closure);
    if (closure.unexplained && earlier_) {
        go_without_random(closure);
    } else if (closure.unexplained && nearest_) {
        look_behind_placeholder(closure);
    }
    take_back_lines(closure);
    test_left_out(closure);
    tested_ = closure;
    finish(closure);
    return closure;
}

bool SampleLoop::resampled() const {
    return now_.fit->model().noise.from_hz > 0.0 &&
           std::any_of(now_.added.begin(), now_.added.end(),
                       [](const AddedEffect& added) { return added.is_source(); });
}

std::vector<double> SampleLoop::other_sources_hz() const {
    for (const AddedEffect& added : now_.added) {
        if (added.is_source()) return added.other_hz;
    }
    return {};
}

Estimate SampleLoop::source_rate(const SampleModel& from) {
    const std::vector<AddedEffect> source{{*first_that_shows(OnSamples::transport), next_id_}};
    return figures_from(from, source).steps.front().front();
}

Closure SampleLoop::report_with(const KnownSource& source) {
    Closure closure = tested_;
    SampleModel model = now_.fit->model();
    move_source(model, series_, source.from_hz - model.noise.from_hz);
    model.held_from_hz_sd = source.sd_hz;
    now_.fit = std::make_shared<SampleFit>(series_, std::move(model), rows_, SampleFit::Noise::near);
    for (AddedEffect& added : now_.added) {
        if (added.is_source()) added.other_hz = source.other_hz;
    }
    finish(closure);
    return closure;
}

void SampleLoop::close(Closure& closure) {
    begin(closure);
    take_lattice(closure);
    earlier_.reset();
    add_all(closure, true);
}

void SampleLoop::take_known(const std::vector<ActiveEffect>& effects, Closure& closure) {
    begin(closure);
    KnownEffects known = known_effects(*now_.fit, effects);
    now_.added = std::move(known.added);
    for (AddedEffect& added : now_.added) {
        if (on_samples(added.effect()) != OnSamples::resolution) continue;
        lattice_ = find_lattice(chosen_increments(), now_.fit->typical_sd());
        used_step_ = lattice_.printed_arcsec;
        added.step.parameters.push_back(step_of_lattice(added.effect()));
    }
    now_.fit = std::make_shared<SampleFit>(series_, std::move(known.model), rows_, known.noise);
    for (AddedEffect& added : now_.added) {
        if (is_motion(added.step.effect) && !series_.witnesses.empty()) move_case(added, known.noise);
    }
    if (series_.counted || used_step_ > 0.0) find_coarse_steps(closure);
}

/// Fits the known effects from the values given, and does not test the residual.
Closure SampleLoop::fit(const std::vector<ActiveEffect>& effects) {
    Closure closure;
    for (int look = 0; look < options.samples.loop.most_looks; ++look) {
        closure = {};
        take_known(effects, closure);
        if (!restore()) break;
    }
    finish(closure);
    return closure;
}

Closure close_samples(const record::Record& record, const Monitor& monitor) {
    std::string note;
    const record::Record summed = summed_for_reader(record, note);
    Closure closure = SampleLoop(summed, monitor).run();
    if (!note.empty()) closure.notes.insert(closure.notes.begin(), std::move(note));
    return closure;
}

Closure fit_samples(const record::Record& record, const std::vector<ActiveEffect>& effects) {
    std::string note;
    const record::Record summed = summed_for_reader(record, note);
    return SampleLoop(summed).fit(effects);
}

}  // namespace ringlock::closure
