#include "analysis/closure/sample_screen.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>

#include "analysis/closure/chance.hpp"
#include "analysis/closure/decision.hpp"
#include "analysis/closure/sample_search.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::closure {

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();  // a standard error that is not computed

std::shared_ptr<const std::vector<double>> shared(std::vector<double> values) {
    return std::make_shared<const std::vector<double>>(std::move(values));
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

void screen_rates(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    const std::size_t n = in.series.size();
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
            if (!in.rows[i]) continue;
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
        SampleColumn column = rate_column(in.series, effect, parameter, rate);
        const auto score = now.score({*column.series});
        if (score.rank == 0) return;
        SampleCandidate c{.effect = effect, .model = model, .p_value = chi2_tail(worth * score.chi2, 1)};
        c.model.columns.push_back(std::move(column));
        out.push_back(std::move(c));
    };
    one("bias_ramp", "deg_h_per_h",
        [&](std::size_t i) { return (static_cast<double>(i) + 0.5) * in.series.interval_s / 3600.0; });
    if (!in.series.temperature_change_k.empty()) {
        one("bias_temperature", "deg_h_per_k", [&](std::size_t i) { return in.series.temperature_change_k[i]; });
    }
    if (!in.series.input_rate_deg_h.empty()) {
        const auto [low, high] =
            std::minmax_element(in.series.input_rate_deg_h.begin(), in.series.input_rate_deg_h.end());
        if (*high > *low)
            one("scale_factor_error", "relative", [&](std::size_t i) { return in.series.input_rate_deg_h[i]; });
    }
    if (has(model, "bias_step")) return;
    // Steps: everywhere, coarsely, then about the best.
    std::vector<double> roots;
    double best = 0.0;
    std::size_t at = 0;
    const auto root_at = [&](std::size_t row) {
        std::vector<double> step(n, 0.0);
        std::fill(step.begin() + static_cast<std::ptrdiff_t>(row), step.end(), in.series.interval_s);
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
    SampleCandidate c{
        .effect = "bias_step", .model = model, .p_value = p, .searched = static_cast<double>(places), .parameters = 2};
    const double when = in.series.time_s[at] - in.series.interval_s;
    c.model.columns.push_back(
        rate_column(in.series, "bias_step", "step_deg_h", [&](std::size_t i) { return i >= at ? 1.0 : 0.0; }));
    // As well as the step's own size is known: its chi-squared falls by one.
    c.told.push_back(
        {"bias_step", "time_s", when, static_cast<double>(n) * in.series.interval_s / std::max(4.0, best * best)});
    out.push_back(std::move(c));
}

void screen_noises(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    const auto one = [&](const std::string& effect, SampleModel model) {
        const SampleFit fit(in.series, std::move(model), in.rows);
        const double chi2 = std::max(0.0, 2.0 * (fit.log_likelihood() - now.log_likelihood()));
        // A variance cannot be negative: half of the time there is no gain at all (Chernoff 1954).
        out.push_back({.effect = effect, .model = fit.model(), .p_value = 0.5 * chi2_tail(chi2, 1)});
    };
    const double duration_s = static_cast<double>(in.series.size()) * in.series.interval_s;
    const double known =
        now.model().noise.rate_arcsec_rt_s / std::sqrt(duration_s) + now.model().noise.angle_arcsec / duration_s;
    // Only where sums over long stretches move more than the white noises let them.
    {
        std::vector<std::vector<double>> slow;
        for (int k = 1; k <= 12; ++k) {
            std::vector<double> rate(in.series.size());
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
        model.noise.terms = flicker_terms(model.flicker_deg_h, 4.0 * in.series.interval_s, duration_s);
        one("bias_instability", model);
    }
}

void screen_line(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    std::vector<double> e = now.innovations();
    for (std::size_t i = 0; i < e.size(); ++i) {
        if (!in.rows[i]) e[i] = 0.0;
    }
    const double duration_s = static_cast<double>(in.series.size()) * in.series.interval_s;
    // What is left beside a line that is in the model is that line, not being what the model says.
    const FoundLine line = find_line(e, in.series.rate_hz, true, in.lines_hz, 64.0 / duration_s);
    if (!(line.p_value < 0.01)) return;
    SampleCandidate c{.model = now.model(), .p_value = line.p_value, .searched = line.searched, .parameters = 3};
    const bool drifts =
        line.chi2 - line.chi2_still > 25.0 && std::abs(line.drift_hz_per_s) * duration_s * duration_s > 1.0;
    bool dither = drifts;
    bool declared = false;
    if (in.declared.dither_frequency_hz) {
        for (int h = 1; h <= 3; ++h) {
            const double hz = alias(h * *in.declared.dither_frequency_hz, in.series.rate_hz);
            if (std::abs(line.frequency_hz - hz) < 0.005 * h * *in.declared.dither_frequency_hz) declared = true;
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
            rows += in.rows[i];
        }
        // Power over the level is chi-squared of two a piece; the angle's increments have 2 sin of it.
        const double sd = now.sd(0) * std::sqrt(squares / rows);
        const double gain = 2.0 * std::sin(units::pi * line.scattered_hz / in.series.rate_hz);
        const double rms = sd * std::sqrt(line.scattered / rows) / std::max(gain, 1e-6);
        c.told.push_back({c.effect, "frequency_hz", line.scattered_hz, unknown});
        c.model.noise.resonances.push_back({rms, line.scattered_hz, 64.0 / duration_s});
        c.model.resonances.push_back(c.effect);
        out.push_back(std::move(c));
        return;
    }
    const auto phase =
        line_phase(in.series.size(), in.series.rate_hz, line.frequency_hz, drifts ? line.drift_hz_per_s : 0.0);
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

void screen_resampling(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    if (now.model().noise.from_hz > 0.0) return;
    const FoundCycle cycle = find_cycle(now.innovations(), in.rows, in.series.rate_hz);
    if (!(cycle.p_value < level_of_effects)) return;
    // Rates whose distance from a multiple of the record's is that frequency, by likelihood on a part of the record.
    const double rate = in.series.rate_hz;
    const std::size_t part = std::min<std::size_t>(in.series.size(), 20000);
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
                const SampleFilter filter(model.noise, part, in.series.interval_s);
                const auto e = filter.apply(std::span<const double>(now.rest().data(), part));
                // The scale free, all else as it is.
                double squares = 0.0;
                double logs = 0.0;
                double count = 0.0;
                for (std::size_t i = 0; i < part; ++i) {
                    if (!in.rows[i]) continue;
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

void screen_witnesses(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    if (in.series.witnesses.empty() || !now.model().motion.empty()) return;
    const FoundWitness witness = find_witness(now.innovations(), in.rows, in.series);
    if (!(witness.p_value < level_of_effects)) return;
    const WitnessMotion motion = fit_witness(now, in.series.witnesses[witness.index].second);
    SampleCandidate c{.effect = "case_motion",
                      .model = now.model(),
                      .p_value = witness.p_value,
                      .searched = static_cast<double>(in.series.witnesses.size()),
                      .parameters = 2 * witness.lags + 1};
    c.model.motion = motion.increments;
    // What the witness does not tell moves like what it tells; its own noise hides the edges of that.
    const double untold = motion.rms_arcsec * std::sqrt(std::max(1.0 - motion.coherence, 1e-3));
    c.model.noise.resonances.push_back(
        {untold, std::max(motion.centre_hz, 0.01), std::max(0.5 * motion.centre_hz, 0.01)});
    c.model.noise.resonances.push_back({0.3 * untold, 1.0, 1.0});
    c.model.resonances.insert(c.model.resonances.end(), 2, "case_motion");
    // Once more with what is left as the noise.
    const SampleFit first(in.series, c.model, in.rows);
    const auto& watched = in.series.witnesses[witness.index].second;
    c.model = first.model();
    const WitnessMotion more = fit_witness(first, watched);
    for (std::size_t i = 0; i < c.model.motion.size(); ++i) c.model.motion[i] += more.increments[i];
    Estimate name{"case_motion", "witness", static_cast<double>(witness.name.back() - 'x'), 0.0, witness.name};
    c.told.push_back(std::move(name));
    const double pieces = std::max(2.0, static_cast<double>(in.series.size()) / 1024.0);
    c.told.push_back({"case_motion", "coherence", motion.coherence,
                      (1.0 - motion.coherence) * std::sqrt(2.0 * motion.coherence / (3.0 * pieces))});
    c.told.push_back({"case_motion", "rms_arcsec", motion.rms_arcsec, unknown});
    out.push_back(std::move(c));
}

}  // namespace

std::vector<SampleCandidate> screen_samples(const SampleFit& now, const SampleContext& in) {
    std::vector<SampleCandidate> out;
    screen_line(now, in, out);
    screen_witnesses(now, in, out);
    screen_resampling(now, in, out);
    screen_rates(now, in, out);
    screen_noises(now, in, out);
    return out;
}

}  // namespace ringlock::closure
