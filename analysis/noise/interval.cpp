#include "analysis/noise/interval.hpp"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>

namespace ringlock::noise {
namespace {

constexpr double normal_below = 0.158655253931457;  // of a normal deviate below -1
constexpr double many_degrees = 200.0;

/// Rise of the deviance where a variance known with k degrees of freedom is held at the value for which what was seen
/// is the p quantile: k chi-squared ordinates of sum w have deviance w - k - k ln(w/k). At p = 0.05, 2.71 for large k,
/// 4.54 for one.
double quantile_deviance(double k, double p) {
    k = std::clamp(k, 1.0, 1e4);
    const double w = boost::math::quantile(boost::math::chi_squared(k), p);
    return w - k - k * std::log(w / k);
}

double degrees_of_freedom(const Maximum& at, std::size_t term) {
    const double degrees = 2.0 * at.theta[term] * at.theta[term] / at.covariance[term][term];
    return std::isfinite(degrees) ? degrees : 1.0;
}

/// Where the deviance, all else free, has risen by so much (of the samples that are there); on a scale u on which the
/// parameter is value(u), from u = 0 at the maximum in steps of about `step`.
template <class Value>
double where_risen(const Likelihood& likelihood, const Model& model, const Maximum& best, std::size_t parameter,
                   double rise, double step, double farthest, const Value& value) {
    // The root of the rise is nearly a straight line.
    const double wanted = std::sqrt(rise * best.inflation[parameter]);
    const auto root = [&](double u) {
        const Maximum there = likelihood.maximise(model, &best.theta, parameter, value(u));
        return std::sqrt(std::max(0.0, there.deviance - best.deviance));
    };
    double inside = 0.0;
    double root_inside = 0.0;
    double outside = step;
    double root_outside = root(outside);
    while (root_outside < wanted) {
        if (std::abs(outside) >= farthest) return std::copysign(farthest, step);
        inside = outside;
        root_inside = root_outside;
        outside = std::copysign(std::min(farthest, 1.5 * std::abs(outside)), step);
        root_outside = root(outside);
    }
    for (int i = 0; i < 20 && root_outside - wanted > 0.005 * wanted; ++i) {
        const double share = std::clamp((wanted - root_inside) / (root_outside - root_inside), 0.1, 0.95);
        const double middle = inside + share * (outside - inside);
        const double r = root(middle);
        if (std::abs(r - wanted) < 0.005 * wanted) return middle;
        (r < wanted ? inside : outside) = middle;
        (r < wanted ? root_inside : root_outside) = r;
    }
    return outside;
}

/// Whether another variance falls to 0, its bound, on the way to the end of a profile. The likelihood then falls
/// because that one can give way no further, though the estimates of records in which it is truly 0 scatter as the
/// curvature says.
bool bounds_another(const Likelihood& likelihood, const Model& model, const Maximum& best, std::size_t parameter,
                    double end) {
    const Maximum there = likelihood.maximise(model, &best.theta, parameter, end);
    for (std::size_t i = 0; i < term_count; ++i) {
        if (i != parameter && best.theta[i] > 0.0 && !(there.theta[i] > 0.0)) return true;
    }
    return false;
}

}  // namespace

Ends central_interval(const Likelihood& likelihood, const Model& model, const Maximum& best, std::size_t parameter) {
    const double at = best.theta[parameter];
    const double spread = std::sqrt(best.covariance[parameter][parameter]);
    if (parameter == log_time) {
        const auto value = [&](double u) { return at + u; };
        const LogTimes range = log_times(likelihood.samples());
        const double step = std::clamp(spread, 0.01, 1.0);
        return {at + where_risen(likelihood, model, best, parameter, 1.0, -std::min(step, at - range.lo + 1e-6),
                                 at - range.lo, value),
                at + where_risen(likelihood, model, best, parameter, 1.0, std::min(step, range.hi - at + 1e-6),
                                 range.hi - at, value)};
    }
    const double log_spread = spread / at;
    const double degrees = degrees_of_freedom(best, parameter);
    if (degrees > many_degrees) return {at * std::exp(-log_spread), at * std::exp(log_spread)};
    const auto value = [&](double u) { return at * std::exp(u); };
    const auto end = [&](double p, double direction) {
        return value(where_risen(likelihood, model, best, parameter, quantile_deviance(degrees, p),
                                 direction * log_spread, 20.0, value));
    };
    Ends out{end(1.0 - normal_below, -1.0), end(normal_below, 1.0)};
    const double of_curvature = value(log_spread);
    if (out.hi < of_curvature && bounds_another(likelihood, model, best, parameter, out.hi)) out.hi = of_curvature;
    return out;
}

std::optional<double> upper_limit(const Likelihood& likelihood, const Model& model, const Maximum& best,
                                  std::size_t term) {
    const auto rise = [&](double value) {
        const Maximum there = likelihood.maximise(model, &best.theta, term, value);
        return (there.deviance - best.deviance) / there.inflation[term] -
               quantile_deviance(degrees_of_freedom(there, term), 0.05);
    };
    double inside = best.theta[term];
    const double spread = std::sqrt(best.covariance[term][term]);
    double outside = inside + 2.0 * spread;
    if (!(outside > inside)) {
        // On the boundary: begin from a share of what the term alone would have.
        Model alone;
        alone.has[term] = true;
        outside = 1e-6 * likelihood.maximise(alone).theta[term];
        if (!(outside > 0.0)) return std::nullopt;
    }
    double rise_inside = -quantile_deviance(1e4, 0.05);
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

}  // namespace ringlock::noise
