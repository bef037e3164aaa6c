#include "analysis/noise/claims.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <numbers>

#include "analysis/noise/interval.hpp"
#include "analysis/noise/model/lost_information.hpp"
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

constexpr Mask arw_bit = Mask{1} << angle_random_walk;
constexpr Mask angle_noise_bit = Mask{1} << quantisation;
constexpr Mask drifting = Mask{1} << flicker | Mask{1} << rate_random_walk | correlated_bit;

/// The ramp's variance is that of the slowest terms, known with few degrees of freedom.
double ramp_error(const Maximum& fit, double probability) {
    const boost::math::students_t t(fit.ramp_degrees);
    return boost::math::quantile(t, probability) * std::sqrt(fit.ramp_variance);
}

}  // namespace

Claims::Claims(const Likelihood& likelihood, const Decomposition& parts, const Options& options)
    : likelihood_(likelihood),
      values_(&likelihood),
      parts_(parts),
      prices_(prices_at(options.significance)),
      fits_(fits_of(options)) {
    best_ = fits_.best(prices_);
    arw_best_ = fits_.best(prices_, arw_bit);
    for (Mask bit = 1; bit <= ramp_bit; bit <<= 1) {
        if ((best_ & bit) != 0 && fits_.evidence(bit) >= prices_.of(bit)) claimed_ |= bit;
    }
    // A term too weak to be claimed still moves the others when it is left out, by as much as their standard
    // errors, where several terms vie for a few coefficients at low frequencies: values of such records are of all
    // terms. The same holds with correlated noise that is not claimed but cannot be excluded.
    const bool drifts = (claimed_ & drifting) != 0 || (fits_.all() & correlated_bit) != 0;
    terms_ = drifts ? fits_.all() : best_;
    model_ = model_of(terms_);
    estimate_ = restricted(likelihood_, model_, terms_);
}

void Claims::estimate_from(const Likelihood& values) {
    values_ = &values;
    estimate_ = restricted(values, model_, terms_);
}

void Claims::describe(double tau0_s, NoiseFit& out) const {
    Model full = model_of(fits_.all());
    const Maximum of_full = restricted(likelihood_, full, fits_.all());
    const std::array<Coefficient*, 4> coefficients = {&out.quantization_arcsec, &out.arw_deg_rt_h,
                                                      &out.bias_instability_deg_h, &out.rrw_deg_h_rt_h};
    for (std::size_t i = 0; i < coefficients.size(); ++i) {
        Coefficient& c = *coefficients[i];
        const double factor = unit_factor(i, tau0_s);
        c.resolved = claimed(Mask{1} << i);
        if (i == flicker && c.resolved) c.resolved = has_floor(estimate(), likelihood_.samples());
        if (c.resolved) {
            const Ends ends = central_interval(*values_, model_, estimate(), i);
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

Maximum Claims::restricted(const Likelihood& likelihood, Model& model, Mask mask) const {
    model.restricted = true;
    return likelihood.maximise(model, &fits_[mask].theta);
}

Prices Claims::prices_at(double significance) const {
    const boost::math::chi_squared one(1.0);
    Prices out;
    out.variance.fill(boost::math::quantile(boost::math::complement(one, 2.0 * significance)));
    out.ramp = boost::math::quantile(boost::math::complement(one, significance));
    out.correlated = parts_.markov.price(significance);
    if (likelihood_.lost() == nullptr) return out;
    // Deviances of a record with missing samples fall by too much.
    const LostInformation& lost = *likelihood_.lost();
    const Model five = model_of(five_terms);
    for (std::size_t i = 0; i < out.variance.size(); ++i) out.variance[i] *= lost.inflation(five, i);
    out.ramp *= lost.ramp_inflation;
    out.correlated *= lost.inflation(model_of(five_terms | correlated_bit), noise::correlated);
    return out;
}

/// Correlated noise that cannot be excluded is among the terms though it is not claimed, unless it would stand in
/// the place of white noise: of a time within a sample or so it is white itself.
Subsets Claims::fits_of(const Options& options) const {
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

bool Claims::claimed(Mask bit) const {
    return (claimed_ & bit) != 0 &&
           (bit == ramp_bit || estimate().theta[static_cast<std::size_t>(std::countr_zero(bit))] > 0.0);
}

void Claims::describe_ramp(const Maximum& of_full, double per_hour, Coefficient& ramp) const {
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

Correlated Claims::correlated_noise(double tau0_s) const {
    Correlated out;
    const Ends time = central_interval(*values_, model_, estimate(), log_time);
    out.correlation_time_s = {tau0_s * std::exp(estimate().theta[log_time]), tau0_s * std::exp(time.lo),
                              tau0_s * std::exp(time.hi)};
    const double variance = estimate().theta[correlated];
    const Ends ends = central_interval(*values_, model_, estimate(), correlated);
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

Sinusoid Claims::sinusoid(const Line& line, double evidence, double tau0_s) const {
    Sinusoid out;
    const double x = 0.5 * line.index / static_cast<double>(likelihood_.samples());
    // About a line the noise is white, and as many data as there are tell its amplitude and frequency.
    const double wider = likelihood_.lost() != nullptr ? std::sqrt(1.0 / likelihood_.lost()->share_present) : 1.0;
    const double x_spread = wider * 0.5 * std::sqrt(line.covariance[2][2]) / static_cast<double>(likelihood_.samples());
    out.frequency_hz = {x / tau0_s, (x - x_spread) / tau0_s, (x + x_spread) / tau0_s};
    // A mean over tau0 has sin(pi x)/(pi x) of the amplitude. 1 arcsec/s is 1 deg/h.
    const double gain = std::numbers::pi * x / std::sin(std::numbers::pi * x);
    const double spread = wider * std::sqrt(line.amplitude_variance());
    out.rate_amplitude_deg_h = {gain * line.amplitude(), gain * (line.amplitude() - spread),
                                gain * (line.amplitude() + spread)};
    out.evidence = evidence;
    return out;
}

Pooling Claims::pooling(double tau0_s) const {
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

}  // namespace ringlock::noise
