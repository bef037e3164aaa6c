#include "analysis/noise/fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "analysis/noise/decomposition.hpp"
#include "analysis/noise/interval.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::noise {
namespace {

constexpr double one_sigma_below = 0.841344746068543;  // of a normal deviate below 1

/// From a variance of the model to the coefficient: sqrt(theta) times this.
double unit_factor(std::size_t term, double tau0_s) {
    switch (term) {
        case quantisation:
            return tau0_s;
        case angle_random_walk:
            return std::sqrt(tau0_s) * units::deg_rt_h_per_arcsec_rt_s;
        case rate_random_walk:
            return 60.0 / std::sqrt(tau0_s);  // (deg/h)/sqrt(s) to (deg/h)/sqrt(h)
        default:
            return 1.0;
    }
}

/// Whether flicker is the largest part of the Allan variance somewhere between tau0 and a quarter of the record.
bool has_floor(const Maximum& fit, std::size_t samples) {
    const Parameters& theta = fit.theta;
    const double floor = 2.0 * std::numbers::ln2 / std::numbers::pi * theta[flicker];
    const double time = std::exp(theta[log_time]);
    for (double m = 1.0; m <= 0.25 * static_cast<double>(samples); m *= 1.05) {
        // correlated noise: IEEE Std 952, annex C, with (q_c T_c)^2 = 2 T_c times its variance
        const double decays = 3.0 - 4.0 * std::exp(-m / time) + std::exp(-2.0 * m / time);
        const double others = 3.0 * theta[quantisation] / (m * m) + theta[angle_random_walk] / m +
                              theta[rate_random_walk] * m / 3.0 + 0.5 * fit.ramp * fit.ramp * m * m +
                              2.0 * theta[correlated] * time / m * (1.0 - 0.5 * time / m * decays);
        if (floor >= others) return true;
    }
    return false;
}

/// What of the parts of a record is claimed, and how well it is known.
class Claims {
   public:
    Claims(const Likelihood& likelihood, const Decomposition& parts, const Options& options)
        : likelihood_(likelihood), parts_(parts), prices_(prices_at(options.significance)), fits_(fits_of(options)) {
        best_ = fits_.best(prices_);
        arw_best_ = fits_.best(prices_, arw_bit);
        for (Mask bit = 1; bit <= ramp_bit; bit <<= 1) {
            if ((best_ & bit) != 0 && fits_.evidence(bit) >= prices_.of(bit)) claimed_ |= bit;
        }
        // A term too weak to be claimed still moves the others when it is left out, by as much as their standard
        // errors, where several terms vie for a few coefficients at low frequencies: values of such records are of all
        // terms. Likewise beside correlated noise that is not claimed but cannot be excluded.
        const bool drifts = (claimed_ & drifting) != 0 || (fits_.all() & correlated_bit) != 0;
        const Mask model = drifts ? fits_.all() : best_;
        model_ = model_of(model);
        estimate_ = restricted(model_, model);
    }

    /// The model that the values are of, at its maximum.
    const Maximum& estimate() const { return estimate_; }

    void describe(double tau0_s, NoiseFit& out) const {
        Model full = model_of(fits_.all());
        const Maximum of_full = restricted(full, fits_.all());
        const std::array<Coefficient*, 4> coefficients = {&out.quantization_arcsec, &out.arw_deg_rt_h,
                                                          &out.bias_instability_deg_h, &out.rrw_deg_h_rt_h};
        for (std::size_t i = 0; i < coefficients.size(); ++i) {
            Coefficient& c = *coefficients[i];
            const double factor = unit_factor(i, tau0_s);
            c.resolved = claimed(Mask{1} << i);
            if (i == flicker && c.resolved) c.resolved = has_floor(estimate(), likelihood_.samples());
            if (c.resolved) {
                const Ends ends = central_interval(likelihood_, model_, estimate(), i);
                c.value = factor * std::sqrt(estimate().theta[i]);
                c.lo = factor * std::sqrt(ends.lo);
                c.hi = factor * std::sqrt(ends.hi);
            } else if (const auto limit = upper_limit(likelihood_, full, of_full, i)) {
                c.hi = factor * std::sqrt(*limit);
            }
        }
        describe_ramp(of_full, 3600.0 / tau0_s, out.rate_ramp_deg_h_h);
        if (claimed(correlated_bit)) out.correlated = correlated_noise(tau0_s);
        for (std::size_t i = 0; i < parts_.lines.size(); ++i) {
            out.sinusoids.push_back(sinusoid(parts_.lines[i], parts_.evidence[i], tau0_s));
        }
        std::sort(out.sinusoids.begin(), out.sinusoids.end(),
                  [](const Sinusoid& a, const Sinusoid& b) { return a.frequency_hz.value < b.frequency_hz.value; });
        out.pooling = pooling(tau0_s);
    }

