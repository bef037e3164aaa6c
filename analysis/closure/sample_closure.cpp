#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>

#include "analysis/closure/chance.hpp"
#include "analysis/closure/closure.hpp"
#include "analysis/closure/sample_fit.hpp"
#include "analysis/closure/sample_search.hpp"
#include "analysis/closure/sample_series.hpp"
#include "analysis/closure/sample_tests.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::closure {

namespace {

/// As for turns: one family-wise level for everything that a record is asked.
constexpr double level = 0.003;
constexpr double level_of_effects = 0.002;
constexpr double level_of_residual = level - level_of_effects;
constexpr double tie = 4.0;
constexpr std::size_t most_steps = 8;
constexpr std::size_t most_contenders = 5;
/// What samples can tell of; the rest of the library needs turns.
constexpr double effects_on_samples = 12.0;

/// Contiguous blocks: of ten, five are fitted (1), two decide whether what was found there holds (2), three are only
/// reported (0).
Rows chosen_blocks(std::size_t size) {
    constexpr std::size_t blocks = 40;
    constexpr std::uint8_t chooses[10] = {1, 1, 0, 1, 2, 0, 1, 2, 0, 1};
    Rows rows(size);
    for (std::size_t i = 0; i < size; ++i) rows[i] = chooses[i * blocks / size % 10];
    return rows;
}

std::shared_ptr<const std::vector<double>> shared(std::vector<double> values) {
    return std::make_shared<const std::vector<double>>(std::move(values));
}

/// A model that the loop may go on with.
struct Candidate {
    std::string effect = {};
    SampleModel model = {};
    double p_value = 1.0;
    double searched = 1.0;
    int parameters = 1;
    bool wanders = false;                      ///< a line as a narrow resonance
    std::vector<Estimate> told = {};           ///< parameters that are no columns and no knobs
    std::vector<std::string> confounded = {};  ///< the same model by other names
};

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

SampleColumn rate_column(const SampleSeries& series, std::string effect, std::string name,
                         const std::function<double(std::size_t)>& rate) {
    std::vector<double> values(series.size());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = rate(i) * series.interval_s;
    return {std::move(effect), std::move(name), shared(std::move(values))};
}

bool has(const SampleModel& model, std::string_view effect) {
    return std::any_of(model.columns.begin(), model.columns.end(), [&](const auto& c) { return c.effect == effect; });
}

/// Alias of a frequency at that rate.
double alias(double hz, double rate_hz) {
    const double turns = hz / rate_hz;
    return std::abs(turns - std::round(turns)) * rate_hz;
}

class Loop {
   public:
    explicit Loop(const record::Record& record)
        : record_(record), series_(prepare_samples(record)), chosen_(chosen_blocks(series_.size())) {}

    Closure run();

