#include "analysis/design/factor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/lognormal.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/triangular.hpp>
#include <boost/math/distributions/uniform.hpp>
#include <cmath>
#include <unordered_set>

#include "engine/core/error.hpp"

namespace ringlock::design {
namespace {

/// Beyond so many standard deviations a double has no probability left.
constexpr double farthest_sd = 40.0;

template <class... F>
struct Overloaded : F... {
    using F::operator()...;
};
template <class... F>
Overloaded(F...) -> Overloaded<F...>;

double log_sd(const Lognormal& d) { return std::sqrt(std::log1p(d.sd_relative * d.sd_relative)); }

boost::math::normal boosts(const Normal& d) { return {d.mean, d.sd}; }
boost::math::uniform boosts(const Uniform& d) { return {d.from, d.to}; }
boost::math::lognormal boosts(const Lognormal& d) { return {std::log(d.median), log_sd(d)}; }
boost::math::triangular boosts(const Triangular& d) { return {d.from, d.mode, d.to}; }

double least(const Normal&) { return -std::numeric_limits<double>::infinity(); }
double least(const Uniform& d) { return d.from; }
double least(const Lognormal&) { return 0.0; }
double least(const Triangular& d) { return d.from; }

double most(const Normal&) { return std::numeric_limits<double>::infinity(); }
double most(const Uniform& d) { return d.to; }
double most(const Lognormal&) { return std::numeric_limits<double>::infinity(); }
double most(const Triangular& d) { return d.to; }

template <class D>
double probability_below(const D& d, double x) {
    if (x <= least(d)) return 0.0;
    if (x >= most(d)) return 1.0;
    return boost::math::cdf(boosts(d), x);
}

template <class D>
double probability_above(const D& d, double x) {
    if (x <= least(d)) return 1.0;
    if (x >= most(d)) return 0.0;
    return boost::math::cdf(boost::math::complement(boosts(d), x));
}

[[noreturn]] void refuse(const Factor& f, const std::string& why) {
    throw InputError(fmt::format("factor {}: {}", f.key.empty() ? "without a key" : f.key, why));
}

void check_finite(const Factor& f, const char* what, double value) {
    if (!std::isfinite(value)) refuse(f, fmt::format("{} = {} must be a finite number", what, value));
}

void check_above_zero(const Factor& f, const char* what, double value) {
    check_finite(f, what, value);
    if (value <= 0.0) {
        refuse(f, fmt::format("{} = {} must be above 0; a quantity that does not vary is not a factor", what, value));
    }
}

void check_in_order(const Factor& f, double from, double to) {
    check_finite(f, "from", from);
    check_finite(f, "to", to);
    if (!(from < to)) refuse(f, fmt::format("from = {} must lie below to = {}", from, to));
    check_finite(f, "to - from", to - from);
}

void check_value(const Factor& f, double value) {
    check_finite(f, "a value", value);
    if (value < f.lower || value > f.upper) {
        refuse(f, fmt::format("the value {} lies outside of the allowed range, {} to {}", value, f.lower, f.upper));
    }
}

void check_taken(const Factor& f, const Values& v) {
    if (v.values.empty()) refuse(f, "has no values; give it one or more");
    for (const double value : v.values) check_value(f, value);
}

void check_taken(const Factor& f, const Range& r) {
    check_value(f, r.from);
    check_value(f, r.to);
    if (r.points < 2) refuse(f, fmt::format("a range of {} points; give it 2 or more, or a value", r.points));
    if (r.from == r.to) refuse(f, fmt::format("a range from {} to the same; give it a value instead", r.from));
    check_finite(f, "to - from", r.to - r.from);
    if (r.scale == Scale::log && !(r.from > 0.0 && r.to > 0.0) && !(r.from < 0.0 && r.to < 0.0)) {
        refuse(f, fmt::format("a logarithmic range from {} to {}; both ends must be above 0, or both below", r.from,
                              r.to));
    }
}

void check_taken(const Factor& f, const Normal& d) {
    check_finite(f, "mean", d.mean);
    check_above_zero(f, "sd", d.sd);
    if (!std::isfinite(std::abs(d.mean) + farthest_sd * d.sd)) {
        refuse(f, fmt::format("mean = {} and sd = {} are too large to be computed with", d.mean, d.sd));
    }
}

void check_taken(const Factor& f, const Uniform& d) { check_in_order(f, d.from, d.to); }

void check_taken(const Factor& f, const Lognormal& d) {
    check_above_zero(f, "median", d.median);
    check_above_zero(f, "sd_relative", d.sd_relative);
    // A variance that has gone to zero, or a tail beyond the range of a double.
    if (!(log_sd(d) > 0.0) || !std::isfinite(d.median * std::exp(farthest_sd * log_sd(d)))) {
        refuse(f, fmt::format("median = {} with sd_relative = {} is too large or too narrow to be computed with",
                              d.median, d.sd_relative));
    }
}

void check_taken(const Factor& f, const Triangular& d) {
    check_in_order(f, d.from, d.to);
    check_finite(f, "mode", d.mode);
    if (d.mode < d.from || d.mode > d.to) {
        refuse(f, fmt::format("mode = {} must lie within from = {} and to = {}", d.mode, d.from, d.to));
    }
}

struct Tails {
    double below = 0.0;
    double above = 0.0;
    double within = 1.0;
};

template <class D>
Tails tails_of(const Factor& f, const D& d) {
    Tails t{probability_below(d, f.lower), probability_above(d, f.upper), 0.0};
    t.within = 1.0 - t.below - t.above;
    return t;
}
Tails tails_of(const Factor&, const Values&) { return {}; }
Tails tails_of(const Factor&, const Range&) { return {}; }

Tails tails(const Factor& f) {
    return std::visit([&](const auto& taken) { return tails_of(f, taken); }, f.takes);
}

}  // namespace

bool has_distribution(const Factor& factor) {
    return !std::holds_alternative<Values>(factor.takes) && !std::holds_alternative<Range>(factor.takes);
}

std::uint64_t level_count(const Factor& factor) {
    if (const auto* values = std::get_if<Values>(&factor.takes)) return values->values.size();
    if (const auto* range = std::get_if<Range>(&factor.takes)) return range->points;
    return 0;
}

double level(const Factor& factor, std::uint64_t index) {
    if (const auto* values = std::get_if<Values>(&factor.takes)) return values->values[index];
    const Range& r = std::get<Range>(factor.takes);
    if (index == 0) return r.from;
    if (index + 1 == r.points) return r.to;
    const double share = static_cast<double>(index) / static_cast<double>(r.points - 1);
    const double between =
        r.scale == Scale::linear
            ? std::lerp(r.from, r.to, share)
            : std::copysign(std::exp(std::lerp(std::log(std::abs(r.from)), std::log(std::abs(r.to)), share)), r.from);
    return std::clamp(between, std::min(r.from, r.to), std::max(r.from, r.to));
}

void check(const Factor& factor) {
    if (factor.key.empty()) refuse(factor, "every factor must name the key that it varies");
    // Not a number is neither.
    if (!(factor.lower < factor.upper) && !(factor.lower == factor.upper)) {
        refuse(factor, fmt::format("bounds {} to {} are not in order", factor.lower, factor.upper));
    }
    std::visit([&](const auto& taken) { check_taken(factor, taken); }, factor.takes);
    const Tails t = tails(factor);
    if (!(t.within >= least_share_within_bounds)) {
        refuse(factor,
               fmt::format("only {:.2g} of its distribution lies within the allowed range, {} to {} ({:.3g} below, "
                           "{:.3g} above), but at least {} must; move or narrow the distribution",
                           std::max(t.within, 0.0), factor.lower, factor.upper, t.below, t.above,
                           least_share_within_bounds));
    }
}

void check(std::span<const Factor> factors) {
    if (factors.empty()) throw InputError("a design without factors: name one or more");
    std::unordered_set<std::string> keys;
    for (const Factor& f : factors) {
        check(f);
        if (!keys.insert(f.key).second) refuse(f, "is given twice; give all its values in one place");
    }
}

Marginal::Marginal(const Factor& factor) : factor_(factor), levels_(level_count(factor)) {
    check(factor_);
    const Tails t = tails(factor_);
    below_ = t.below;
    above_ = t.above;
    within_ = t.within;
}

double Marginal::operator()(double u) const {
    if (!(u > 0.0 && u < 1.0)) {
        throw InputError(
            fmt::format("factor {}: u = {} of the unit interval must lie above 0 and below 1", factor_.key, u));
    }
    return (*this)(Probability::of(u));
}

double Marginal::operator()(Probability u) const {
    if (!(u.below > 0.0 && u.below <= 1.0 && u.above > 0.0 && u.above <= 1.0)) {
        throw InputError(fmt::format("factor {}: tails {} and {} of a probability must lie above 0, and not above 1",
                                     factor_.key, u.below, u.above));
    }
    if (levels_ > 0) {
        const auto index = static_cast<std::uint64_t>(u.below * static_cast<double>(levels_));
        return level(factor_, std::min(index, levels_ - 1));
    }
    // A product that has gone to zero would be an infinite quantile.
    const double smallest = std::numeric_limits<double>::min();
    const double below = std::max(below_ + u.below * within_, smallest);
    const double above = std::max(above_ + u.above * within_, smallest);
    const double x = std::visit(
        Overloaded{[](const Values&) { return 0.0; }, [](const Range&) { return 0.0; },
                   [&](const auto& d) {
                       const auto distribution = boosts(d);
                       return below <= 0.5 ? boost::math::quantile(distribution, below)
                                           : boost::math::quantile(boost::math::complement(distribution, above));
                   }},
        factor_.takes);
    return std::clamp(x, factor_.lower, factor_.upper);
}

}  // namespace ringlock::design
