#include "analysis/noise/fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::noise {
namespace {

constexpr std::size_t mask_count = std::size_t{1} << (term_count + 1);  // bit term_count: the ramp
constexpr std::size_t ramp_bit = std::size_t{1} << term_count;
constexpr std::size_t full_mask = mask_count - 1;
constexpr double one_sided_95 = 1.6448536269515;

Model model_of(std::size_t mask) {
    Model m;
    for (std::size_t i = 0; i < term_count; ++i) m.has[i] = ((mask >> i) & 1u) != 0;
    m.ramp = (mask & ramp_bit) != 0;
    return m;
}

/// All subsets of the terms at their maxima.
class Subsets {
   public:
    explicit Subsets(const Likelihood& likelihood) : likelihood_(likelihood) {
        for (std::size_t mask = 1; mask < mask_count; ++mask) {
            if ((mask & ~ramp_bit) == 0) continue;
            fits_[mask] = likelihood.maximise(model_of(mask));
            // A model is never worse than one of its parts; where the search stopped early, go on from the best part.
            for (std::size_t bit = 1; bit < mask_count; bit <<= 1) {
                const std::size_t part = mask & ~bit;
                if ((mask & bit) == 0 || (part & ~ramp_bit) == 0) continue;
                if (fits_[part].deviance < fits_[mask].deviance - 1e-6) restart(mask, part);
            }
        }
    }
    const Maximum& operator[](std::size_t mask) const { return fits_[mask]; }

   private:
    void restart(std::size_t mask, std::size_t part) {
        const TermValues start = fits_[part].theta;
        Maximum again = likelihood_.maximise(model_of(mask), &start);
        if (again.deviance < fits_[mask].deviance) fits_[mask] = again;
    }

    const Likelihood& likelihood_;
    std::array<Maximum, mask_count> fits_{};
};

/// Rise of the deviance at a one-sided 95 % upper limit of a variance known with k degrees of freedom: k chi-squared
/// ordinates of sum w have deviance w - k - k ln(w/k), and w lies below its 5 % point once in twenty. 2.71 for large
/// k, 4.54 for one.
double limit_deviance(double k) {
    k = std::clamp(k, 1.0, 1e4);
    const double w = boost::math::quantile(boost::math::chi_squared(k), 0.05);
    return w - k - k * std::log(w / k);
}

/// Value of theta[term] at which the deviance, all other terms free, has risen to a one-sided 95 % limit.
std::optional<double> upper_limit(const Likelihood& likelihood, const Maximum& full, std::size_t term) {
    Model model = model_of(full_mask);
    model.restricted = true;
    TermValues start = full.theta;
    const auto rise = [&](double value) {
        const Maximum there = likelihood.maximise(model, &start, term, value);
        const double degrees = 2.0 * value * value / there.covariance[term][term];
        return there.deviance - full.deviance - limit_deviance(std::isfinite(degrees) ? degrees : 1.0);
    };
    double inside = full.theta[term];
    const double spread = std::sqrt(full.covariance[term][term]);
    double outside = inside + 2.0 * spread;
    if (!(outside > inside)) {
        // On the boundary: begin from a share of what the term alone would have.
        Model alone;
        alone.has[term] = true;
        outside = 1e-6 * likelihood.maximise(alone).theta[term];
        if (!(outside > 0.0)) return std::nullopt;
    }
    double rise_inside = -limit_deviance(1e4);
    double rise_outside = rise(outside);
    for (int doubling = 0; rise_outside < 0.0; ++doubling) {
        if (doubling == 60) return std::nullopt;
        inside = outside;
        rise_inside = rise_outside;
        outside *= 4.0;
        rise_outside = rise(outside);
    }
    for (int i = 0; i < 40 && outside - inside > 0.005 * outside && rise_outside > 0.01; ++i) {
        const double share = std::clamp(rise_inside / (rise_inside - rise_outside), 0.1, 0.9);
        const double middle = inside + share * (outside - inside);
        const double r = rise(middle);
        (r < 0.0 ? inside : outside) = middle;
        (r < 0.0 ? rise_inside : rise_outside) = r;
    }
    return outside;
}

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
bool has_floor(const TermValues& theta, double ramp, std::size_t samples) {
    const double floor = 2.0 * std::numbers::ln2 / std::numbers::pi * theta[flicker];
    for (double m = 1.0; m <= 0.25 * static_cast<double>(samples); m *= 1.05) {
        const double others = 3.0 * theta[quantisation] / (m * m) + theta[angle_random_walk] / m +
                              theta[rate_random_walk] * m / 3.0 + 0.5 * ramp * ramp * m * m;
        if (floor >= others) return true;
    }
    return false;
}

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

