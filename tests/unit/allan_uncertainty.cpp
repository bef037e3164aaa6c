#include <gtest/gtest.h>

#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "analysis/allan/interval.hpp"
#include "analysis/allan/quadratic_form.hpp"
#include "analysis/allan/statistics/degrees_of_freedom.hpp"
#include "analysis/allan/uncertainty.hpp"

namespace allan_uncertainty_test {
namespace {

using namespace ringlock;
using allan::Estimator;
using allan::WeightedSquares;

// Equal weights are chi-squared.
TEST(WeightedSquares, OfEqualWeightsAreChiSquared) {
    for (const double k : {1.0, 2.0, 5.0, 40.0}) {
        const WeightedSquares squares({{3.0, k}});
        EXPECT_NEAR(squares.mean(), 3.0 * k, 1e-12);
        EXPECT_NEAR(squares.degrees(), k, 1e-12);
        const boost::math::chi_squared chi2(k);
        for (const double p : {0.025, 0.1587, 0.5, 0.8413, 0.975}) {
            EXPECT_NEAR(boost::math::cdf(chi2, k * squares.quantile(p)), p, 1e-6) << k << " " << p;
        }
    }
}

// Damaged files declare any number of degrees of freedom: boost's series then ends with an error of its own.
TEST(ChiSquaredQuantile, HoldsForAnyDegreesOfFreedom) {
    for (const double p : {0.05, 0.16, 0.5, 0.84, 0.999}) {
        for (const double edf : {1e5, 1e6, 1e7}) {
            const double exact = boost::math::quantile(boost::math::chi_squared(edf), p) / edf;
            EXPECT_NEAR(allan::relative_chi_squared_quantile(edf, p), exact, 1e-11) << edf << " " << p;
        }
        for (const double edf : {1e12, 1e18, 1e29, 1e31, 1e300, std::numeric_limits<double>::infinity()}) {
            EXPECT_NEAR(allan::relative_chi_squared_quantile(edf, p), 1.0, 4.0 * std::sqrt(2.0 / edf)) << edf;
        }
    }
}

// Any others against draws, whose error is 0.0016.
TEST(LongWeightedSquares, QuantilesAreThoseOfDraws) {
    const std::vector<std::vector<WeightedSquares::Share>> cases = {{{1.0}, {0.3}, {0.1}},
                                                                    {{5.0}, {1.0, 20.0}},
                                                                    {{1.0}, {0.9}, {0.2, 3.0}, {0.01, 100.0}},
                                                                    {{0.125, 2.0}, {0.002, 380.0}},
                                                                    {{0.02, 2.0}, {0.0024, 400.0}}};
    for (const auto& shares : cases) {
        const WeightedSquares squares(shares);
        std::mt19937_64 random(5);
        std::normal_distribution<double> normal;
        constexpr int draws = 100'000;
        const std::vector<double> probabilities = {0.1587, 0.5, 0.8413};
        std::vector<int> below(probabilities.size());
        std::vector<double> quantiles;
        for (const double p : probabilities) quantiles.push_back(squares.quantile(p) * squares.mean());
        for (int d = 0; d < draws; ++d) {
            double sum = 0.0;
            for (const auto& [weight, count] : shares) {
                for (int i = 0; i < static_cast<int>(count); ++i) {
                    const double z = normal(random);
                    sum += weight * z * z;
                }
            }
            for (std::size_t i = 0; i < quantiles.size(); ++i) below[i] += sum <= quantiles[i] ? 1 : 0;
        }
        for (std::size_t i = 0; i < probabilities.size(); ++i) {
            EXPECT_NEAR(static_cast<double>(below[i]) / draws, probabilities[i], 0.006);
        }
    }
}

// Two ways to the same figure that share the autocovariance only: sums over lags, which leave out those beyond three or
// four tau, and eigenvalues.
TEST(QuadraticForm, DegreesAreThoseOfTheSumsOverLags) {
    struct Case {
        Estimator estimator;
        allan::EstimatorShape shape;
        double left_out = 0.006;
    };
    const std::vector<Case> cases = {{Estimator::oadev, {.differences = 2}},
                                     {Estimator::adev, {.differences = 2, .overlapping = false}},
                                     {Estimator::mdev, {.differences = 2, .modified = true}, 0.01},
                                     {Estimator::ohdev, {.differences = 3}},
                                     {Estimator::hdev, {.differences = 3, .overlapping = false}}};
    for (const Case& c : cases) {
        for (const int alpha : {2, 0, -1, -2}) {
            for (const std::int64_t m : {1, 2, 4, 8}) {
                const WeightedSquares squares = allan::distribution_of(c.estimator, alpha, m, 50);
                EXPECT_NEAR(squares.degrees() / allan::degrees_of_freedom(c.shape, alpha, m, 50), 1.0, c.left_out)
                    << allan::name(c.estimator) << " alpha " << alpha << " m " << m;
                EXPECT_NEAR(squares.mean(), 1.0, 1e-6);
            }
        }
    }
    EXPECT_NEAR(allan::distribution_of(Estimator::oadev, 0, 7, 15).degrees(), 1.0, 1e-9);
}

// The published corrections of the Hadamard total agree with its quadratic form to the last digit, those of the total
// deviation to a hundredth of the correction's length; of the modified total they are up to 0.06 off.
TEST(QuadraticForm, BiasesAreNearThePublishedOnes) {
    for (const int alpha : {0, -1, -2, -3, -4}) {
        EXPECT_NEAR(allan::distribution_of(Estimator::htotdev, alpha, 12, 160).mean(),
                    allan::published_bias(Estimator::htotdev, alpha, 12, 160), 0.002)
            << alpha;
    }
    for (const int alpha : {-1, -2}) {
        EXPECT_NEAR(allan::distribution_of(Estimator::totdev, alpha, 10, 101).mean(),
                    allan::published_bias(Estimator::totdev, alpha, 10, 101), 0.012)
            << alpha;
    }
    for (const int alpha : {2, 0, -1, -2}) {
        EXPECT_NEAR(allan::distribution_of(Estimator::mtotdev, alpha, 12, 160).mean(),
                    allan::published_bias(Estimator::mtotdev, alpha, 12, 160), 0.06)
            << alpha;
    }
}

// The total deviation of a record of many tau, whose degrees follow from those of sixteen: the ends matter less the
// longer it is.
TEST(Uncertainty, DegreesOfTheTotalDeviationAreThoseOfItsForm) {
    for (const int alpha : {2, 0, -1, -2}) {
        for (const std::int64_t m : {1, 2, 4, 8}) {
            const double exact = allan::distribution_of(Estimator::totdev, alpha, m, 64 * m + 1).degrees();
            EXPECT_NEAR(allan::uncertainty_of(Estimator::totdev, alpha, m, 64 * m + 1, 0.6827).edf / exact, 1.0, 0.015)
                << "alpha " << alpha << " m " << m;
        }
    }
}

// What short records stand for is there on long ones: nothing jumps where the one ends and the other begins. An eighth
// more tau is a fifth fewer degrees, and up to two fifths where few are left.
TEST(LongUncertainty, IsSmoothInTau) {
    for (const Estimator e : {Estimator::oadev, Estimator::mdev, Estimator::ohdev, Estimator::totdev,
                              Estimator::mtotdev, Estimator::htotdev}) {
        for (const int alpha : {0, -1, -2}) {
            double before = 0.0;
            double low_before = 0.0;
            for (std::int64_t m = 40; m <= 1300; m += m / 8) {
                const allan::Uncertainty u = allan::uncertainty_of(e, alpha, m, 4001, 0.6827);
                EXPECT_LT(u.low, 1.0);
                EXPECT_GT(u.high, 1.0);
                if (before > 0.0) {
                    EXPECT_LT(u.edf, before * 1.02) << allan::name(e) << " alpha " << alpha << " m " << m;
                    EXPECT_GT(u.edf, before * 0.6) << allan::name(e) << " alpha " << alpha << " m " << m;
                    EXPECT_NEAR(u.low, low_before, 0.2) << allan::name(e) << " alpha " << alpha << " m " << m;
                }
                before = u.edf;
                low_before = u.low;
            }
        }
    }
}

}  // namespace
}  // namespace allan_uncertainty_test
