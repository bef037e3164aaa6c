#include "analysis/closure/samples/screen/known.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/fit/steps.hpp"
#include "analysis/closure/samples/screen/screen.hpp"

namespace ringlock::closure {

using effects::Role;

namespace {

/// The line's frequency in the middle of the record and its derivatives; free up to the last that is not zero.
FrequencyTrack track_of(const ActiveEffect& active) {
    const auto parameters = parameters_of(*active.effect, Role::frequency);
    FrequencyTrack track = FrequencyTrack::still(value_of(active.values, *parameters[0]));
    for (std::size_t k = 1; k < std::min(parameters.size(), FrequencyTrack::most); ++k) {
        track.coefficient(k) = value_of(active.values, *parameters[k]);
        if (track.coefficient(k) != 0.0) track.free = k + 1;
    }
    return track;
}

}  // namespace

KnownEffects known_effects(const SampleFit& base, const std::vector<ActiveEffect>& effects) {
    const SampleSeries& series = base.series();
    KnownEffects known{base.model(), {}, SampleFit::Noise::near};
    SampleModel& model = known.model;
    double from_hz = 0.0;
    for (const ActiveEffect& active : effects) {
        if (on_samples(*active.effect) != OnSamples::transport) continue;
        from_hz = value_of(active.values, parameter_of(*active.effect, Role::sampled));
    }
    if (from_hz > 0.0) model = resampled_from(base, from_hz);
    for (const ActiveEffect& active : effects) {
        const effects::Effect& effect = *active.effect;
        AddedEffect added(effect, static_cast<int>(known.added.size()));
        switch (on_samples(effect)) {
            case OnSamples::rate_line:
            case OnSamples::angle_line: {
                const FrequencyTrack track = track_of(active);
                const Alias shown = alias(track.hz, from_hz > 0.0 ? from_hz : series.rate_hz);
                add_line(model, series, track.shown_at(shown.hz, shown.folded), effect, added.id);
                break;
            }
            case OnSamples::motion: {
                const std::string name = std::string("accel_") + "xyz"[std::lround(active.values.at("witness"))];
                for (std::size_t w = 0; w < series.witnesses.size(); ++w) {
                    if (series.witnesses[w].first == name) added.witness = w;
                }
                break;
            }
            case OnSamples::transport:
                known.noise = SampleFit::Noise::free;
                break;
            case OnSamples::walk:
                model.walk = true;
                // 1 deg/h is 1 arcsec/s.
                model.noise.walk_arcsec2_s3 = effect.rate_noise(active.values).walk_deg2_h2_per_s;
                break;
            case OnSamples::flicker: {
                const double duration_s = static_cast<double>(series.size()) * series.interval_s;
                model.flicker = true;
                model.flicker_deg_h = value_of(active.values, parameter_of(effect, Role::deviation));
                model.noise.terms = flicker_terms(model.flicker_deg_h, 4.0 * series.interval_s, duration_s);
                break;
            }
            case OnSamples::step: {
                const double time_s = value_of(active.values, parameter_of(effect, Role::time));
                const double rows = (time_s - series.time_s[0] + series.interval_s) * series.rate_hz;
                const double last = static_cast<double>(series.size() - 2);
                const auto row = static_cast<std::size_t>(std::clamp(rows, 1.0, last));
                model.columns.push_back(step_column(effect, series, row));
                model.columns.back().step = added.id;
                break;
            }
            case OnSamples::rate:
                for (SampleColumn& column : rate_columns(series)) {
                    if (column.effect != &effect) continue;
                    column.step = added.id;
                    model.columns.push_back(std::move(column));
                }
                break;
            case OnSamples::resolution:
            case OnSamples::white:
            case OnSamples::other:
            case OnSamples::nothing:
                break;
        }
        known.added.push_back(std::move(added));
    }
    return known;
}

}  // namespace ringlock::closure
