#include <gtest/gtest.h>

#include <cmath>

#include "analysis/noise/interval.hpp"
#include "analysis/noise/model/subsets.hpp"
#include "tests/unit/allan_losses.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_noise_interval_test {
namespace {

using namespace ringlock;
using namespace ringlock::noise;

bool at_bound(const Maximum& from, const Maximum& there) {
    return (from.theta[quantisation] > 0.0 && !(there.theta[quantisation] > 0.0)) ||
           (from.theta[flicker] > 0.0 && !(there.theta[flicker] > 0.0));
}

// Where white noise and a random walk are all there is, angle noise and flicker are in half of the fits by chance, and
// take from the white noise what a profile cannot give back beyond their bound.
TEST(AllanNoiseInterval, UpperEndIsAsFarAsTheCurvatureSaysWhereANeighbourReachesItsBound) {
    const test::Truth truth{.n = 0.3, .k = 0.03};
    int bounded = 0;
    for (int record = 0; record < 60; ++record) {
        const Spectrum spectrum =
            cosine_spectrum(test::rates_of_angle(test::simulate_angle(truth, 1500, 1.0, 41000 + record)));
        const Likelihood likelihood(spectrum);
        Model model = model_of(five_terms);
        model.restricted = true;
        const Maximum best = likelihood.maximise(model);
        const double variance = best.theta[angle_random_walk];
        const double spread = std::sqrt(best.covariance[angle_random_walk][angle_random_walk]) / variance;
        const Ends ends = central_interval(likelihood, model, best, angle_random_walk);
        EXPECT_LT(ends.lo, variance);
        EXPECT_GT(ends.hi, variance);
        const Maximum there = likelihood.maximise(model, &best.theta, angle_random_walk, ends.hi);
        if (!at_bound(best, there)) continue;
        ++bounded;
        EXPECT_GE(ends.hi, variance * std::exp(spread) * (1.0 - 1e-12)) << record;
    }
    EXPECT_GE(bounded, 10);
}

// No neighbour, no bound: white noise of few degrees of freedom keeps the quantiles of chi-squared.
TEST(AllanNoiseInterval, OneVarianceOfFewDegreesHasTheEndsOfItsChiSquared) {
    const Spectrum spectrum =
        cosine_spectrum(test::rates_of_angle(test::simulate_angle(test::Truth{.n = 0.3}, 48, 1.0, 7)));
    const Likelihood likelihood(spectrum);
    Model model;
    model.has[angle_random_walk] = true;
    const Maximum best = likelihood.maximise(model);
    const Ends ends = central_interval(likelihood, model, best, angle_random_walk);
    // Quantiles 0.1587 and 0.8413 of chi-squared with 47 degrees of freedom, by scipy.stats.chi2.ppf.
    constexpr double below = 37.374;
    constexpr double above = 56.627;
    EXPECT_NEAR(best.theta[angle_random_walk] / ends.hi, below / 47.0, 0.02);
    EXPECT_NEAR(best.theta[angle_random_walk] / ends.lo, above / 47.0, 0.02);
}

}  // namespace
}  // namespace allan_noise_interval_test
