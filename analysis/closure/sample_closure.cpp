#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/chance.hpp"
#include "analysis/closure/closure.hpp"
#include "analysis/closure/decision.hpp"
#include "analysis/closure/sample_contest.hpp"
#include "analysis/closure/sample_figures.hpp"
#include "analysis/closure/sample_fit.hpp"
#include "analysis/closure/sample_known.hpp"
#include "analysis/closure/sample_lines.hpp"
#include "analysis/closure/sample_motion.hpp"
#include "analysis/closure/sample_rounded.hpp"
#include "analysis/closure/sample_score.hpp"
#include "analysis/closure/sample_screen.hpp"
#include "analysis/closure/sample_search.hpp"
#include "analysis/closure/sample_series.hpp"
#include "analysis/closure/sample_steps.hpp"
#include "analysis/closure/sample_tests.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::closure {

namespace {

/// Of the line that was added last.
double line_hz(const SampleModel& model, bool wanders) {
    return wanders ? model.noise.resonances.back().hz : model.columns[model.columns.size() - 2].hz;
}

/// Of a record; where it is more, that is what the record is like.
constexpr double most_disturbed = 0.6;

/// What an effect that has been added explains is not disturbed: so often it is looked at again.
constexpr int most_looks = 3;

/// Of increments that were rounded, after every step.
constexpr int draws_of_step = 2;
/// As it is told anew by what has come in, or has been drawn, beside it.
constexpr int most_motions = 6;

class Loop {
   public:
    explicit Loop(const record::Record& record)
        : record_(record),
          series_(prepare_samples(record)),
          rounded_(series_),
          chosen_(rows_that_choose(series_.size())) {}

    Closure run();
    Closure fit(const std::vector<ActiveEffect>& effects);

   private:
    /// The model as it has grown, with what was added.
    struct State {
        std::shared_ptr<SampleFit> fit;
        std::vector<Step> steps;
        std::vector<SampleStep> told;  ///< as many
        std::vector<double> lines_hz;
        std::vector<std::string> notes;  ///< on these steps
        /// What is added after another that was chosen with it is as confounded.
        std::vector<std::pair<std::string, std::vector<std::string>>> of_partners;
    };
    /// Of values as they are looked at: those that were drawn are in none that could be seen.
    double lattice_step() const {
        if (rounded_.drawn()) return 1e-9 * rounded_.step_arcsec();
        return counted_step() > 0.0 ? counted_step() : lattice_.step_arcsec;
    }
    double counted_step() const { return series_.counted ? 0.25 * series_.scale_factor_arcsec : 0.0; }
    std::vector<double> chosen_increments() const;
    Rows all_rows() const;
    void begin(Closure& closure);
    void close(Closure& closure);
    void take_known(const std::vector<ActiveEffect>& effects, Closure& closure);
    void add_all(Closure& closure, bool random_rates);
    void begin_again(const State& at);
    void go_without_random(Closure& closure);
    void look_beside_nearest(Closure& closure);
    bool keep_names(int first_step, const std::function<bool(const SampleStep&)>& keeps, Closure& closure);
    bool restore();
    void take_lattice(Closure& closure);
    const SampleContender& take_likelier(const SampleChoice& choice, Step& step);
    void take(const SampleChoice& choice, Closure& closure);
    void take_back_lines(Closure& closure);
    void move_case(SampleStep& told, SampleFit::Noise noise);
    bool move_anew();
    void drop_needless();
    void test_what_is_left(Closure& closure) const;
    void finish(Closure& closure);

    void find_coarse_steps(Closure& closure);
    SampleScore score(const SampleFit& fit) const;
    SampleFigures figures();