    const Likelihood likelihood(spectrum);
    const Subsets fits(likelihood);
    const boost::math::chi_squared one(1.0);
    const double variance_price = boost::math::quantile(boost::math::complement(one, 2.0 * options.significance));
    const double ramp_price = boost::math::quantile(boost::math::complement(one, options.significance));

    constexpr std::size_t arw_bit = std::size_t{1} << angle_random_walk;
    std::size_t best = 0;
    std::size_t best_with_arw = 0;
    double best_score = std::numeric_limits<double>::infinity();
    double best_score_with_arw = std::numeric_limits<double>::infinity();
    for (std::size_t mask = 1; mask < mask_count; ++mask) {
        if ((mask & ~ramp_bit) == 0) continue;
        double score = fits[mask].deviance + ((mask & ramp_bit) != 0 ? ramp_price : 0.0);
        for (std::size_t i = 0; i < term_count; ++i) score += ((mask >> i) & 1u) != 0 ? variance_price : 0.0;
        if (score < best_score) {
            best_score = score;
            best = mask;
        }
        if ((mask & arw_bit) != 0 && score < best_score_with_arw) {
            best_score_with_arw = score;
            best_with_arw = mask;
        }
    }
    const Maximum& chosen = fits[best];
    const Maximum& full = fits[full_mask];
    Model restricted = model_of(full_mask);
    restricted.restricted = true;
    const Maximum full_restricted = likelihood.maximise(restricted, &full.theta);
    const auto supported = [&](std::size_t bit, double price) {
        return (best & bit) != 0 && fits[full_mask & ~bit].deviance - full.deviance >= price;
    };

    const std::array<Coefficient*, term_count> coefficients = {&out.quantization_arcsec, &out.arw_deg_rt_h,
                                                               &out.bias_instability_deg_h, &out.rrw_deg_h_rt_h};
    for (std::size_t i = 0; i < term_count; ++i) {
        Coefficient& c = *coefficients[i];
        const double factor = unit_factor(i, tau0_s);
        c.resolved = supported(std::size_t{1} << i, variance_price) && chosen.theta[i] > 0.0;
        if (i == flicker && c.resolved) c.resolved = has_floor(chosen.theta, chosen.ramp, spectrum.samples);
        if (c.resolved) {
            // The estimate is near normal on the scale of ln theta; half of that is the scale of ln coefficient.
            const double spread = 0.5 * std::sqrt(chosen.covariance[i][i]) / chosen.theta[i];
            c.value = factor * std::sqrt(chosen.theta[i]);
            c.lo = *c.value * std::exp(-spread);
            c.hi = *c.value * std::exp(spread);
        } else if (const auto limit = upper_limit(likelihood, full_restricted, i)) {
            c.hi = factor * std::sqrt(*limit);
        }
    }

    const auto arw_of = [&](std::size_t mask) {
        return unit_factor(angle_random_walk, tau0_s) * std::sqrt(fits[mask].theta[angle_random_walk]);
    };
    constexpr std::size_t angle_noise_bit = std::size_t{1} << quantisation;
    out.pooling.arw_evidence = std::max(0.0, fits[full_mask & ~arw_bit].deviance - full.deviance);
    out.pooling.angle_noise_evidence = std::max(0.0, fits[arw_bit].deviance - fits[arw_bit | angle_noise_bit].deviance);
    out.pooling.arw_alone_deg_rt_h = arw_of(arw_bit);
    out.pooling.arw_beside_angle_noise_deg_rt_h = arw_of(arw_bit | angle_noise_bit);
    out.pooling.arw_best_deg_rt_h = arw_of(best_with_arw);
    out.pooling.red = (best & ~(arw_bit | angle_noise_bit)) != 0;

    Coefficient& ramp = out.rate_ramp_deg_h_h;
    const double per_hour = 3600.0 / tau0_s;
    ramp.resolved = supported(ramp_bit, ramp_price);
    if (ramp.resolved) {
        const double spread = per_hour * std::sqrt(chosen.ramp_variance);
        ramp.value = per_hour * std::abs(chosen.ramp);
        ramp.lo = std::max(0.0, *ramp.value - spread);
        ramp.hi = *ramp.value + spread;
    } else {
        ramp.hi = per_hour * (std::abs(full.ramp) + one_sided_95 * std::sqrt(full.ramp_variance));
    }

    out.goodness = goodness_of_fit(spectrum, chosen, tau0_s, options.misfit_threshold);
    out.described = out.goodness.accepted;
    out.reason = out.goodness.reason;
    return out;
}

}  // namespace ringlock::noise
