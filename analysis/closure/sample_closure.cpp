#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "analysis/closure/chance.hpp"
#include "analysis/closure/closure.hpp"
#include "analysis/closure/decision.hpp"
#include "analysis/closure/sample_fit.hpp"
#include "analysis/closure/sample_screen.hpp"
#include "analysis/closure/sample_search.hpp"
#include "analysis/closure/sample_series.hpp"
#include "analysis/closure/sample_tests.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::closure {

namespace {

/// What samples can tell of; the rest of the library needs turns.
constexpr double effects_on_samples = 12.0;

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();  // a standard error that is not computed

/// Of ten blocks, five are fitted (1), two decide whether what was found there holds (2), three are only reported (0).
constexpr BlockRoles roles{1, 1, 0, 1, 2, 0, 1, 2, 0, 1};

struct Score {
    double error = 0.0;
    double log_score = 0.0;
    double floor = 0.0;
};

/// One-step predictions of the rows that are only reported. With a lattice the prediction is a distribution on it.
Score heldout(const SampleFit& fit, const Rows& reported, double lattice) {
    Score score;
    double count = 0.0;
    for (std::size_t i = 0; i < reported.size(); ++i) {
        if (!reported[i]) continue;
        const double sd = fit.sd(i);
        double e = fit.innovations()[i] * sd;
        score.log_score -= 0.5 * e * e / (sd * sd) + std::log(sd) + 0.5 * std::log(units::two_pi);
        score.floor += sd * sd;
        if (lattice > 0.02 * sd) {
            const double x = fit.series().increment[i];
            const double predicted = x - e;
            const auto reach = static_cast<int>(std::ceil(6.0 * sd / lattice)) + 1;
            const double middle = std::round(predicted / lattice);
            double sum = 0.0;
            double mean = 0.0;
            for (int m = -reach; m <= reach; ++m) {
                const double value = (middle + m) * lattice;
                const double z = (value - predicted) / sd;
                const double w = std::exp(-0.5 * z * z);
                sum += w;
                mean += w * value;
            }
            e = x - mean / sum;
            // Of the step about each value, the density's share.
            score.log_score -= std::log(sum * lattice / (sd * std::sqrt(units::two_pi)));
        }
        score.error += e * e;
        count += 1.0;
    }
    count = std::max(count, 1.0);
    score.error = std::sqrt(score.error / count);
    score.floor = std::sqrt(score.floor / count);
    return score;
}

class Loop {
   public:
    explicit Loop(const record::Record& record)
        : record_(record), series_(prepare_samples(record)), chosen_(by_blocks(series_.size(), roles)) {}

    Closure run();

   private:
    std::vector<Estimate> estimates_of(const std::string& effect, const SampleFit& fit,
                                       const SampleCandidate& candidate) const;
    void take_lattice(Closure& closure, const SampleFit& now);