    const record::Record& record_;
    SampleSeries series_;
    RoundedSamples rounded_;
    Rows chosen_;
    Rows rows_;  ///< chosen and not disturbed
    Rows reported_;
    Rows whole_;
    Disturbed disturbed_;
    Lattice lattice_;
    double used_step_ = 0.0;  ///< of the lattice in the model
    std::shared_ptr<SampleFit> base_;
    State now_;
    std::optional<State> earlier_;              ///< before the first random rate
    std::shared_ptr<SampleContender> nearest_;  ///< of SampleChoice, where nothing was chosen any more
    int next_step_ = 0;
};

/// What a witness tells at lags, it does not tell at the ends of the record; what it left untold at the start, a narrow
/// motion remembers for longer.
Rows Loop::all_rows() const {
    constexpr std::size_t remembered = 4;
    Rows all(series_.size(), 1);
    if (series_.witnesses.empty()) return all;
    const auto lags = static_cast<std::size_t>(witness_lags(series_.rate_hz));
    const std::size_t most = all.size() / 20;
    std::fill_n(all.begin(), std::min(remembered * lags, most), 0);
    std::fill_n(all.rbegin(), std::min(lags, most), 0);
    return all;
}

void Loop::begin(Closure& closure) {
    closure.unit = "arcsec";
    closure.level = level;
    whole_ = all_rows();
    rounded_.restore();
    rows_.resize(chosen_.size());
    reported_.resize(chosen_.size());
    for (std::size_t i = 0; i < chosen_.size(); ++i) {
        rows_[i] = whole_[i] && chosen_[i] ? 1 : 0;
        reported_[i] = whole_[i] && !chosen_[i] ? 1 : 0;
    }
    if (series_.scale_factor_assumed) {
        closure.notes.push_back(fmt::format(
            "the record declares no scale factor; {:g} arcsec per fringe assumed, with which all rates scale",
            series_.scale_factor_arcsec));
    }
    if (series_.input_late_s > 0.0) {
        closure.notes.push_back(
            fmt::format("the known input goes with the samples {:.3g} s later: their times are not those "
                        "of the ends of their intervals",
                        series_.input_late_s));
    }
    now_ = {};
    next_step_ = 0;
    now_.fit = std::make_shared<SampleFit>(series_, SampleModel{}, rows_);
    closure.heldout_before = score_of(*now_.fit, reported_, 0.0).error;
    if (disturbed_.rows.empty()) disturbed_ = find_disturbed(*now_.fit, whole_);
    if (disturbed_.share >= most_disturbed) disturbed_.rows.assign(disturbed_.rows.size(), 0);
    if (disturbed_.share > 0.0 && disturbed_.share < most_disturbed) {
        const double with = closure.heldout_before;
        for (std::size_t i = 0; i < rows_.size(); ++i) {
            if (!disturbed_.rows[i]) continue;
            rows_[i] = reported_[i] = whole_[i] = 0;
        }
        now_.fit = std::make_shared<SampleFit>(series_, SampleModel{}, rows_);
        closure.notes.push_back(fmt::format(
            "{:.1f} % of the record is disturbed, up to {:.3g} times the usual variance, most at {:.6g} s; nothing is "
            "fitted to it, held-out errors leave it out ({:.6g} arcsec before with it)",
            100.0 * disturbed_.share, disturbed_.worst, disturbed_.at_s, with));
        closure.heldout_before = score_of(*now_.fit, reported_, 0.0).error;
    }
    base_ = now_.fit;
}

/// Values that nothing is held out of: steps are chosen like any other effect.
std::vector<double> Loop::chosen_increments() const {
    std::vector<double> values;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
        if (rows_[i]) values.push_back(series_.increment[i]);
    }
    return values;
}

