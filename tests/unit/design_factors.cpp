// Factors of a design: quantiles against Boost's own distribution functions, moments in closed form, tails, bounds.
#include <gtest/gtest.h>

#include <boost/math/distributions/lognormal.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/triangular.hpp>
#include <boost/math/distributions/uniform.hpp>
#include <boost/math/quadrature/tanh_sinh.hpp>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "analysis/design/factor.hpp"
#include "engine/core/error.hpp"
#include "tests/support/expect_throw.hpp"

namespace ringlock::test {
namespace design_factors_test {
namespace {

using namespace design;
using testing::HasSubstr;

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double epsilon = std::numeric_limits<double>::epsilon();

/// Probabilities of both tails, down to 1e-300, and what lies between.
std::vector<Probability> probabilities() {
    std::vector<Probability> all;
    for (const double p : {1e-300, 1e-100, 1e-30, 1e-16, 1e-9, 1e-3, 0.01, 0.1, 0.3, 0.49, 0.4999999}) {
        all.push_back({p, 1.0 - p});
        all.push_back({1.0 - p, p});
    }
    all.push_back({0.5, 0.5});
    return all;
}

/// Boost's distribution, cut off at the bounds, gives back the probability of each quantile.
///
/// \param rounding  of an x, and of what Boost makes of it, in units of epsilon
template <class D, class Rounding>
void expect_inverse(const Factor& f, const D& boosts, const Rounding& rounding) {
    const Marginal marginal(f);
    const bool cut_below = f.lower > -inf && f.lower > boost::math::support(boosts).first;
    const bool cut_above = f.upper < inf && f.upper < boost::math::support(boosts).second;
    const double below = cut_below ? boost::math::cdf(boosts, f.lower) : 0.0;
    const double above = cut_above ? boost::math::cdf(boost::math::complement(boosts, f.upper)) : 0.0;
    const double within = 1.0 - below - above;
    EXPECT_NEAR(marginal.share_within_bounds(), within, 4.0 * epsilon) << f.key;
    for (const Probability u : probabilities()) {
        const double x = marginal(u);
        EXPECT_GE(x, f.lower) << f.key;
        EXPECT_LE(x, f.upper) << f.key;
        // An error of x times the density about it; and those of the probabilities beyond the bounds, an epsilon of
        // themselves.
        const double dx = 8.0 * epsilon * rounding(x);
        const double density =
            std::max({boost::math::pdf(boosts, x), boost::math::pdf(boosts, x - dx), boost::math::pdf(boosts, x + dx)});
        const double error = dx * density / within;
        if (u.below <= u.above) {
            const double seen = (boost::math::cdf(boosts, x) - below) / within;
            EXPECT_NEAR(seen, u.below, error + 8.0 * epsilon * (below / within + u.below))
                << f.key << " at " << u.below;
        } else {
            const double seen = (boost::math::cdf(boost::math::complement(boosts, x)) - above) / within;
            EXPECT_NEAR(seen, u.above, error + 8.0 * epsilon * (above / within + u.above))
                << f.key << " at 1 - " << u.above;
        }
    }
}

TEST(DesignFactors, QuantilesInvertBoostsDistributions) {
    // Differences to a mean or an end are rounded as these are; of a lognormal it is the logarithms.
    const auto beside = [](double end) { return [end](double x) { return std::max(std::abs(x), end); }; };
    const auto logarithm = [](double x) { return x * (1.0 + std::abs(std::log(x)) + std::abs(std::log(0.02))); };
    const auto expect = [](const char* key, auto takes, double lower, double upper, const auto& boosts,
                           const auto& rounding) {
        expect_inverse({.key = key, .takes = takes, .lower = lower, .upper = upper}, boosts, rounding);
    };
    const boost::math::normal normal(3.0, 2.0);
    expect("normal", Normal{3.0, 2.0}, -inf, inf, normal, beside(3.0));
    expect("normal above", Normal{3.0, 2.0}, 5.0, inf, normal, beside(3.0));
    expect("normal below", Normal{3.0, 2.0}, -inf, 1.0, normal, beside(3.0));
    expect("normal between", Normal{3.0, 2.0}, 2.5, 8.0, normal, beside(3.0));
    const boost::math::uniform uniform(-1.0, 4.0);
    expect("uniform", Uniform{-1.0, 4.0}, -inf, inf, uniform, beside(4.0));
    expect("uniform, wide bounds", Uniform{-1.0, 4.0}, -9.0, 9.0, uniform, beside(4.0));
    expect("uniform, cut", Uniform{-1.0, 4.0}, 0.0, 1.0, uniform, beside(4.0));
    const boost::math::lognormal lognormal(std::log(0.02), std::sqrt(std::log(1.0 + 0.3 * 0.3)));
    expect("lognormal", Lognormal{0.02, 0.3}, -inf, inf, lognormal, logarithm);
    expect("lognormal, bounds", Lognormal{0.02, 0.3}, -1.0, 0.03, lognormal, logarithm);
    expect("lognormal, cut", Lognormal{0.02, 0.3}, 0.015, 0.04, lognormal, logarithm);
    const boost::math::triangular triangular(1.0, 1.5, 4.0);
    expect("triangular", Triangular{1.0, 1.5, 4.0}, -inf, inf, triangular, beside(4.0));
    expect("triangular, cut", Triangular{1.0, 1.5, 4.0}, 1.2, 2.0, triangular, beside(4.0));
    expect("mode at the end", Triangular{1.0, 4.0, 4.0}, -inf, inf, boost::math::triangular(1.0, 4.0, 4.0),
           beside(4.0));
}

TEST(DesignFactors, TailsKeepAllDigits) {
    const Marginal standard({.key = "x", .takes = Normal{0.0, 1.0}});
    // Roots of ln Phi(x) = ln p with 60 digits.
    const struct {
        double p;
        double x;
    } known[] = {{1e-300, -37.047096299361199237},
                 {1e-100, -21.273453560965324295},
                 {0x1p-53, -8.2095361516013868556},
                 {1e-10, -6.3613409024040562047}};
    for (const auto& k : known) {
        EXPECT_NEAR(standard(k.p), k.x, 4.0 * epsilon * std::abs(k.x)) << k.p;
        EXPECT_NEAR(standard(Probability{1.0, k.p}), -k.x, 4.0 * epsilon * std::abs(k.x)) << k.p;
    }
    // 1 - 1e-16 is 1 - 2^-53.
    EXPECT_EQ(standard(1.0 - 1e-16), -standard(0x1p-53));
    // Where the product of the probability with what lies within the bounds is no double any more, x is still one.
    const Marginal cut({.key = "x", .takes = Normal{0.0, 1.0}, .upper = -1.0});
    EXPECT_TRUE(std::isfinite(cut(std::numeric_limits<double>::denorm_min())));
}

/// Mean and standard deviation of what the quantile function makes of a uniform deviate.
std::pair<double, double> moments(const Factor& f) {
    const Marginal marginal(f);
    boost::math::quadrature::tanh_sinh<double> integral;
    // Both halves from their end on, with the distance to the end exact.
    const auto mean_of = [&](const auto& g) {
        return integral.integrate(
                   [&](double u) {
                       return g(marginal(Probability{u, 1.0 - u}));
                   },
                   0.0, 0.5) +
               integral.integrate(
                   [&](double u) {
                       return g(marginal(Probability{1.0 - u, u}));
                   },
                   0.0, 0.5);
    };
    const double mean = mean_of([](double x) { return x; });
    return {mean, std::sqrt(mean_of([&](double x) { return (x - mean) * (x - mean); }))};
}

TEST(DesignFactors, MomentsAreThoseOfTheDistributions) {
    // Of quadrature; its own estimate is 1e-8 of the integral.
    const double tolerance = 1e-8;
    const auto normal = moments({.key = "x", .takes = Normal{3.0, 2.0}});
    EXPECT_NEAR(normal.first, 3.0, tolerance * 3.0);
    EXPECT_NEAR(normal.second, 2.0, tolerance * 2.0);
    const auto uniform = moments({.key = "x", .takes = Uniform{-1.0, 5.0}});
    EXPECT_NEAR(uniform.first, 2.0, tolerance * 5.0);
    EXPECT_NEAR(uniform.second, 6.0 / std::sqrt(12.0), tolerance * 5.0);
    // The mean of a lognormal is its median times sqrt(1 + relative deviation^2).
    const auto lognormal = moments({.key = "x", .takes = Lognormal{0.5, 0.4}});
    const double mean = 0.5 * std::sqrt(1.16);
    EXPECT_NEAR(lognormal.first, mean, tolerance);
    EXPECT_NEAR(lognormal.second, 0.4 * mean, tolerance);
    const auto triangular = moments({.key = "x", .takes = Triangular{1.0, 2.0, 6.0}});
    EXPECT_NEAR(triangular.first, 3.0, tolerance * 6.0);
    EXPECT_NEAR(triangular.second, std::sqrt((1.0 + 4.0 + 36.0 - 2.0 - 6.0 - 12.0) / 18.0), tolerance * 6.0);
}

TEST(DesignFactors, MomentsOfANormalThatIsCutOff) {
    // Johnson, Kotz, Balakrishnan, "Continuous univariate distributions" 1, eqs. 13.134 and 13.135.
    const boost::math::normal standard;
    for (const auto& [lower, upper] : {std::pair{-1.0, 0.5}, std::pair{1.0, 3.0}, std::pair{-0.2, 9.0}}) {
        const double below = boost::math::pdf(standard, lower);
        const double above = boost::math::pdf(standard, upper);
        const double within = boost::math::cdf(standard, upper) - boost::math::cdf(standard, lower);
        const double shift = (below - above) / within;
        const double variance = 1.0 + (lower * below - upper * above) / within - shift * shift;
        const auto cut =
            moments({.key = "x", .takes = Normal{10.0, 2.0}, .lower = 10.0 + 2.0 * lower, .upper = 10.0 + 2.0 * upper});
        EXPECT_NEAR(cut.first, 10.0 + 2.0 * shift, 1e-7);
        EXPECT_NEAR(cut.second, 2.0 * std::sqrt(variance), 1e-7);
    }
}

TEST(DesignFactors, QuantilesNeverDecreaseAndStayWithinBounds) {
    const Factor factors[] = {
        {.key = "normal", .takes = Normal{0.0, 1.0}, .lower = -1.5, .upper = 2.5},
        {.key = "wide normal", .takes = Normal{0.0, 30.0}, .lower = -1.0, .upper = 1.0},
        {.key = "normal's tail", .takes = Normal{0.0, 1.0}, .lower = 2.0},
        {.key = "uniform", .takes = Uniform{0.1, 0.7}, .lower = 0.3, .upper = 0.6},
        {.key = "lognormal", .takes = Lognormal{1.0, 0.5}, .lower = 0.9, .upper = 1.1},
        {.key = "triangular", .takes = Triangular{0.0, 0.1, 1.0}, .lower = 0.05, .upper = 0.9},
        {.key = "values", .takes = Values{{1.0, 2.0, 5.0}}},
    };
    for (const Factor& f : factors) {
        const Marginal marginal(f);
        double before = -inf;
        const auto next = [&](Probability u) {
            const double x = marginal(u);
            EXPECT_GE(x, before) << f.key << " at " << u.below;
            EXPECT_GE(x, f.lower) << f.key;
            EXPECT_LE(x, f.upper) << f.key;
            before = x;
        };
        for (int i = 1000; i > 10; --i) next(Probability::of(std::ldexp(1.0, -i)));
        for (int i = 1 << 6; i < (1 << 16) - (1 << 6); ++i) next(Probability::of(i * 0x1p-16));
        for (int i = 11; i <= 1000; ++i) next({1.0 - std::ldexp(1.0, -i), std::ldexp(1.0, -i)});
    }
}

TEST(DesignFactors, LevelsOfValuesAndRanges) {
    const Factor values{.key = "x", .takes = Values{{3.0, 1.0, 2.0}}};
    EXPECT_EQ(level_count(values), 3U);
    EXPECT_EQ(level(values, 1), 1.0);
    const Factor linear{.key = "x", .takes = Range{0.1, 0.7, 7, Scale::linear}};
    EXPECT_EQ(level(linear, 0), 0.1);
    EXPECT_EQ(level(linear, 6), 0.7);
    for (std::uint64_t i = 0; i < 7; ++i) EXPECT_NEAR(level(linear, i), 0.1 + 0.1 * static_cast<double>(i), 1e-15);
    for (const double sign : {1.0, -1.0}) {
        const Factor log{.key = "x", .takes = Range{sign * 1e3, sign * 1e-2, 6, Scale::log}};
        EXPECT_EQ(level(log, 0), sign * 1e3);
        EXPECT_EQ(level(log, 5), sign * 1e-2);
        for (int i = 0; i < 6; ++i) {
            const double known = sign * std::pow(10.0, 3 - i);
            // Of a logarithm up to 7 that is rounded, and its exponential.
            EXPECT_NEAR(level(log, static_cast<std::uint64_t>(i)), known, 16.0 * epsilon * std::abs(known));
        }
    }
    // In the unit interval they are equally likely.
    const Marginal marginal(values);
    EXPECT_EQ(marginal(0.3333), 3.0);
    EXPECT_EQ(marginal(0.3334), 1.0);
    EXPECT_EQ(marginal(0.6667), 2.0);
    EXPECT_EQ(marginal(1.0 - 1e-16), 2.0);
    EXPECT_EQ(marginal.share_within_bounds(), 1.0);
}

std::string refusal(const Factor& f) {
    return message_of<InputError>([&] { check(f); });
}

TEST(DesignFactors, WhatCannotBeIsRefusedByName) {
    const auto of = [](auto takes) { return Factor{.key = "ensemble.threshold", .takes = takes}; };
    for (const Factor& f : {of(Values{}),
                            of(Values{{1.0, nan}}),
                            of(Values{{inf}}),
                            of(Range{0.0, nan, 3}),
                            of(Range{0.0, 1.0, 1}),
                            of(Range{1.0, 1.0, 3}),
                            of(Range{-1e308, 1e308, 3}),
                            of(Range{0.0, 1.0, 3, Scale::log}),
                            of(Range{-1.0, 1.0, 3, Scale::log}),
                            of(Normal{nan, 1.0}),
                            of(Normal{0.0, 0.0}),
                            of(Normal{0.0, -1.0}),
                            of(Normal{0.0, nan}),
                            of(Normal{0.0, inf}),
                            of(Normal{0.0, 1e308}),
                            of(Uniform{1.0, 1.0}),
                            of(Uniform{2.0, 1.0}),
                            of(Uniform{nan, 1.0}),
                            of(Uniform{-1e308, 1e308}),
                            of(Lognormal{0.0, 0.1}),
                            of(Lognormal{1.0, 0.0}),
                            of(Lognormal{nan, 0.1}),
                            of(Lognormal{1.0, 1e-200}),
                            of(Lognormal{1.0, 1e300}),
                            of(Triangular{0.0, 2.0, 1.0}),
                            of(Triangular{0.0, nan, 1.0}),
                            of(Triangular{1.0, 1.0, 1.0})}) {
        EXPECT_THAT(refusal(f), HasSubstr("ensemble.threshold"));
    }
    EXPECT_THAT(refusal({.key = "", .takes = Values{{1.0}}}), HasSubstr("must name the key that it varies"));
    EXPECT_THAT(refusal({.key = "x", .takes = Values{{1.0, 3.0}}, .lower = 0.0, .upper = 2.0}),
                HasSubstr("the value 3 lies outside of the allowed range, 0 to 2"));
    EXPECT_THAT(refusal({.key = "x", .takes = Range{1.0, 3.0, 3}, .lower = 2.0}),
                HasSubstr("the value 1 lies outside"));
    EXPECT_THAT(refusal({.key = "x", .takes = Values{{1.0}}, .lower = 2.0, .upper = 1.0}), HasSubstr("not in order"));
    EXPECT_THAT(refusal({.key = "x", .takes = Values{{1.0}}, .lower = nan}), HasSubstr("not in order"));
    const Marginal marginal({.key = "x", .takes = Normal{}});
    for (const double u : {0.0, 1.0, -0.1, 1.1, nan}) EXPECT_THROW(marginal(u), InputError) << u;
    EXPECT_THROW(marginal(Probability{0.0, 1.0}), InputError);
    EXPECT_THROW(marginal(Probability{0.5, nan}), InputError);
}

TEST(DesignFactors, ADistributionOutsideOfItsBoundsIsRefused) {
    EXPECT_THAT(refusal({.key = "gain", .takes = Uniform{3.0, 4.0}, .lower = 0.0, .upper = 2.0}),
                HasSubstr("factor gain: only 0 of its distribution lies within the allowed range, 0 to 2"));
    for (const Factor& f : {Factor{.key = "x", .takes = Normal{0.0, 1.0}, .lower = 60.0},
                            Factor{.key = "x", .takes = Lognormal{1.0, 0.1}, .upper = 0.0},
                            Factor{.key = "x", .takes = Lognormal{1.0, 0.1}, .upper = -1.0},
                            Factor{.key = "x", .takes = Triangular{0.0, 1.0, 2.0}, .lower = 2.0},
                            Factor{.key = "x", .takes = Normal{0.0, 1.0}, .lower = 1.0, .upper = 1.0}}) {
        EXPECT_THAT(refusal(f), HasSubstr("lies within the allowed range"));
    }
    // 1 - Phi(2.3) = 0.0107, 1 - Phi(2.4) = 0.0082; the limit is 0.01.
    EXPECT_NO_THROW(check({.key = "x", .takes = Normal{0.0, 1.0}, .lower = 2.3}));
    EXPECT_THAT(refusal({.key = "x", .takes = Normal{0.0, 1.0}, .lower = 2.4}), HasSubstr("0.0082"));
}

TEST(DesignFactors, FactorsHaveKeysOfTheirOwn) {
    const std::vector<Factor> twice = {{.key = "a", .takes = Values{{1.0}}}, {.key = "a", .takes = Normal{}}};
    EXPECT_THAT(message_of<InputError>([&] { check(twice); }), HasSubstr("factor a: is given twice"));
    EXPECT_THROW(check(std::vector<Factor>{}), InputError);
}

}  // namespace
}  // namespace design_factors_test
}  // namespace ringlock::test