    const record::Record& record_;
    SampleSeries series_;
    Rows chosen_;  ///< by blocks: 1 fitted, 2 decides, 0 reported
    Rows rows_;    ///< fitted and not disturbed
    Rows decide_;  ///< decides and is not disturbed
    Rows reported_;
    Lattice lattice_;
    std::vector<double> lines_hz_;  ///< in the model
    double used_step_ = 0.0;        ///< of the lattice in the model
};

std::vector<Estimate> Loop::estimates_of(const std::string& effect, const SampleFit& fit,
                                         const SampleCandidate& candidate) const {
    std::vector<Estimate> all = candidate.told;
    const SampleModel& model = fit.model();
    const auto& columns = model.columns;
    for (std::size_t k = columns.size(); k-- > 1;) {
        if (columns[k].effect != effect) continue;
        if (columns[k].name == "sine") {
            const double amplitude = std::hypot(columns[k].value, columns[k - 1].value);
            const double hz = candidate.told.front().value;
            if (effect == "dither_residue") {
                const double gain = std::max(1e-9, 2.0 * std::abs(std::sin(units::pi * hz * series_.interval_s)));
                all.push_back({effect, "amplitude_arcsec", amplitude / gain, columns[k].sd / gain});
            } else {
                // Increments are those of a rate integrated over each interval.
                const double gain = std::abs(std::sin(units::pi * hz * series_.interval_s)) / (units::pi * hz);
                all.push_back({effect, "rate_deg_h", amplitude / gain, columns[k].sd / gain});
                const double middle_s = series_.time_s[0] - 0.5 * series_.interval_s +
                                        0.5 * static_cast<double>(series_.size() - 1) * series_.interval_s;
                // a cos + b sin = A sin(phase' + 2 pi f (t - middle))
                const double turns = hz * middle_s;
                const double start =
                    std::atan2(columns[k - 1].value, columns[k].value) - units::two_pi * (turns - std::floor(turns));
                all.push_back({effect, "phase_rad", std::remainder(start, units::two_pi),
                               columns[k].sd / std::max(amplitude, 1e-300)});
            }
            break;
        }
        if (columns[k].name != "cosine") {
            all.push_back({effect, columns[k].name, columns[k].value, columns[k].sd});
            break;
        }
    }
    const double count = static_cast<double>(series_.size());
    if (effect == "rate_random_walk")
        all.push_back({effect, "deg_h_rt_h", 60.0 * std::sqrt(model.noise.walk_arcsec2_s3), unknown});
    if (effect == "bias_instability") all.push_back({effect, "deg_h", model.flicker_deg_h, unknown});
    if (effect == "resampling") {
        const double seconds = count * series_.interval_s;
        all.push_back({effect, "from_hz", model.noise.from_hz, 1.0 / seconds});
    }
    for (std::size_t k = 0; k < model.resonances.size(); ++k) {
        if (model.resonances[k] != effect) continue;
        const auto& resonance = model.noise.resonances[k];
        if (effect == "case_motion") {
            all.push_back({effect, "centre_hz", resonance.hz, unknown});
            all.push_back({effect, "width_hz", resonance.width_hz, unknown});
        } else {
            all.push_back({effect, "amplitude_arcsec", std::numbers::sqrt2 * resonance.arcsec, unknown});
            all.push_back({effect, "wander_hz", resonance.width_hz, unknown});
        }
        break;
    }
    return all;
}

void Loop::take_lattice(Closure& closure, const SampleFit& now) {
    if (series_.counted) {
        closure.notes.push_back(
            fmt::format("counts are whole by their kind: steps of {:.6g} arcsec are no missing effect",
                        0.25 * series_.scale_factor_arcsec));
        return;
    }
    lattice_ = find_lattice(series_.increment);
    if (lattice_.step_arcsec == 0.0) return;
    const double step = lattice_.step_arcsec;
    const double sd = now.sd(series_.size() / 2);
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
    const Score before = heldout(now, reported_, 0.0);
    // Blurred steps are not where the values are: the digits are.
    used_step_ = blurred ? lattice_.printed_arcsec : step;
    const Score after = heldout(now, reported_, used_step_);
    taken.heldout_error_before = before.error;
    taken.heldout_error_after = after.error;
    taken.heldout_log_score_gain = after.log_score - before.log_score;
    taken.parameters.push_back({"count_quantization", "step_arcsec", step, blurred ? step * 1e-3 : step * 1e-9});
    closure.steps.push_back(std::move(taken));
}

Closure Loop::run() {
    Closure closure;
    closure.unit = "arcsec";
    closure.level = level;
    reported_.resize(chosen_.size());
    for (std::size_t i = 0; i < chosen_.size(); ++i) reported_[i] = chosen_[i] ? 0 : 1;
    if (series_.scale_factor_assumed) {
        closure.notes.push_back(fmt::format(
            "the record declares no scale factor; {:g} arcsec per fringe assumed, with which all rates scale",
            series_.scale_factor_arcsec));
    }
    const auto set_rows = [&](const Rows& without) {
        rows_.assign(chosen_.size(), 0);
        decide_.assign(chosen_.size(), 0);
        for (std::size_t i = 0; i < chosen_.size(); ++i) {
            if (!without.empty() && without[i]) continue;
            rows_[i] = chosen_[i] == 1 ? 1 : 0;
            decide_[i] = chosen_[i] == 2 ? 1 : 0;
        }
    };
    set_rows({});
    auto now = std::make_shared<SampleFit>(series_, SampleModel{}, rows_);
    closure.heldout_before = heldout(*now, reported_, 0.0).error;
    const Disturbed disturbed = find_disturbed(*now);
    if (disturbed.share > 0.0 && disturbed.share < 0.6) {
        set_rows(disturbed.rows);
        const double with = closure.heldout_before;
        for (std::size_t i = 0; i < reported_.size(); ++i) reported_[i] = reported_[i] && !disturbed.rows[i] ? 1 : 0;
        now = std::make_shared<SampleFit>(series_, SampleModel{}, rows_);
        closure.notes.push_back(fmt::format(
            "{:.1f} % of the record is disturbed, up to {:.3g} times the usual variance, most at {:.6g} s; nothing is "
            "fitted to it, held-out errors leave it out ({:.6g} arcsec before with it)",
            100.0 * disturbed.share, disturbed.worst, disturbed.at_s, with));
        closure.heldout_before = heldout(*now, reported_, 0.0).error;
    }
    take_lattice(closure, *now);

    std::vector<SampleCandidate> taken(closure.steps.size());
    while (closure.steps.size() < most_steps) {
        std::vector<SampleCandidate> candidates = screen_samples(*now, {record_.declared, series_, rows_, lines_hz_});
        struct Contender {
            SampleCandidate candidate;
            std::shared_ptr<SampleFit> fit;
            double merit;
        };
        std::vector<Contender> contenders;
        std::sort(candidates.begin(), candidates.end(),
                  [](const auto& a, const auto& b) { return a.p_value < b.p_value; });
        for (SampleCandidate& candidate : candidates) {
            if (!(candidate.p_value * effects_on_samples < level_of_effects)) continue;
            if (contenders.size() >= most_contenders + 2) break;
            auto fit = std::make_shared<SampleFit>(series_, candidate.model, rows_);
            const double merit =
                fit->log_likelihood() - now->log_likelihood() - std::log(candidate.searched) - candidate.parameters;
            // Whatever stands out: where the likelihood is not better, or the blocks that decide are foretold worse, it
            // is not this effect.
            if (merit < 0.0 || heldout(*fit, decide_, 0.0).log_score <= heldout(*now, decide_, 0.0).log_score) continue;
            contenders.push_back({std::move(candidate), std::move(fit), merit});
        }
        if (contenders.empty()) break;
        std::sort(contenders.begin(), contenders.end(), [](const auto& a, const auto& b) { return a.merit > b.merit; });
        Contender& best = contenders.front();
        Step step;
        step.effect = best.candidate.effect;
        step.p_value = best.candidate.p_value;
        step.confounded_with = best.candidate.confounded;
        for (std::size_t k = 1; k < contenders.size(); ++k) {
            if (best.merit - contenders[k].merit < tie) step.confounded_with.push_back(contenders[k].candidate.effect);
        }
        if (!step.confounded_with.empty()) step.experiment = experiment_for(step.effect, step.confounded_with);
        const Score before = heldout(*now, reported_, used_step_);
        now = best.fit;
        const Score after = heldout(*now, reported_, used_step_);
        step.heldout_error_before = before.error;
        step.heldout_error_after = after.error;
        step.heldout_log_score_gain = after.log_score - before.log_score;
        if (step.effect == "dither_residue" || step.effect == "base_vibration") {
            lines_hz_.push_back(best.candidate.told.front().value);
            if (best.candidate.wanders) {
                closure.notes.push_back(fmt::format(
                    "the line at {:.6g} Hz does not keep its phase over the record; it is foretold from the "
                    "samples before as a narrow resonance",
                    lines_hz_.back()));
            }
        }
        closure.steps.push_back(std::move(step));
        taken.push_back(std::move(best.candidate));
    }

    const Score last = heldout(*now, reported_, used_step_);
    closure.heldout_after = last.error;
    closure.noise_floor = last.floor;
    closure.tests = test_samples(*now, series_.counted ? 0.25 * series_.scale_factor_arcsec : lattice_.step_arcsec);
    const Disturbed still = find_disturbed(*now);
    closure.tests.push_back(
        {Where::time, fmt::format("stretches of {:.3g} s far larger than the others", still.length_s),
         still.share > 0.0 ? still.p_value : 1.0,
         still.share > 0.0 ? fmt::format("{:.1f} % of the record, most at {:.6g} s, {:.3g} times the usual variance",
                                         100.0 * still.share, still.at_s, still.worst)
                           : ""});
    const auto worst = std::min_element(closure.tests.begin(), closure.tests.end(),
                                        [](const auto& a, const auto& b) { return a.p_value < b.p_value; });
    if (of_several(worst->p_value, static_cast<double>(closure.tests.size())) < level_of_residual)
        closure.unexplained = *worst;
    closure.residual.time_s = series_.time_s;
    for (std::size_t i = 0; i < series_.size(); ++i) {
        closure.residual.innovation.push_back(now->innovations()[i] * now->sd(i));
        closure.residual.sd.push_back(now->sd(i));
    }
    closure.residual.reported = reported_;
    double input = record_.declared.input_rate_deg_h.value_or(0.0);
    if (!series_.input_rate_deg_h.empty()) {
        input = 0.0;
        for (const double x : series_.input_rate_deg_h) input += x / static_cast<double>(series_.size());
    }
    closure.mean_input_rate_deg_h = input;
    // The figures that are kept: from the whole record but what is disturbed.
    Rows whole(series_.size(), 1);
    if (disturbed.share > 0.0 && disturbed.share < 0.6) {
        for (std::size_t i = 0; i < whole.size(); ++i) whole[i] = disturbed.rows[i] ? 0 : 1;
    }
    const SampleFit final(series_, now->model(), whole);
    const SampleModel& model = final.model();
    closure.base.push_back({"", "mean_rate_deg_h", model.columns[0].value, model.columns[0].sd});
    closure.base.push_back({"", "white_angle_arcsec", model.noise.angle_arcsec, final.angle_sd()});
    closure.base.push_back({"", "white_rate_deg_rt_h", model.noise.rate_arcsec_rt_s * units::deg_rt_h_per_arcsec_rt_s,
                            final.rate_sd() * units::deg_rt_h_per_arcsec_rt_s});
    for (std::size_t k = 0; k < closure.steps.size(); ++k) {
        if (closure.steps[k].parameters.empty())
            closure.steps[k].parameters = estimates_of(closure.steps[k].effect, final, taken[k]);
    }
    closure.verdict = verdict_of(closure);
    return closure;
}

}  // namespace

Closure close_samples(const record::Record& record) { return Loop(record).run(); }

}  // namespace ringlock::closure
