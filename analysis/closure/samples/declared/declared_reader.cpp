#include "analysis/closure/samples/declared/declared_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/options.hpp"
#include "engine/core/units.hpp"
#include "engine/reader/stripper.hpp"

namespace ringlock::closure {

namespace {

using reader::Stripping;

bool filters(const record::Record& record) {
    return record.reader && record.declared.dither_frequency_hz && record.reader->settings.latch_hz > 0.0 &&
           (record.reader->settings.stripping == Stripping::fir ||
            record.reader->settings.stripping == Stripping::reference_fir);
}

/// Order of the low-pass filter.
std::size_t order_of(const record::Record& record) {
    const reader::Settings& settings = record.reader->settings;
    return static_cast<std::size_t>(2.0 * settings.latch_hz * record.reader->delay_s + 0.5);
}

double alias_of(double hz, double rate_hz) { return std::abs(std::remainder(hz, rate_hz)); }

double dither_arcsec(const record::Declared& declared) {
    return declared.dither_peak_rate_deg_s.value_or(0.0) * units::arcsec_per_deg /
           (units::two_pi * *declared.dither_frequency_hz);
}

/// Largest amplitude of a line at the dither that the lock-in makes itself: the second order of half a turn, which
/// alternates with the half cycles, is below the square of a kick.
double lockin_line_arcsec(const record::Declared& declared) {
    const double k = declared.scale_factor_arcsec.value_or(0.0);
    const double peak_arcsec_s = declared.dither_peak_rate_deg_s.value_or(0.0) * units::arcsec_per_deg;
    if (!(k > 0.0) || !(peak_arcsec_s > 0.0)) return 0.0;
    const double w = units::two_pi * *declared.dither_frequency_hz;
    const double kick2 =
        std::pow(units::two_pi * declared.lockin_threshold_deg_h.value_or(0.0), 2) / (k * peak_arcsec_s * w);
    return kick2 * k / units::two_pi;
}

/// Half cycles of unequal strength or length make harmonics of the dither, which a reader without stripping leaves in
/// the samples.
template <class IsAt>
bool is_harmonic_of_dither(const Step& step, const record::Record& record, const IsAt& is_at, std::string& why) {
    const auto arcsec = line_arcsec(step);
    if (!arcsec) return false;
    const double hz = value_of(step, effects::Role::frequency);
    const SampleReaderOptions& by = options.samples.reader;
    const double dither_hz = *record.declared.dither_frequency_hz;
    for (int k = 2; k <= by.harmonics; ++k) {
        if (!is_at(hz, k * dither_hz) || *arcsec > by.most_harmonic * dither_arcsec(record.declared)) continue;
        why = fmt::format(
            "a line of {:.3g} arcsec at {:.6g} Hz is harmonic {} of the dither, "
            "which the declared reader leaves in the samples",
            *arcsec, hz, k);
        return true;
    }
    return false;
}

}  // namespace

bool leaves_dither_noise(const record::Record& record) {
    return record.reader && record.declared.dither_frequency_hz &&
           (record.reader->settings.stripping == Stripping::none ||
            record.reader->settings.stripping == Stripping::notch);
}

record::Record summed_for_reader(const record::Record& record, std::string& note) {
    const bool filtered = filters(record);
    if ((!filtered && !leaves_dither_noise(record)) || !record.samples ||
        record.samples->kind != record::SampleKind::angle_increment_arcsec) {
        return record;
    }
    const record::Samples& samples = *record.samples;
    const double length_s =
        filtered ? 2.0 * record.reader->delay_s + 1.0 / record.reader->settings.latch_hz
                 : options.samples.reader.least_turns_a_row / (2.0 * *record.declared.dither_frequency_hz);
    const auto rows_at_most = static_cast<double>(samples.size());
    if (length_s * samples.rate_hz > rows_at_most) return record;
    const auto each = static_cast<std::size_t>(std::ceil(length_s * samples.rate_hz - 1e-9));
    if (each <= 1 || samples.size() / each < record::fewest_samples_to_close) return record;
    record::Record summed = record;
    record::Samples& to = *summed.samples;
    const std::size_t rows = samples.size() / each;
    to.rate_hz = samples.rate_hz / static_cast<double>(each);
    to.t0_s = samples.t0_s + static_cast<double>(each - 1) / samples.rate_hz;
    const auto sums = [&](const std::vector<double>& values, double weight) {
        std::vector<double> out(rows, 0.0);
        for (std::size_t i = 0; i < rows * each; ++i) out[i / each] += weight * values[i];
        return out;
    };
    to.values = sums(samples.values, 1.0);
    for (auto& [name, values] : to.witnesses) values = sums(values, 1.0 / static_cast<double>(each));
    note = fmt::format("samples are summed by {} to {:.6g} Hz: {}", each, to.rate_hz,
                       filtered ? "the declared low-pass filter passes nothing faster"
                                : "the declared reader leaves the noise of the dither, "
                                  "which readings in one half cycle have in common");
    return summed;
}

std::shared_ptr<const KickRows> filtered_rows(const record::Record& record) {
    if (!filters(record)) return nullptr;
    const reader::Settings& settings = record.reader->settings;
    const double tick_s = 1.0 / settings.latch_hz;
    const double interval_s = 1.0 / record.samples->rate_hz;
    const double length_s = 2.0 * record.reader->delay_s + tick_s;
    // A filter that is longer than a row is not modelled; a damaged file may declare one of any length.
    if (length_s > interval_s * (1.0 + 1e-9)) return nullptr;
    reader::Settings own = settings;
    own.stripping = Stripping::fir;
    own.fir_order = static_cast<std::int64_t>(order_of(record));
    // The response to a step, tick by tick.
    const auto filter = reader::make_stripper(own, settings.latch_hz, *record.declared.dither_frequency_hz);
    const std::size_t taps = order_of(record) + 1;
    double squares = 0.0;
    double left = 0.0;
    double both = 0.0;
    for (std::size_t i = 0; i < taps; ++i) {
        filter->take({0.0, 1.0, 0.0, 0.0});
        const double come = filter->angle_arcsec();
        squares += come * come * tick_s;
        left += (1.0 - come) * (1.0 - come) * tick_s;
        both += come * (1.0 - come) * tick_s;
    }
    const std::size_t rows = record.samples->size();
    KickRows divided;
    divided.variance.assign(rows, (interval_s - length_s + squares) / interval_s);
    divided.carried.assign(rows, left / interval_s);
    divided.covariance.assign(rows, both / interval_s);
    return std::make_shared<const KickRows>(std::move(divided));
}

double count_noise_arcsec(const record::Record& record) {
    if (!record.reader || record.reader->settings.fraction != reader::Fraction::none) return 0.0;
    const Stripping stripping = record.reader->settings.stripping;
    if (stripping != Stripping::none && stripping != Stripping::reference && stripping != Stripping::notch) return 0.0;
    return 0.25 * record.declared.scale_factor_arcsec.value_or(0.0) / std::sqrt(12.0);
}

bool accounted_by_reader(const Step& step, const record::Record& record, std::string& why) {
    if (!record.reader || !record.declared.dither_frequency_hz || !record.samples) return false;
    const double dither_hz = *record.declared.dither_frequency_hz;
    const double rate_hz = record.samples->rate_hz;
    const double resolution_hz = 4.0 * rate_hz / static_cast<double>(record.samples->size());
    const auto is_at = [&](double hz, double wanted_hz) {
        const double tolerance_hz = options.samples.declared_dither_error * wanted_hz + resolution_hz;
        return std::abs(alias_of(hz, rate_hz) - alias_of(wanted_hz, rate_hz)) < tolerance_hz;
    };
    const Stripping stripping = record.reader->settings.stripping;
    const OnSamples as = on_samples(*step.effect);
    if (as == OnSamples::transport) {
        const double from_hz = value_of(step, effects::Role::sampled);
        if (stripping != Stripping::whole_cycle || !is_at(from_hz, dither_hz)) return false;
        why = fmt::format(
            "the declared reader counts over whole cycles of the dither: the samples are interpolated from {:.6g} Hz",
            from_hz);
        return true;
    }
    if (leaves_dither_noise(record) && is_harmonic_of_dither(step, record, is_at, why)) return true;
    const auto amplitude_arcsec = line_arcsec(step);
    if (!amplitude_arcsec || stripping == Stripping::none) return false;
    const double hz = value_of(step, effects::Role::frequency);
    // The residue of a steady dither. While gain and delay of a reference are learnt, its noise leaves some dither too.
    double most =
        options.samples.reader.residue_margin * record.reader->residue_relative * dither_arcsec(record.declared) +
        lockin_line_arcsec(record.declared);
    if (record.reader->settings.reference_learning_s > 0.0) most += record.reader->settings.reference_noise_arcsec;
    for (int k = 1; k <= options.samples.reader.harmonics; ++k) {
        if (!is_at(hz, k * dither_hz) || *amplitude_arcsec > most) continue;
        why = fmt::format(
            "a line of {:.3g} arcsec at {:.6g} Hz is not larger than the dither "
            "that the declared reader leaves in the samples",
            *amplitude_arcsec, hz);
        return true;
    }
    return false;
}

double value_of(const Step& step, effects::Role role) {
    const effects::Parameter* parameter = effects::first_of(*step.effect, role);
    if (parameter == nullptr) return 0.0;
    const auto found = std::find_if(step.parameters.begin(), step.parameters.end(),
                                    [&](const Estimate& estimate) { return estimate.name == parameter->name; });
    return found != step.parameters.end() ? found->value : 0.0;
}

std::optional<double> line_arcsec(const Step& step) {
    const double hz = value_of(step, effects::Role::frequency);
    if (!(hz > 0.0)) return std::nullopt;
    switch (on_samples(*step.effect)) {
        case OnSamples::angle_line:
            return value_of(step, effects::Role::sampled);
        case OnSamples::rate_line:
            // As an angle, by the fitted frequency: 1 deg/h is 1 arcsec/s.
            return value_of(step, effects::Role::size) / (units::two_pi * hz);
        default:
            return std::nullopt;
    }
}

}  // namespace ringlock::closure