void Loop::take_lattice(Closure& closure) {
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
    taken.effect = "count_quantization";
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
void Loop::find_coarse_steps(Closure& closure) {
    const bool blurred = lattice_.step_arcsec > 1.5 * lattice_.printed_arcsec;
    const double step = series_.counted ? counted_step() : blurred ? 0.0 : lattice_.step_arcsec;
    if (!RoundedSamples::show(*now_.fit, step)) return;
    now_.fit = rounded_.begin(*now_.fit, step);
    closure.notes.push_back(
        fmt::format("steps of {:.6g} arcsec are large beside the noise, and their rounding follows the angle: what "
                    "was rounded is drawn by the model, and white_angle_arcsec is the noise before it was rounded",
                    step));
}

SampleScore Loop::score(const SampleFit& fit) const {
    return rounded_.drawn() ? rounded_.score_of(fit, reported_) : score_of(fit, reported_, used_step_);
}

/// Effects that stood in for the one added last are no longer needed beside it.
void Loop::drop_needless() {
    for (std::size_t k = now_.steps.size(); k-- > 0;) {
        const std::string effect = now_.steps[k].effect;
        SampleModel without = now_.fit->model();
        if (effect == "rate_random_walk") {
            without.walk = false;
            without.noise.walk_arcsec2_s3 = 0.0;
        } else if (effect == "bias_instability") {
            without.flicker = false;
            without.noise.terms.clear();
        } else if (effect.starts_with("bias_") || effect == "scale_factor_error") {
            std::erase_if(without.columns, [&](const SampleColumn& c) { return c.effect == effect; });
        } else {
            continue;
        }
        auto fitted = std::make_shared<SampleFit>(series_, std::move(without), rows_, SampleFit::Noise::near);
        const double chi2 = 2.0 * (now_.fit->gain_over(*fitted));
        const int parameters = effect == "bias_step" ? 2 : 1;
        if (passes_on_samples(chi2_tail(chi2, parameters))) continue;
        now_.fit = std::move(fitted);
        now_.steps.erase(now_.steps.begin() + static_cast<std::ptrdiff_t>(k));
        now_.told.erase(now_.told.begin() + static_cast<std::ptrdiff_t>(k));
    }
}

/// Tests of what the model has left; where structure lies, if any passes the level: by the regression that explains
/// most, the noise fitted anew beside it; where none does, by the test that is least probable by chance.
void Loop::test_what_is_left(Closure& closure) const {
    constexpr std::size_t looked_at = 4;
    auto views = view_samples(*now_.fit, lattice_step());
    const Disturbed still = find_disturbed(*now_.fit, whole_);
    views.push_back(
        {{Where::time, fmt::format("stretches of {:.3g} s far larger than the others", still.length_s),
          still.share > 0.0 ? still.p_value : 1.0,
          still.share > 0.0 ? fmt::format("{:.1f} % of the record, most at {:.6g} s, {:.3g} times the usual variance",
                                          100.0 * still.share, still.at_s, still.worst)
                            : ""}});
    if (rounded_.drawn()) views.push_back({rounded_.test(*now_.fit)});
    closure.tests.clear();
    for (const View& view : views) closure.tests.push_back(view.test);
    closure.unexplained.reset();
    const auto count = static_cast<double>(views.size());
    std::erase_if(views, [&](const View& view) { return of_several(view.test.p_value, count) >= level_of_residual; });
    if (views.empty()) return;
    std::sort(views.begin(), views.end(), [](const View& a, const View& b) { return a.test.p_value < b.test.p_value; });
    closure.unexplained = views.front().test;
    std::sort(views.begin(), views.end(), [](const View& a, const View& b) { return a.test.merit > b.test.merit; });
    double most = 0.0;
    for (std::size_t k = 0; k < std::min(looked_at, views.size()); ++k) {
        if (!views[k].columns && !(views[k].test.merit > 0.0)) continue;
        const double merit = views[k].columns ? refitted_merit(*now_.fit, views[k]) : views[k].test.merit;
        if (merit <= most) continue;
        most = merit;
        closure.unexplained = views[k].test;
    }
}

/// What is reported: errors of the blocks held out, parameters of a last fit to the whole record.
void Loop::finish(Closure& closure) {
    const SampleScore last = score(*now_.fit);
    closure.heldout_after = last.error;
    closure.noise_floor = last.floor;
    closure.log_likelihood_gain = last.log_likelihood - score(*base_).log_likelihood;
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
    SampleFigures figures = this->figures();
    closure.rounding_in_noise = !rounded_.drawn();
    closure.base = std::move(figures.base);
    closure.steps = std::move(now_.steps);
    for (std::size_t k = 0; k < closure.steps.size(); ++k) {
        if (closure.steps[k].parameters.empty()) closure.steps[k].parameters = std::move(figures.steps[k]);
    }
    for (auto* notes : {&now_.notes, &figures.notes}) {
        for (std::string& note : *notes) closure.notes.push_back(std::move(note));
    }
    closure.verdict = verdict_of(closure);
}

/// An effect that has come into the model may be what seemed to disturb a part of the record: whether any of that part
/// is to be looked at again.
bool Loop::restore() {
    constexpr double little = 0.05;
    if (disturbed_.share == 0.0) return false;
    // With all that is there, as a place in it may be known by nothing else.
    const Rows all = all_rows();
    SampleFit whole(series_, now_.fit->model(), all, SampleFit::Noise::held);
    whole = refine_steps(std::move(whole), all);
    const Disturbed still = find_disturbed(whole, all);
    double before = 0.0;
    double left = 0.0;
    Disturbed less = still;
    for (std::size_t i = 0; i < less.rows.size(); ++i) {
        less.rows[i] = disturbed_.rows[i] && still.rows[i] ? 1 : 0;
        before += disturbed_.rows[i];
        left += less.rows[i];
    }
    if (!(left < (1.0 - little) * before)) return false;
    less.share = left / static_cast<double>(less.rows.size());
    disturbed_ = std::move(less);
    return true;
}

/// Of a fit to the whole record.
SampleFigures Loop::figures() {
    const auto of = [&](const SampleFit& fit) {
        return figures_of(refine_steps(refine_lines(fit, whole_), whole_), now_.told, record_.declared);
    };
    const SampleFit whole(series_, now_.fit->model(), whole_, SampleFit::Noise::near);
    return rounded_.drawn() ? rounded_.figures_of(whole, of) : of(whole);
}

Closure Loop::run() {
    Closure closure;
    for (int look = 0; look < most_looks; ++look) {
        closure = {};
        close(closure);
        if (!restore()) break;
    }
    test_what_is_left(closure);
    if (closure.unexplained && earlier_) {
        go_without_random(closure);
    } else if (closure.unexplained && nearest_) {
        look_beside_nearest(closure);
    }
    take_back_lines(closure);
    finish(closure);
    return closure;
}

void Loop::begin_again(const State& at) {
    now_ = at;
    // It was fitted to what was drawn then.
    if (rounded_.drawn()) now_.fit = rounded_.draw(now_.fit, draws_of_step);
}

/// A rate is left that the random one has only come nearest to: several of the library together, if they leave nothing
/// and are likelier; else no rate is named, and what was found beside it that is none stays.
void Loop::go_without_random(Closure& closure) {
    const State followed = now_;
    const std::optional<ResidualTest> left = closure.unexplained;
    const std::vector<ResidualTest> tests = closure.tests;
    begin_again(*earlier_);
    add_all(closure, false);
    test_what_is_left(closure);
    if (!closure.unexplained && now_.fit->gain_over(*followed.fit) > 0.0) return;
    begin_again(followed);
    closure.unexplained = left;
    closure.tests = tests;
    const auto keeps = [](const SampleStep& told) { return !is_slow_rate(told.effect); };
    if (keep_names(earlier_->told.empty() ? 0 : earlier_->told.back().step + 1, keeps, closure)) return;
    begin_again(*earlier_);
    test_what_is_left(closure);
}

/// A rate or a line is left that the library does not have, and in the way of what else there is: that is looked for
/// beside what comes nearest to it.
void Loop::look_beside_nearest(Closure& closure) {
    constexpr int most = 3;
    const State without = now_;
    const int first = next_step_;
    const std::optional<ResidualTest> left = closure.unexplained;
    const std::vector<ResidualTest> tests = closure.tests;
    const bool line = is_line(nearest_->candidate.effect);
    std::vector<double> around_hz;
    for (int k = 0; k < most && nearest_ && is_line(nearest_->candidate.effect) == line; ++k) {
        SampleChoice choice;
        choice.chosen = std::exchange(nearest_, {});
        take(choice, closure);
        around_hz.push_back(now_.told.back().hz);
        add_all(closure, line);
    }
    // What is left of a line lies about it, and a rate that is left takes another's shape.
    const auto keeps = [&](const SampleStep& told) {
        if (!line) return !is_slow_rate(told.effect);
        if (!is_line(told.effect)) return !is_random_rate(told.effect);
        return std::none_of(around_hz.begin(), around_hz.end(),
                            [&](double hz) { return std::abs(hz - told.hz) < beside_hz; });
    };
    if (!keep_names(first, keeps, closure)) begin_again(without);
    closure.unexplained = left;
    closure.tests = tests;
}

/// Of what was added from that step on, some loses its name.
/// \return whether anything keeps it
bool Loop::keep_names(int first_step, const std::function<bool(const SampleStep&)>& keeps, Closure& closure) {
    const auto since = [&](const SampleStep& told) { return told.step >= first_step; };
    const auto stays = [&](const SampleStep& told) { return since(told) && keeps(told); };
    if (std::none_of(now_.told.begin(), now_.told.end(), stays)) return false;
    for (std::size_t k = now_.told.size(); k-- > 0;) {
        if (!since(now_.told[k]) || stays(now_.told[k])) continue;
        closure.notes.push_back(fmt::format(
            "{} follows what may be nothing that the library has: it is in the model, so that the rest can be "
            "told, and is not named",
            now_.steps[k].effect));
        now_.steps.erase(now_.steps.begin() + static_cast<std::ptrdiff_t>(k));
        now_.told.erase(now_.told.begin() + static_cast<std::ptrdiff_t>(k));
    }
    return true;
}

void Loop::close(Closure& closure) {
    begin(closure);
    take_lattice(closure);
    earlier_.reset();
    add_all(closure, true);
}

/// Adds what earns its place, until nothing does.
void Loop::add_all(Closure& closure, bool random_rates) {
    while (now_.steps.size() < most_steps) {
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
const SampleContender& Loop::take_likelier(const SampleChoice& choice, Step& step) {
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
    std::erase_if(
        tied, [&](const std::string& name) { return name == left.candidate.effect || name == taken.candidate.effect; });
    if (std::abs(gain) < tie) tied.push_back(left.candidate.effect);
    if (other) step.p_value = taken.candidate.p_value;
    return taken;
}

/// Adds an effect to the model.
void Loop::take(const SampleChoice& choice, Closure& closure) {
    Step step;
    step.p_value = choice.p_value;
    step.confounded_with = choice.confounded_with;
    const SampleScore before = score(*now_.fit);
    const SampleContender& best = take_likelier(choice, step);
    const std::string effect = best.candidate.effect;
    step.effect = effect;
    for (const auto& [partner, names] : now_.of_partners) {
        if (partner != effect) continue;
        for (const std::string& name : names) {
            const auto& named = step.confounded_with;
            if (std::find(named.begin(), named.end(), name) == named.end()) step.confounded_with.push_back(name);
        }
    }
    now_.of_partners.insert(now_.of_partners.end(), choice.of_partners.begin(), choice.of_partners.end());
    if (!step.confounded_with.empty()) step.experiment = experiment_for(step.effect, step.confounded_with);
    drop_needless();
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
        const double hz = line_hz(now_.fit->model(), best.candidate.wanders);
        now_.lines_hz.push_back(alias(hz, series_.rate_hz).hz);
        now_.told.back().hz = now_.lines_hz.back();
        if (best.candidate.wanders) {
            now_.notes.push_back(
                fmt::format("the line at {:.6g} Hz does not keep its phase over the record; it is foretold from the "
                            "samples before as a narrow resonance",
                            now_.lines_hz.back()));
        }
    }
    now_.steps.push_back(std::move(step));
}

/// A line of the library keeps its amplitude, and its frequency but for an even drift. One that does not, as its own
/// amplitudes in time or lines beside it show, is none and is not named.
void Loop::take_back_lines(Closure& closure) {
    if (!closure.unexplained) return;
    const UnsteadyLine line = unsteady_line(*now_.fit);
    const bool fails = of_several(line.p_value, static_cast<double>(closure.tests.size())) < level_of_residual;
    if (!fails && !line.beside) return;
    for (std::size_t k = 0; k < now_.told.size(); ++k) {
        if (now_.told[k].step != line.step) continue;
        const std::string at = fmt::format("at {:.6g} Hz", line.hz);
        closure.unexplained = ResidualTest{line.beside ? Where::frequency : Where::amplitude,
                                           "a line that does not keep its amplitude or its frequency",
                                           fails ? line.p_value : closure.unexplained->p_value, at};
        closure.notes.push_back(
            fmt::format("the line {} is in the model, so that the rest can be told, and is not named", at));
        now_.steps.erase(now_.steps.begin() + static_cast<std::ptrdiff_t>(k));
        now_.told.erase(now_.told.begin() + static_cast<std::ptrdiff_t>(k));
        return;
    }
}

/// What a witness told of a motion, and what it left, was told beside the noise as it was, which what has been added
/// was a part of.
bool Loop::move_anew() {
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
void Loop::move_case(SampleStep& told, SampleFit::Noise noise) {
    SampleModel model = now_.fit->model();
    add_motion(model, series_, told.witness, told.step);
    auto weak = std::make_shared<SampleFit>(series_, std::move(model), rows_, noise);
    auto strong = std::make_shared<SampleFit>(series_, moved_as(*now_.fit, told.witness, told.step), rows_,
                                              SampleFit::Noise::near);
    const double more = 2.0 * witness_lags(series_.rate_hz) - 1.0;
    told.strong = strong->gain_over(*weak) > more;
    now_.fit = told.strong ? std::move(strong) : std::move(weak);
}

void Loop::take_known(const std::vector<ActiveEffect>& effects, Closure& closure) {
    begin(closure);
    KnownEffects known = known_effects(*now_.fit, effects);
    for (const SampleStep& told : known.told) {
        Step& step = now_.steps.emplace_back();
        step.effect = told.effect;
        if (told.effect != "count_quantization") continue;
        lattice_ = find_lattice(chosen_increments(), now_.fit->sd(series_.size() / 2));
        used_step_ = lattice_.printed_arcsec;
        step.parameters.push_back({told.effect, "step_arcsec", lattice_.step_arcsec, lattice_.step_sd_arcsec});
    }
    now_.told = std::move(known.told);
    now_.fit = std::make_shared<SampleFit>(series_, std::move(known.model), rows_, known.noise);
    for (SampleStep& told : now_.told) {
        if (told.effect == "case_motion" && !series_.witnesses.empty()) move_case(told, known.noise);
    }
    if (series_.counted || used_step_ > 0.0) find_coarse_steps(closure);
}

/// Whatever is known to be there, at the values given or near them; what is left is not looked at.
Closure Loop::fit(const std::vector<ActiveEffect>& effects) {
    Closure closure;
    for (int look = 0; look < most_looks; ++look) {
        closure = {};
        take_known(effects, closure);
        if (!restore()) break;
    }
    finish(closure);
    return closure;
}

}  // namespace

Closure close_samples(const record::Record& record) { return Loop(record).run(); }

Closure fit_samples(const record::Record& record, const std::vector<ActiveEffect>& effects) {
    return Loop(record).fit(effects);
}

}  // namespace ringlock::closure
