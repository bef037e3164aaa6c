#include "analysis/closure/turns/fit/fitted.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/error.hpp"

namespace ringlock::closure {

namespace {

/// The noise of the dither at the turns by how neighbouring swings of one sign differ, which have four of its values in
/// them [rad].
double injected_by_swings(const TurnSeries& series) {
    double squares = 0.0;
    for (std::size_t i = 0; i + 3 < series.size(); ++i) squares += std::pow(series.swing[i + 2] - series.swing[i], 2);
    return series.amplitude_rad * std::sqrt(squares / static_cast<double>(series.size()));
}

/// About the phases that the first fit tells (the iterated Kalman smoother: Bell, SIAM Journal on Optimization 4, 1994,
/// 626). One pass is enough: another moves them by what is not linear in what the first was wrong by.
void linearise_again(Fitted& fitted, const Rows& rows, TurnFit::Effects effects) {
    ReadingErrors known = fitted.fit->reading_errors();
    if (known.mean_rad.empty()) return;
    auto model = std::make_unique<TurnModel>(fitted.series, fitted.joined.phase_rad, std::move(known));
    fitted.fit = std::make_unique<TurnFit>(*model, fitted.fit->parameters(), rows, effects);
    fitted.model = std::move(model);
}

}  // namespace

std::shared_ptr<Fitted> fit_record(const record::Record& record, const TurnParameters& start, const Rows& rows,
                                   TurnFit::Effects effects, double needed) {
    auto fitted = std::make_shared<Fitted>();
    gyro::Setup setup;
    bool count_again = false;
    for (const ActiveEffect& active : start.effects) {
        if (active.effect->name() == "readout_ellipse") active.effect->configure(active.values, setup);
        if (active.effect->name() == "missed_counts") count_again = true;
    }
    fitted->joined = join(*record.turns, setup.ellipse, count_again);
    fitted->series = prepare(record, fitted->joined);
    fitted->model = std::make_unique<TurnModel>(fitted->series, fitted->joined.phase_rad);
    TurnParameters parameters = start;
    const bool from_nothing = parameters.readout_sd_rad == 0.0;
    if (from_nothing) {
        parameters.readout_sd_rad = std::max(fitted->joined.readout_sd_rad, 1e-6);
        parameters.threshold_deg_h = fitted->series.setup.lockin_threshold_deg_h;
    }
    fitted->fit = std::make_unique<TurnFit>(*fitted->model, parameters, rows, effects, needed);
    if (from_nothing) {
        // Where noise is injected the swings say how much: a fit that is not told may end beside a summit.
        parameters.injected_sd_rad = injected_by_swings(fitted->series);
        if (parameters.injected_sd_rad > parameters.readout_sd_rad) {
            auto other = std::make_unique<TurnFit>(*fitted->model, parameters, rows, effects);
            if (other->log_likelihood() > fitted->fit->log_likelihood()) fitted->fit = std::move(other);
        }
    }
    if (fitted->fit->log_likelihood() > needed) linearise_again(*fitted, rows, effects);
    return fitted;
}

std::shared_ptr<Fitted> fit_or_none(const record::Record& record, const TurnParameters& start, const Rows& rows,
                                    double needed) {
    try {
        return fit_record(record, start, rows, TurnFit::Effects::fitted, needed);
    } catch (const RunError&) {
        return nullptr;
    }
}

}  // namespace ringlock::closure
