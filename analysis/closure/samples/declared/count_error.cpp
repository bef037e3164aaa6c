#include "analysis/closure/samples/declared/count_error.hpp"

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/repeats_and_witness.hpp"
#include "analysis/closure/samples/fit/swing.hpp"
#include "analysis/closure/samples/model/source.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// The declared properties of the error and its frequency under the mean rate; no value where there is no such error.
std::optional<SampleNoise::CountError> declared_error(const SampleSeries& series, const record::Record& record) {
    const double k_arcsec = record.declared.scale_factor_arcsec.value_or(0.0);
    const double dither_hz = record.declared.dither_frequency_hz.value_or(0.0);
    if (!series.cycle_counts || !(k_arcsec > 0.0) || !(dither_hz > 0.0)) return std::nullopt;
    double angle_arcsec = 0.0;
    for (const double increment : series.increment) angle_arcsec += increment;
    const double duration_s = series.interval_s * static_cast<double>(series.size());
    SampleNoise::CountError error;
    error.step_arcsec = 0.25 * k_arcsec;
    error.hz = std::abs(angle_arcsec) / duration_s / error.step_arcsec;
    error.latch_hz = dither_hz;
    // Noise of the measured dither moves its zero crossings, and the dither turns the angle in the meantime.
    error.jitter_arcsec = record.reader->settings.reference_noise_arcsec;
    if (error.hz * duration_s < options.samples.count_error.fewest_steps) return std::nullopt;
    return error;
}

std::shared_ptr<SampleFit> fitted_with(const SampleFit& fit, const SampleNoise::CountError& error) {
    check_interrupt();
    SampleModel model = fit.model();
    model.noise.count_error = error;
    return std::make_shared<SampleFit>(fit.series(), std::move(model), fit.rows(), SampleFit::Noise::near);
}

}  // namespace

std::shared_ptr<SampleFit> with_count_error(const SampleFit& fit, const record::Record& record) {
    auto error = declared_error(fit.series(), record);
    if (!error) return nullptr;
    const SampleCountErrorOptions& by = options.samples.count_error;
    std::shared_ptr<SampleFit> best;
    error->harmonics = 1;
    for (const double width_hz : by.first_widths_hz) {
        error->width_hz = width_hz;
        auto with = fitted_with(fit, *error);
        if (!best || with->log_likelihood() > best->log_likelihood()) best = std::move(with);
    }
    while (error->harmonics < by.most_harmonics) {
        ++error->harmonics;
        error->width_hz = best->model().noise.count_error.width_hz;
        auto with = fitted_with(*best, *error);
        if (!(with->gain_over(*best) > by.least_gain_of_harmonic)) break;
        best = std::move(with);
    }
    return best->gain_over(fit) > by.least_gain ? best : nullptr;
}

std::shared_ptr<SampleFit> with_late_crossings(const SampleFit& fit, const record::Record& record) {
    if (!fit.series().whole_cycles || !record.declared.dither_frequency_hz) return nullptr;
    const double peak_arcsec_s = record.declared.dither_peak_rate_deg_s.value_or(0.0) * units::arcsec_per_deg;
    const double late_arcsec = record.reader->settings.reference_delay_s * peak_arcsec_s;
    if (!(late_arcsec > 0.0)) return nullptr;
    const SampleTurnOptions& by = options.samples.turns;
    std::shared_ptr<SampleFit> best;
    for (const double width : by.sideband_widths) {
        check_interrupt();
        SampleModel model = fit.model();
        model.noise.sidebands = {by.late_first_rms * late_arcsec, 0.0, width * *record.declared.dither_frequency_hz};
        auto with = std::make_shared<SampleFit>(fit.series(), std::move(model), fit.rows(), SampleFit::Noise::near);
        // A noise larger than the amplitude itself could make is no noise of the dither.
        if (with->model().noise.sidebands.arcsec > by.late_most_rms * late_arcsec) continue;
        if (!best || with->log_likelihood() > best->log_likelihood()) best = std::move(with);
    }
    // A short record hardly distinguishes it from random walk, which is then uncertain: a small gain is enough.
    return best && best->gain_over(fit) > by.late_least_gain ? best : nullptr;
}

std::shared_ptr<SampleFit> with_interpolated_errors(const SampleFit& fit, const record::Record& record) {
    const double dither_hz = record.declared.dither_frequency_hz.value_or(0.0);
    if (!fit.series().whole_cycles || !(dither_hz > 0.0) || fit.model().noise.from_hz > 0.0) return nullptr;
    const double rate_hz = fit.series().rate_hz;
    // The declared frequency, and the one near it that the squares show, since a dither drifts.
    std::vector<double> all_hz{alias(dither_hz, rate_hz).hz};
    const FoundCycle cycle = find_cycle(fit.innovations(), fit.informative(), rate_hz);
    const double resolution_hz = rate_hz / static_cast<double>(fit.series().size());
    const double tolerance_hz = options.samples.declared_dither_error * dither_hz + resolution_hz;
    if (cycle.p_value < options.samples.turns.seen_p && std::abs(cycle.frequency_hz - all_hz.front()) < tolerance_hz) {
        all_hz.push_back(cycle.frequency_hz);
    }
    std::shared_ptr<SampleFit> best;
    for (const double hz : all_hz) {
        const Swing seen = swing_of_variance(fit, hz);
        if (!(seen.gain > options.samples.turns.least_gain)) continue;
        auto with = std::make_shared<SampleFit>(with_swinging_errors(fit, hz, seen));
        if (!best || with->log_likelihood() > best->log_likelihood()) best = std::move(with);
    }
    return best && best->gain_over(fit) > options.samples.turns.least_gain ? best : nullptr;
}

}  // namespace ringlock::closure
