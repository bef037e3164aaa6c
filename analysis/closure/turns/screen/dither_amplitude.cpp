#include "analysis/closure/turns/screen/dither_amplitude.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <unsupported/Eigen/FFT>
#include <vector>

#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/stats/whiteness.hpp"

namespace ringlock::closure {

namespace {

/// Highest peaks of the spectrum of the innovations, with the sign changed at minima, up to the band's end [Hz].
std::vector<double> highest_peaks(const TurnFit& fit, double band_hz) {
    constexpr std::size_t most = options.turns.dither_amplitude.peaks;
    constexpr std::size_t finer = 4;  // resolution in Fourier frequencies
    const TurnSeries& series = fit.model().series();
    const std::size_t n = series.size();
    std::size_t padded = 1;
    while (padded < finer * n) padded *= 2;
    std::vector<double> in(padded, 0.0);
    for (std::size_t i = 0; i < n; ++i) in[i] = fit.rows()[i] ? -series.direction[i] * fit.innovations()[i] : 0.0;
    std::vector<std::complex<double>> out;
    Eigen::FFT<double> fft;
    fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
    fft.fwd(out, in);
    const double bin_hz = 1.0 / (static_cast<double>(padded) * series.interval_s);
    // The polynomials of the amplitude follow half a period.
    const auto first = static_cast<std::size_t>(0.5 * static_cast<double>(padded) / static_cast<double>(n)) + 1;
    const auto end = std::min(static_cast<std::size_t>(band_hz / bin_hz), padded / 2 - 1);
    std::vector<std::size_t> bins;
    for (std::size_t k = first; k < end; ++k) {
        if (std::norm(out[k]) >= std::norm(out[k - 1]) && std::norm(out[k]) > std::norm(out[k + 1])) bins.push_back(k);
    }
    std::sort(bins.begin(), bins.end(),
              [&](std::size_t a, std::size_t b) { return std::norm(out[a]) > std::norm(out[b]); });
    if (bins.size() > most) bins.resize(most);
    std::vector<double> peaks_hz;
    for (const std::size_t k : bins) {
        for (const double off : {-0.5, 0.0, 0.5}) peaks_hz.push_back((static_cast<double>(k) + off) * bin_hz);
    }
    return peaks_hz;
}

}  // namespace

std::optional<AmplitudeModel> find_amplitude_swing(const TurnProblem& problem, const Fitted& now) {
    const TurnOptions::DitherAmplitude& of = options.turns.dither_amplitude;
    const TurnFit& fit = *now.fit;
    const TurnSeries& series = now.series();
    TurnParameters with = fit.parameters();
    if (with.swings.size() >= of.most_swings) return std::nullopt;
    const double band_hz = series.amplitude_band_hz();
    AmplitudeSwing swing{};
    double chi2 = 0.0;
    for (const double hz : highest_peaks(fit, band_hz)) {
        auto by = amplitude_by({hz, 0.0, 0.0}, series);
        const auto score = fit.score({std::move(by[0]), std::move(by[1])});
        if (score.rank < 2 || score.chi2 <= chi2) continue;
        chi2 = score.chi2;
        swing = {hz, score.value(0), score.value(1)};
    }
    const double trials = std::max(1.0, of.trials_per_bin * 2.0 * band_hz * series.time_s.back());
    if (!passes(of_several(chi2_tail(chi2, 2), trials))) return std::nullopt;
    with.swings.push_back(swing);
    AmplitudeModel found;
    found.fitted = problem.fit_or_none(with);
    if (!found.fitted) return std::nullopt;
    const double gain = found.fitted->fit->log_likelihood() - fit.log_likelihood();
    if (!passes(of_several(chi2_tail(2.0 * gain, 2), trials))) return std::nullopt;
    found.evidence = gain - cost_of_amplitudes(gain, 2) - std::log(trials) - of.cost_of_frequency;
    return found;
}

std::optional<AmplitudeModel> find_amplitude_memory(const TurnProblem& problem, const Fitted& now) {
    const TurnOptions::DitherAmplitude& of = options.turns.dither_amplitude;
    const TurnFit& fit = *now.fit;
    if (fit.parameters().wander_forgets > 0.0) return std::nullopt;
    if (correlations_of(fit.innovations(), problem.rows()).test(Where::amplitude, "").p_value > of.memory_worth_fitting)
        return std::nullopt;
    AmplitudeModel found;
    for (const double forgets : of.forgets) {
        TurnParameters with = fit.parameters();
        with.wander_forgets = forgets;
        // A part of the white noise may also belong to the wander that decays.
        with.wander_sd_rad =
            std::max(with.wander_sd_rad, of.share_of_injected * std::sqrt(forgets) * with.injected_sd_rad);
        auto fitted = problem.fit_or_none(with);
        const double best = found.fitted ? found.fitted->log_likelihood() : fit.log_likelihood();
        if (fitted && fitted->log_likelihood() > best) found.fitted = std::move(fitted);
    }
    if (!found.fitted) return std::nullopt;
    const double gain = found.fitted->fit->log_likelihood() - fit.log_likelihood();
    if (!passes(chi2_tail(2.0 * gain, 1))) return std::nullopt;
    found.evidence = gain - cost_of_amplitudes(gain, 1);
    return found;
}

std::vector<std::string> notes_on_amplitude(const Fitted& fitted) {
    const TurnSeries& series = fitted.series();
    std::vector<std::string> notes;
    for (const AmplitudeSwing& swing : fitted.fit->parameters().swings) {
        notes.push_back(fmt::format(
            "the dither's amplitude has a relative modulation of {:.2g} at {:.4g} Hz, which the model follows; "
            "a vibration of the base at {:.6g} Hz would look the same; closed.toml does not contain it",
            std::hypot(swing.cosine_rad, swing.sine_rad) / series.amplitude_rad, std::abs(swing.hz),
            0.5 / series.interval_s - std::abs(swing.hz)));
    }
    if (fitted.fit->parameters().wander_forgets > 0.0) {
        notes.push_back(
            fmt::format("the wander of the dither's amplitude decays within {:.3g} s, "
                        "as in a resonator that noise drives; closed.toml has a random walk of the same steps instead",
                        series.interval_s / fitted.fit->parameters().wander_forgets));
    }
    return notes;
}

}  // namespace ringlock::closure
