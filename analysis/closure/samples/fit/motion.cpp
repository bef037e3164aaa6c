#include "analysis/closure/samples/fit/motion.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/repeats_and_witness.hpp"

namespace ringlock::closure {

std::vector<std::vector<double>> motion_columns(const std::vector<double>& witness) {
    const std::size_t n = witness.size();
    std::vector<std::vector<double>> columns(2, std::vector<double>(n, 0.0));
    for (std::size_t i = 1; i + 1 < n; ++i) {
        columns[0][i] = 0.5 * (witness[i + 1] - witness[i - 1]);
        columns[1][i] = witness[i + 1] - 2.0 * witness[i] + witness[i - 1];
    }
    return columns;
}

bool is_motion(const effects::Effect* effect) { return effect != nullptr && on_samples(*effect) == OnSamples::motion; }

void add_motion(SampleModel& model, const SampleSeries& series, const effects::Effect& effect, std::size_t witness,
                int step) {
    auto columns = motion_columns(series.witnesses[witness].second);
    for (std::size_t c = 0; c < 2; ++c) {
        model.columns.push_back({&effect, c == 0 ? "in_phase" : "quadrature",
                                 std::make_shared<const std::vector<double>>(std::move(columns[c]))});
        model.columns.back().step = step;
    }
}

SampleModel without_motion(SampleModel model) {
    std::erase_if(model.columns, [](const SampleColumn& c) { return is_motion(c.effect); });
    model.motion.clear();
    model.motion_from_hz = 0.0;
    for (std::size_t k = model.resonances.size(); k-- > 0;) {
        if (!is_motion(model.resonances[k].effect)) continue;
        const auto at = static_cast<std::ptrdiff_t>(k);
        model.resonances.erase(model.resonances.begin() + at);
        model.noise.resonances.erase(model.noise.resonances.begin() + at);
    }
    return model;
}

namespace {

/// Where the second resonance starts, for the part of a motion that the witness does not predict: about the motion,
/// since the witness's own noise hides its edges, or at half the rate of the record, where a mean over intervals has no
/// power.
enum class ResonanceStart { about_the_motion, at_half_the_rate };

/// The noise with two resonances for the unpredicted part of a motion, the most likely of many starts: no mean over
/// frequencies shows their widths, and the likelihood has several maxima.
SampleNoise begun_with(const SampleFit& now, const std::vector<double>& predicted, double rms_arcsec, double hz,
                       ResonanceStart where) {
    const SampleSeries& series = now.series();
    std::vector<double> rest = now.as_taken(predicted);
    for (std::size_t i = 0; i < rest.size(); ++i) rest[i] = now.rest()[i] - rest[i];
    // The noise of the model so far contains most of the motion. Second differences of the increments are mostly white
    // angle.
    double squares = 0.0;
    for (std::size_t i = 2; i < rest.size(); ++i) squares += std::pow(rest[i] - 2.0 * rest[i - 1] + rest[i - 2], 2);
    const double angle = std::sqrt(squares / 20.0 / static_cast<double>(rest.size()));
    constexpr double of_rate = 0.1;
    std::vector<SampleNoise> trials;
    for (const double wide : {0.5, 0.15, 0.05}) {
        for (const double wider : {0.15, 0.5}) {
            for (const double share : {0.03, 0.1, 0.3}) {
                for (const double white : {0.3, 0.6, 1.0}) {
                    SampleNoise noise = now.model().noise;
                    noise.angle_arcsec = white * angle;
                    noise.rate_arcsec_rt_s = of_rate * noise.angle_arcsec / std::sqrt(series.interval_s);
                    const double width_hz = std::max(wide * hz, 0.01);
                    noise.resonances.push_back({rms_arcsec, hz, width_hz});
                    if (where == ResonanceStart::at_half_the_rate) {
                        noise.resonances.push_back({share * rms_arcsec, 0.45 * series.rate_hz, wider * series.rate_hz});
                    } else {
                        noise.resonances.push_back({share * rms_arcsec, hz, 20.0 * wider * width_hz});
                    }
                    trials.push_back(std::move(noise));
                }
            }
        }
    }
    const auto likelier = [](double a, double b) { return a < b || (std::isnan(b) && !std::isnan(a)); };
    const auto values = SampleFilter::minus_log_likelihoods(trials, series.interval_s, rest, now.rows());
    return trials[static_cast<std::size_t>(std::min_element(values.begin(), values.end(), likelier) - values.begin())];
}

}  // namespace

SampleModel moved_as(const SampleFit& now, const effects::Effect& effect, std::size_t witness, int step) {
    const auto& watched = now.series().witnesses[witness].second;
    const WitnessMotion motion = fit_witness(now, watched);
    SampleModel model = now.model();
    model.motion = motion.increments;
    model.motion_from_hz = options.samples.fit.slowest_of_motion * motion.centre_hz;
    // The unpredicted part moves like the predicted one; the witness's own noise hides its edges, which are wider.
    const double incoherent = motion.rms_arcsec * std::sqrt(std::max(1.0 - motion.coherence, 1e-3));
    const double centre_hz = std::max(motion.centre_hz, 0.01);
    model.resonances.insert(model.resonances.end(), 2, {&effect, step});
    std::optional<SampleFit> first;
    for (const ResonanceStart where : {ResonanceStart::about_the_motion, ResonanceStart::at_half_the_rate}) {
        SampleModel trial = model;
        trial.noise = begun_with(now, motion.increments, incoherent, centre_hz, where);
        SampleFit fit(now.series(), std::move(trial), now.rows());
        // A narrow resonance elsewhere is a line and no part of the motion.
        const bool line = where == ResonanceStart::at_half_the_rate &&
                          fit.model().noise.resonances.back().width_hz <
                              options.samples.fit.narrowest_at_half_rate * now.series().rate_hz;
        if (!first || (!line && fit.log_likelihood() > first->log_likelihood())) first.emplace(std::move(fit));
    }
    // Estimates the response once more, with the residual as the noise.
    model = first->model();
    const WitnessMotion more = fit_witness(*first, watched);
    for (std::size_t i = 0; i < model.motion.size(); ++i) model.motion[i] += more.increments[i];
    return model;
}

}  // namespace ringlock::closure
