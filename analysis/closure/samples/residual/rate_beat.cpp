#include "analysis/closure/samples/residual/rate_beat.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/declared/declared_reader.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

std::optional<RateBeat> find_rate_beat(const SampleFit& fit, const record::Declared& declared) {
    const double k_arcsec = declared.scale_factor_arcsec.value_or(0.0);
    const double dither_hz = declared.dither_frequency_hz.value_or(0.0);
    if (!(k_arcsec > 0.0) || !(dither_hz > 0.0)) return std::nullopt;
    const SampleSeries& series = fit.series();
    double angle_arcsec = 0.0;
    for (const double increment : series.increment) angle_arcsec += increment;
    const double duration_s = series.interval_s * static_cast<double>(series.size());
    const double fringes_hz = angle_arcsec / duration_s / k_arcsec;
    const double steps_hz = std::nearbyint(fringes_hz / dither_hz) * dither_hz;
    RateBeat beat;
    beat.hz = std::abs(fringes_hz - steps_hz);
    const int multiples = options.samples.screen.beat_multiples;
    // A beat slower than a few cycles over the record is not distinguished as a line.
    if (beat.hz * duration_s < options.samples.screen.beat_cycles) return std::nullopt;
    for (int m = 1; m <= multiples; ++m) {
        std::complex<double> sum = 0.0;
        std::complex<double> increments = 0.0;
        double squares = 0.0;
        double rows = 0.0;
        double angle = 0.0;
        for (std::size_t i = 0; i < series.size(); ++i) {
            // In the middle of the row.
            const double fringes = (angle + 0.5 * series.increment[i]) / k_arcsec -
                                   steps_hz * series.interval_s * (static_cast<double>(i) + 0.5);
            angle += series.increment[i];
            if (!fit.informative()[i]) continue;
            const double turns = m * fringes;
            const auto wave = std::polar(1.0, -units::two_pi * (turns - std::floor(turns)));
            sum += fit.innovations()[i] * wave;
            increments += fit.innovations()[i] * fit.sd(i) * wave;
            squares += fit.innovations()[i] * fit.innovations()[i];
            rows += 1.0;
        }
        if (!(rows > 0.0) || !(squares > 0.0)) return std::nullopt;
        const double p = of_several(std::exp(-std::norm(sum) / squares), multiples);
        if (m == 1) beat.rate_deg_h = 2.0 * std::abs(increments) / rows * series.rate_hz;  // 1 arcsec/s is 1 deg/h
        beat.p_value = std::min(beat.p_value, p);
    }
    if (!(beat.p_value < options.level_of_residual)) return std::nullopt;
    const double peak_arcsec_s = declared.dither_peak_rate_deg_s.value_or(0.0) * units::arcsec_per_deg;
    const double amplitude_rad = peak_arcsec_s / (k_arcsec * dither_hz);
    if (amplitude_rad > 0.0) {
        beat.most_deg_h = declared.lockin_threshold_deg_h.value_or(0.0) * std::sqrt(2.0 / (units::pi * amplitude_rad));
    }
    return beat;
}

bool may_be_of_beat(const Step& step, const RateBeat& beat) {
    if (on_samples(*step.effect) == OnSamples::transport) return true;
    const auto arcsec = line_arcsec(step);
    if (!arcsec) return false;
    // 1 arcsec/s is 1 deg/h
    const double rate_deg_h = units::two_pi * value_of(step, effects::Role::frequency) * *arcsec;
    return beat.most_deg_h == 0.0 || rate_deg_h < options.samples.screen.beyond_beat * beat.most_deg_h;
}

std::string text_of(const RateBeat& beat) {
    std::string text = fmt::format(
        "the residual has lines at the beat of the input rate with the dither, {:.6g} Hz, "
        "and at its multiples ({:.3g} deg/h at the first)",
        beat.hz, beat.rate_deg_h);
    if (beat.most_deg_h > 0.0) {
        text +=
            fmt::format(", as lock-in that no noise randomises makes them: up to {:.3g} deg/h in the declared device",
                        beat.most_deg_h);
    } else {
        text += ", as lock-in that no noise randomises makes them";
    }
    return text;
}

}  // namespace ringlock::closure
