#include "analysis/noise/fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "analysis/noise/claims.hpp"
#include "analysis/noise/decomposition.hpp"
#include "analysis/noise/model/rounding.hpp"
#include "engine/core/error.hpp"

namespace ringlock::noise {
namespace {

std::vector<double> increments(std::span<const double> angle, double& largest) {
    std::vector<double> y(angle.size() > 0 ? angle.size() - 1 : 0);
    largest = angle.empty() ? 0.0 : std::abs(angle[0]);
    for (std::size_t i = 0; i < y.size(); ++i) {
        y[i] = angle[i + 1] - angle[i];
        largest = std::max(largest, std::abs(angle[i + 1]));
    }
    return y;
}

}  // namespace

NoiseFit fit_noise(std::span<const double> angle_arcsec, double tau0_s, const Options& options) {
    if (!(tau0_s > 0.0) || !std::isfinite(tau0_s)) {
        throw InputError(fmt::format("sampling interval {} s: must be a positive number", tau0_s));
    }
    for (std::size_t i = 0; i < angle_arcsec.size(); ++i) {
        if (!std::isfinite(angle_arcsec[i])) {
            throw InputError(fmt::format("angle {} of the record is {}: must be finite", i + 1, angle_arcsec[i]));
        }
    }
    NoiseFit out;
    double largest = 0.0;
    std::vector<double> rate = increments(angle_arcsec, largest);
    if (rate.size() < std::max<std::size_t>(8, options.fewest_samples)) {
        out.samples = rate.size();
        out.reason = fmt::format("{} increments: at least {} are needed", rate.size(), options.fewest_samples);
        return out;
    }
    for (double& r : rate) r /= tau0_s;
    const Spectrum spectrum = cosine_spectrum(rate);
    out.samples = spectrum.samples;
    if (only_rounding(spectrum, largest / tau0_s)) {
        out.reason = "the record shows no noise above the rounding of its numbers";
        return out;
    }

    const Decomposition parts = decompose(spectrum, options.significance);
    if (!parts.lines.empty() && only_rounding(parts.noise, largest / tau0_s)) {
        out.reason = "the record shows no noise above the rounding of its numbers beside spectral lines";
        return out;
    }
    const Likelihood likelihood(parts.noise);
    const Claims claims(likelihood, parts, options);
    claims.describe(tau0_s, out);
    out.goodness = goodness_of_fit(parts.noise, claims.estimate(), parts.lines, tau0_s, options.misfit_threshold);
    out.described = out.goodness.accepted;
    out.reason = out.goodness.reason;
    return out;
}

}  // namespace ringlock::noise