   private:
    static constexpr Mask arw_bit = Mask{1} << angle_random_walk;
    static constexpr Mask angle_noise_bit = Mask{1} << quantisation;
    static constexpr Mask drifting = Mask{1} << flicker | Mask{1} << rate_random_walk | correlated_bit;

    Maximum restricted(Model& model, Mask mask) const {
        model.restricted = true;
        return likelihood_.maximise(model, &fits_[mask].theta);
    }

    Prices prices_at(double significance) const {
        const boost::math::chi_squared one(1.0);
        return {.variance = boost::math::quantile(boost::math::complement(one, 2.0 * significance)),
                .ramp = boost::math::quantile(boost::math::complement(one, significance)),
                .correlated = parts_.markov.price(significance)};
    }
    /// Correlated noise that cannot be excluded is among the terms though it is not claimed, unless it would stand in
    /// the place of white noise: of a time within a sample or so it is white itself.
    Subsets fits_of(const Options& options) const {
        const Parameters& start = parts_.markov.best.theta;
        if (parts_.markov.supported(options.significance)) return {likelihood_, five_terms | correlated_bit, start};
        Subsets five(likelihood_, five_terms, start);
        if (!parts_.markov.supported(options.nuisance_significance)) return five;
        Subsets six(likelihood_, five_terms | correlated_bit, start);
        const auto shown = [&](const Subsets& fits, Mask bit) {
            return (fits.best(prices_) & bit) != 0 && fits.evidence(bit) >= prices_.of(bit);
        };
        for (const Mask bit : {angle_noise_bit, arw_bit}) {
            if (shown(five, bit) && !shown(six, bit)) return five;
        }
        return six;
    }

    bool claimed(Mask bit) const {
        return (claimed_ & bit) != 0 &&
               (bit == ramp_bit || estimate().theta[static_cast<std::size_t>(std::countr_zero(bit))] > 0.0);
    }

    /// The ramp's variance is that of the slowest terms, known with few degrees of freedom.
    static double ramp_error(const Maximum& fit, double probability) {
        const boost::math::students_t t(fit.ramp_degrees);
        return boost::math::quantile(t, probability) * std::sqrt(fit.ramp_variance);
    }
    void describe_ramp(const Maximum& of_full, double per_hour, Coefficient& ramp) const {
        ramp.resolved = claimed(ramp_bit);
        const Maximum& fit = ramp.resolved ? estimate_ : of_full;
        const double value = per_hour * std::abs(fit.ramp);
        if (ramp.resolved) {
            const double spread = per_hour * ramp_error(fit, one_sigma_below);
            ramp.value = value;
            ramp.lo = std::max(0.0, value - spread);
            ramp.hi = value + spread;
        } else {
            ramp.hi = value + per_hour * ramp_error(fit, 0.95);
        }
    }

    Correlated correlated_noise(double tau0_s) const {
        Correlated out;
        const Ends time = central_interval(likelihood_, model_, estimate(), log_time);
        out.correlation_time_s = {tau0_s * std::exp(estimate().theta[log_time]), tau0_s * std::exp(time.lo),
                                  tau0_s * std::exp(time.hi)};
        const double variance = estimate().theta[correlated];
        const Ends ends = central_interval(likelihood_, model_, estimate(), correlated);
        out.rms_rate_deg_h = {std::sqrt(variance), std::sqrt(ends.lo), std::sqrt(ends.hi)};
        // q_c^2 = 2 variance/T_c; (deg/h)/sqrt(s) to (deg/h)/sqrt(h) is a factor of 60
        const double q = 60.0 * std::sqrt(2.0 * variance / out.correlation_time_s.value);
        const auto& c = estimate().covariance;
        const double spread =
            0.5 * std::sqrt(std::max(0.0, c[correlated][correlated] / (variance * variance) -
                                              2.0 * c[correlated][log_time] / variance + c[log_time][log_time]));
        out.amplitude_deg_h_rt_h = {q, q * std::exp(-spread), q * std::exp(spread)};
        out.evidence = fits_.evidence(correlated_bit);
        return out;
    }

