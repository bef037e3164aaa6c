#include "analysis/closure/samples/screen/known.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/fit/steps.hpp"
#include "analysis/closure/samples/screen/screen.hpp"

namespace ringlock::closure {

KnownEffects known_effects(const SampleFit& base, const std::vector<ActiveEffect>& effects) {
    const SampleSeries& series = base.series();
    KnownEffects known{base.model(), {}, SampleFit::Noise::near};
    SampleModel& model = known.model;
    double from_hz = 0.0;
    for (const ActiveEffect& active : effects) {
        if (active.effect->name() == "resampling") from_hz = active.values.at("from_hz");
    }
    if (from_hz > 0.0) model = resampled_from(base, from_hz);
    for (const ActiveEffect& active : effects) {
        SampleStep told{std::string(active.effect->name()), static_cast<int>(known.told.size())};
        if (is_line(told.effect)) {
            const Alias shown = alias(active.values.at("frequency_hz"), from_hz > 0.0 ? from_hz : series.rate_hz);
            LineCourse course = LineCourse::still(active.values.at("frequency_hz"));
            for (std::size_t k = 1; told.effect == "dither_residue" && k < LineCourse::most; ++k) {
                course.coefficient(k) = active.values.at(drift_names[k - 1]);
                if (course.coefficient(k) != 0.0) course.free = k + 1;
            }
            add_line(model, series, course.shown_at(shown.hz, shown.folded), told.effect, told.step);
        } else if (told.effect == "case_motion") {
            const std::string name = std::string("accel_") + "xyz"[std::lround(active.values.at("witness"))];
            for (std::size_t w = 0; w < series.witnesses.size(); ++w) {
                if (series.witnesses[w].first == name) told.witness = w;
            }
        } else if (told.effect == "resampling") {
            known.noise = SampleFit::Noise::free;
        } else if (told.effect == "rate_random_walk") {
            model.walk = true;
            model.noise.walk_arcsec2_s3 = std::pow(active.values.at("deg_h_rt_h") / 60.0, 2);
        } else if (told.effect == "bias_instability") {
            const double duration_s = static_cast<double>(series.size()) * series.interval_s;
            model.flicker = true;
            model.flicker_deg_h = active.values.at("deg_h");
            model.noise.terms = flicker_terms(model.flicker_deg_h, 4.0 * series.interval_s, duration_s);
        } else if (told.effect == "bias_step") {
            const double rows = (active.values.at("time_s") - series.time_s[0] + series.interval_s) * series.rate_hz;
            const double last = static_cast<double>(series.size() - 2);
            model.columns.push_back(step_column(series, static_cast<std::size_t>(std::clamp(rows, 1.0, last))));
            model.columns.back().step = told.step;
        } else {
            for (SampleColumn& column : rate_columns(series)) {
                if (column.effect != told.effect) continue;
                column.step = told.step;
                model.columns.push_back(std::move(column));
            }
        }
        known.told.push_back(std::move(told));
    }
    return known;
}

}  // namespace ringlock::closure