   private:
    void screen_rates(const SampleFit& now, std::vector<Candidate>& out) const;
    void screen_noises(const SampleFit& now, std::vector<Candidate>& out) const;
    void screen_line(const SampleFit& now, std::vector<Candidate>& out) const;
    void screen_resampling(const SampleFit& now, std::vector<Candidate>& out) const;
    void screen_witnesses(const SampleFit& now, std::vector<Candidate>& out) const;
    std::vector<Estimate> estimates_of(const std::string& effect, const SampleFit& fit,
                                       const Candidate& candidate) const;
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

void Loop::screen_rates(const SampleFit& now, std::vector<Candidate>& out) const {
    const std::size_t n = series_.size();
    const SampleModel& model = now.model();
    // Where the model has left something, slow sums move more than white innovations would let them: by that much less
    // is a slow rate's chi-squared worth.
    double spread = 0.0;
    double sums = 0.0;
    const std::size_t length = std::max<std::size_t>(16, n / 1000);
    for (std::size_t a = 0; a + length <= n; a += length) {
        double sum = 0.0;
        double count = 0.0;
        for (std::size_t i = a; i < a + length; ++i) {
            if (!rows_[i]) continue;
            sum += now.innovations()[i];
            count += 1.0;
        }
        if (count < 0.5 * static_cast<double>(length)) continue;
        spread += sum * sum / count;
        sums += 1.0;
    }
    const double worth = sums > 20.0 ? std::min(1.0, sums / spread) : 1.0;
    const auto one = [&](const std::string& effect, const std::string& parameter,
                         const std::function<double(std::size_t)>& rate) {
        if (has(model, effect)) return;
        SampleColumn column = rate_column(series_, effect, parameter, rate);
        const auto score = now.score({*column.series});
        if (score.rank == 0) return;
        Candidate c{.effect = effect, .model = model, .p_value = chi2_tail(worth * score.chi2, 1)};
        c.model.columns.push_back(std::move(column));
        out.push_back(std::move(c));
    };
    one("bias_ramp", "deg_h_per_h",
        [&](std::size_t i) { return (static_cast<double>(i) + 0.5) * series_.interval_s / 3600.0; });
    if (!series_.temperature_change_k.empty()) {
        one("bias_temperature", "deg_h_per_k", [&](std::size_t i) { return series_.temperature_change_k[i]; });
    }
    if (!series_.input_rate_deg_h.empty()) {
        const auto [low, high] = std::minmax_element(series_.input_rate_deg_h.begin(), series_.input_rate_deg_h.end());
        if (*high > *low)
            one("scale_factor_error", "relative", [&](std::size_t i) { return series_.input_rate_deg_h[i]; });
    }
    if (has(model, "bias_step")) return;
    // Steps: everywhere, coarsely, then about the best.
    std::vector<double> roots;
    double best = 0.0;
    std::size_t at = 0;
    const auto root_at = [&](std::size_t row) {
        std::vector<double> step(n, 0.0);
        std::fill(step.begin() + static_cast<std::ptrdiff_t>(row), step.end(), series_.interval_s);
        const auto score = now.score({step});
        return score.rank == 0 ? 0.0 : std::copysign(std::sqrt(worth * score.chi2), score.value[0]);
    };
    constexpr std::size_t places = 80;
    for (std::size_t k = 1; k < places; ++k) {
        const double root = root_at(n * k / places);
        roots.push_back(root);
        if (std::abs(root) > best) {
            best = std::abs(root);
            at = n * k / places;
        }
    }
    const double p = davies_bound(best * best, roots);
    if (p > 0.01) return;
    for (std::size_t d = n / places / 2; d > 0; d /= 2) {
        for (const std::size_t row : {at > d ? at - d : at, std::min(n - 1, at + d)}) {
            const double root = std::abs(root_at(row));
            if (root > best) {
                best = root;
                at = row;
            }
        }
    }
    Candidate c{
        .effect = "bias_step", .model = model, .p_value = p, .searched = static_cast<double>(places), .parameters = 2};
    const double when = series_.time_s[at] - series_.interval_s;
    c.model.columns.push_back(
        rate_column(series_, "bias_step", "step_deg_h", [&](std::size_t i) { return i >= at ? 1.0 : 0.0; }));
    // As well as the step's own size is known: its chi-squared falls by one.
    c.told.push_back(
        {"bias_step", "time_s", when, static_cast<double>(n) * series_.interval_s / std::max(4.0, best * best)});
    out.push_back(std::move(c));
}

void Loop::screen_noises(const SampleFit& now, std::vector<Candidate>& out) const {
    const auto one = [&](const std::string& effect, SampleModel model) {
        const SampleFit fit(series_, std::move(model), rows_);
        const double chi2 = std::max(0.0, 2.0 * (fit.log_likelihood() - now.log_likelihood()));
        // A variance cannot be negative: half of the time there is no gain at all (Chernoff 1954).
        out.push_back({.effect = effect, .model = fit.model(), .p_value = 0.5 * chi2_tail(chi2, 1)});
    };
    const double duration_s = static_cast<double>(series_.size()) * series_.interval_s;
    const double known =
        now.model().noise.rate_arcsec_rt_s / std::sqrt(duration_s) + now.model().noise.angle_arcsec / duration_s;
    // Only where sums over long stretches move more than the white noises let them.
    {
        std::vector<std::vector<double>> slow;
        for (int k = 1; k <= 12; ++k) {
            std::vector<double> rate(series_.size());
            for (std::size_t i = 0; i < rate.size(); ++i) {
                rate[i] = std::cos(units::pi * k * (static_cast<double>(i) + 0.5) / static_cast<double>(rate.size()));
            }
            slow.push_back(std::move(rate));
        }
        const auto score = now.score(slow);
        if (chi2_tail(score.chi2, score.rank) > 0.01) return;
    }
    if (!now.model().walk) {
        SampleModel model = now.model();
        model.walk = true;
        model.noise.walk_arcsec2_s3 = 10.0 * known * known / duration_s;
        one("rate_random_walk", model);
    }
    if (!now.model().flicker) {
        SampleModel model = now.model();
        model.flicker = true;
        model.flicker_deg_h = 3.0 * known;
        model.noise.terms = flicker_terms(model.flicker_deg_h, 4.0 * series_.interval_s, duration_s);
        one("bias_instability", model);
    }
}

void Loop::screen_line(const SampleFit& now, std::vector<Candidate>& out) const {
    std::vector<double> e = now.innovations();
    for (std::size_t i = 0; i < e.size(); ++i) {
        if (!rows_[i]) e[i] = 0.0;
    }
    const double duration_s = static_cast<double>(series_.size()) * series_.interval_s;
    // What is left beside a line that is in the model is that line, not being what the model says.
    const FoundLine line = find_line(e, series_.rate_hz, true, lines_hz_, 64.0 / duration_s);
    if (!(line.p_value < 0.01)) return;
    Candidate c{.model = now.model(), .p_value = line.p_value, .searched = line.searched, .parameters = 3};
    const bool drifts =
        line.chi2 - line.chi2_still > 25.0 && std::abs(line.drift_hz_per_s) * duration_s * duration_s > 1.0;
    bool dither = drifts;
    bool declared = false;
    if (record_.declared.dither_frequency_hz) {
        for (int h = 1; h <= 3; ++h) {
            const double hz = alias(h * *record_.declared.dither_frequency_hz, series_.rate_hz);
            if (std::abs(line.frequency_hz - hz) < 0.005 * h * *record_.declared.dither_frequency_hz) declared = true;
        }
    }
    dither = dither || declared;
    const bool fast = line.frequency_hz > 30.0;
    c.effect = dither || fast ? "dither_residue" : "base_vibration";
    if (!dither) c.confounded.emplace_back(fast ? "base_vibration" : "dither_residue");
    if (line.scattered > 3.0 * line.chi2 + 100.0) {
        // Its phase does not keep over the record: a narrow resonance. Slow ones are what a base does as well.
        if (!fast && !declared) return;
        c.effect = "dither_residue";
        if (!declared) c.confounded = {"base_vibration"};
        c.wanders = true;
        double squares = 0.0;
        double rows = 0.0;
        for (std::size_t i = 0; i < e.size(); ++i) {
            squares += e[i] * e[i];
            rows += rows_[i];
        }
        // Power over the level is chi-squared of two a piece; the angle's increments have 2 sin of it.
        const double sd = now.sd(0) * std::sqrt(squares / rows);
        const double gain = 2.0 * std::sin(units::pi * line.scattered_hz / series_.rate_hz);
        const double rms = sd * std::sqrt(line.scattered / rows) / std::max(gain, 1e-6);
        c.told.push_back({c.effect, "frequency_hz", line.scattered_hz, 0.0});
        c.model.noise.resonances.push_back({rms, line.scattered_hz, 64.0 / duration_s});
        c.model.resonances.push_back(c.effect);
        out.push_back(std::move(c));
        return;
    }
    const auto phase =
        line_phase(series_.size(), series_.rate_hz, line.frequency_hz, drifts ? line.drift_hz_per_s : 0.0);
    std::vector<double> cosine(phase.size());
    std::vector<double> sine(phase.size());
    for (std::size_t i = 0; i < phase.size(); ++i) {
        cosine[i] = std::cos(phase[i]);
        sine[i] = std::sin(phase[i]);
    }
    const double sd_hz = std::sqrt(6.0) / (units::pi * duration_s * std::sqrt(std::max(line.chi2, 1.0)));
    c.told.push_back({c.effect, "frequency_hz", line.frequency_hz, sd_hz});
    if (c.effect == "dither_residue") {
        c.told.push_back({c.effect, "drift_hz_per_s", drifts ? line.drift_hz_per_s : 0.0,
                          drifts ? std::sqrt(45.0 * 16.0) /
                                       (units::pi * duration_s * duration_s * std::sqrt(std::max(line.chi2, 1.0)))
                                 : 0.0});
    }
    c.model.columns.push_back({c.effect, "cosine", shared(std::move(cosine))});
    c.model.columns.push_back({c.effect, "sine", shared(std::move(sine))});
    out.push_back(std::move(c));
}

void Loop::screen_resampling(const SampleFit& now, std::vector<Candidate>& out) const {
    if (now.model().noise.from_hz > 0.0) return;
    const FoundCycle cycle = find_cycle(now.innovations(), rows_, series_.rate_hz);
    if (!(cycle.p_value < level_of_effects)) return;
    // Rates whose distance from a multiple of the record's is that frequency, by likelihood on a part of the record.
    const double rate = series_.rate_hz;
    const std::size_t part = std::min<std::size_t>(series_.size(), 20000);
    double best = -1e300;
    SampleModel found;
    int tried = 0;
    for (int m = 0; m <= 4; ++m) {
        for (const int sign : {-1, 1}) {
            const double from = m * rate + sign * cycle.frequency_hz;
            if (from < 0.3 * rate || from > 4.5 * rate || std::abs(from - rate) < 1e-9 * rate) continue;
            for (int place = 0; place < 8; ++place) {
                SampleModel model = now.model();
                model.noise.from_hz = from;
                model.noise.from_phase = 0.125 * place;
                model.noise.blur_arcsec = 0.2 * now.sd(0);
                ++tried;
                const SampleFilter filter(model.noise, part, series_.interval_s);
                const auto e = filter.apply(std::span<const double>(now.rest().data(), part));
                // The scale free, all else as it is.
                double squares = 0.0;
                double logs = 0.0;
                double count = 0.0;
                for (std::size_t i = 0; i < part; ++i) {
                    if (!rows_[i]) continue;
                    squares += e[i] * e[i];
                    logs += std::log(filter.sd(i));
                    count += 1.0;
                }
                const double value = -0.5 * count * std::log(squares / count) - logs;
                if (value > best) {
                    best = value;
                    found = model;
                }
            }
        }
    }
    if (tried == 0) return;
    out.push_back({.effect = "resampling",
                   .model = found,
                   .p_value = cycle.p_value,
                   .searched = cycle.searched,
                   .parameters = 2});
}

void Loop::screen_witnesses(const SampleFit& now, std::vector<Candidate>& out) const {
    if (series_.witnesses.empty() || !now.model().motion.empty()) return;
    const FoundWitness witness = find_witness(now.innovations(), rows_, series_);
    if (!(witness.p_value < level_of_effects)) return;
    const WitnessMotion motion = fit_witness(now, series_.witnesses[witness.index].second);
    Candidate c{.effect = "case_motion",
                .model = now.model(),
                .p_value = witness.p_value,
                .searched = static_cast<double>(series_.witnesses.size()),
                .parameters = 2 * witness.lags + 1};
    c.model.motion = motion.increments;
    // What the witness does not tell moves like what it tells; its own noise hides the edges of that.
    const double untold = motion.rms_arcsec * std::sqrt(std::max(1.0 - motion.coherence, 1e-3));
    c.model.noise.resonances.push_back(
        {untold, std::max(motion.centre_hz, 0.01), std::max(0.5 * motion.centre_hz, 0.01)});
    c.model.noise.resonances.push_back({0.3 * untold, 1.0, 1.0});
    c.model.resonances.insert(c.model.resonances.end(), 2, "case_motion");
    // Once more with what is left as the noise.
    const SampleFit first(series_, c.model, rows_);
    const auto& watched = series_.witnesses[witness.index].second;
    c.model = first.model();
    const WitnessMotion more = fit_witness(first, watched);
    for (std::size_t i = 0; i < c.model.motion.size(); ++i) c.model.motion[i] += more.increments[i];
    Estimate name{"case_motion", "witness", static_cast<double>(witness.name.back() - 'x'), 0.0, witness.name};
    c.told.push_back(std::move(name));
    const double pieces = std::max(2.0, static_cast<double>(series_.size()) / 1024.0);
    c.told.push_back({"case_motion", "coherence", motion.coherence,
                      (1.0 - motion.coherence) * std::sqrt(2.0 * motion.coherence / (3.0 * pieces))});
    c.told.push_back({"case_motion", "rms_arcsec", motion.rms_arcsec, 0.0});
    out.push_back(std::move(c));
}

std::vector<Estimate> Loop::estimates_of(const std::string& effect, const SampleFit& fit,
                                         const Candidate& candidate) const {
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
        all.push_back({effect, "deg_h_rt_h", 60.0 * std::sqrt(model.noise.walk_arcsec2_s3), 0.0});
    if (effect == "bias_instability") all.push_back({effect, "deg_h", model.flicker_deg_h, 0.0});
    if (effect == "resampling") {
        const double seconds = count * series_.interval_s;
        all.push_back({effect, "from_hz", model.noise.from_hz, 1.0 / seconds});
    }
    for (std::size_t k = 0; k < model.resonances.size(); ++k) {
        if (model.resonances[k] != effect) continue;
        const auto& resonance = model.noise.resonances[k];
        if (effect == "case_motion") {
            all.push_back({effect, "centre_hz", resonance.hz, 0.0});
            all.push_back({effect, "width_hz", resonance.width_hz, 0.0});
        } else {
            all.push_back({effect, "amplitude_arcsec", std::numbers::sqrt2 * resonance.arcsec, 0.0});
            all.push_back({effect, "wander_hz", resonance.width_hz, 0.0});
        }
        break;
    }
    return all;
}

/// What would tell two effects apart that this record cannot.
std::string experiment_for(const std::string& effect, const std::vector<std::string>& others) {
    const auto named = [&](std::string_view name) {
        return effect == name || std::find(others.begin(), others.end(), name) != others.end();
    };
    if (named("dither_residue"))
        return "declare the dither's frequency, or record with another dither frequency or sampling rate";
    if (named("bias_temperature"))
        return "record with the temperature changed against time: held, then stepped up and down";
    if (named("scale_factor_error")) return "record at three input rates or more, of both signs";
    return "record for longer: their Allan deviations and their courses in time part with the averaging time";
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

    std::vector<Candidate> taken(closure.steps.size());
    while (closure.steps.size() < most_steps) {
        std::vector<Candidate> candidates;
        screen_line(*now, candidates);
        screen_witnesses(*now, candidates);
        screen_resampling(*now, candidates);
        screen_rates(*now, candidates);
        screen_noises(*now, candidates);
        struct Contender {
            Candidate candidate;
            std::shared_ptr<SampleFit> fit;
            double merit;
        };
        std::vector<Contender> contenders;
        std::sort(candidates.begin(), candidates.end(),
                  [](const auto& a, const auto& b) { return a.p_value < b.p_value; });
        for (Candidate& candidate : candidates) {
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
    closure.verdict = closure.unexplained     ? Verdict::unexplained
                      : closure.steps.empty() ? Verdict::nothing_missing
                                              : Verdict::closed;
    return closure;
}

}  // namespace

Closure close_samples(const record::Record& record) { return Loop(record).run(); }

}  // namespace ringlock::closure