    Sinusoid sinusoid(const Line& line, double evidence, double tau0_s) const {
        Sinusoid out;
        const double x = 0.5 * line.index / static_cast<double>(likelihood_.samples());
        const double x_spread = 0.5 * std::sqrt(line.covariance[2][2]) / static_cast<double>(likelihood_.samples());
        out.frequency_hz = {x / tau0_s, (x - x_spread) / tau0_s, (x + x_spread) / tau0_s};
        // A mean over tau0 has sin(pi x)/(pi x) of the amplitude. 1 arcsec/s is 1 deg/h.
        const double gain = std::numbers::pi * x / std::sin(std::numbers::pi * x);
        const double spread = std::sqrt(line.amplitude_variance());
        out.rate_amplitude_deg_h = {gain * line.amplitude(), gain * (line.amplitude() - spread),
                                    gain * (line.amplitude() + spread)};
        out.evidence = evidence;
        return out;
    }

    Pooling pooling(double tau0_s) const {
        const auto arw_of = [&](Mask mask) {
            return unit_factor(angle_random_walk, tau0_s) * std::sqrt(fits_[mask].theta[angle_random_walk]);
        };
        Pooling out;
        out.arw_evidence = std::max(0.0, fits_.evidence(arw_bit));
        out.angle_noise_evidence = std::max(0.0, fits_[arw_bit].deviance - fits_[arw_bit | angle_noise_bit].deviance);
        out.arw_alone_deg_rt_h = arw_of(arw_bit);
        out.arw_beside_angle_noise_deg_rt_h = arw_of(arw_bit | angle_noise_bit);
        out.arw_best_deg_rt_h = arw_of(arw_best_);
        out.red = (best_ & ~(arw_bit | angle_noise_bit)) != 0;
        return out;
    }

    const Likelihood& likelihood_;
    const Decomposition& parts_;
    Prices prices_;
    Subsets fits_;
    Mask best_ = 0;      ///< subset of least deviance plus prices
    Mask arw_best_ = 0;  ///< the same of those with angle random walk
    Mask claimed_ = 0;
    Model model_;  ///< what the values are estimated with; restricted, for a ramp takes a degree of freedom of few
    Maximum estimate_;
};

std::vector<double> increments(std::span<const double> angle, double& largest) {
    std::vector<double> y(angle.size() > 0 ? angle.size() - 1 : 0);
    largest = angle.empty() ? 0.0 : std::abs(angle[0]);
    for (std::size_t i = 0; i < y.size(); ++i) {
        y[i] = angle[i + 1] - angle[i];
        largest = std::max(largest, std::abs(angle[i + 1]));
    }
    return y;
}

/// Whether anything but a line and a ramp is in the coefficients, above the rounding of the angles themselves.
bool only_rounding(const Spectrum& s, double largest_rate_unit) {
    double zz = 0.0;
    double dz = 0.0;
    double dd = 0.0;
    for (std::size_t j = 1; j <= s.z.size(); ++j) {
        zz += s.z[j - 1] * s.z[j - 1];
        dz += s.z[j - 1] * s.ramp(j);
        dd += s.ramp(j) * s.ramp(j);
    }
    const double slope = dz / dd;
    double rest = 0.0;
    for (std::size_t j = 1; j <= s.z.size(); ++j) {
        const double e = s.z[j - 1] - slope * s.ramp(j);
        rest += e * e;
    }
    const double count = static_cast<double>(s.z.size());
    constexpr double epsilon = std::numeric_limits<double>::epsilon();
    const double rounding = 4.0 * epsilon * largest_rate_unit + 1e-13 * std::sqrt(zz / count);
    return !(std::sqrt(rest / count) > rounding);
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
