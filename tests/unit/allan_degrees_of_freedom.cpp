#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "analysis/allan/statistics/degrees_of_freedom.hpp"

namespace allan_degrees_of_freedom_test {
namespace {

using ringlock::allan::degrees_of_freedom;
using ringlock::allan::EstimatorShape;

/// Weights of one second difference on white noise of the phase (alpha 2) or of its first (0) or second (-2)
/// difference.
std::vector<double> weights(int alpha, int m) {
    std::vector<double> w(2 * m + 1, 0.0);
    w[0] = 1.0;
    w[m] = -2.0;
    w[2 * m] = 1.0;
    for (int sums = 0; sums < (2 - alpha) / 2; ++sums) {  // x is a running sum of the noise: weights become tail sums
        for (std::size_t i = w.size() - 1; i-- > 0;) w[i] += w[i + 1];
    }
    return w;
}

/// edf = (sum_i C_ii)^2 / sum_ij C_ij^2 with the covariance of the terms from the weights.
double exact(int alpha, int m, int points, int stride) {
    const std::vector<double> w = weights(alpha, m);
    const int terms = (points - 1 - 2 * m) / stride + 1;
    std::vector<double> c;
    for (int lag = 0; lag < terms; ++lag) {
        double sum = 0.0;
        for (std::size_t i = 0; i + static_cast<std::size_t>(lag * stride) < w.size(); ++i)
            sum += w[i] * w[i + lag * stride];
        c.push_back(sum);
    }
    double total = terms * c[0] * c[0];
    for (int lag = 1; lag < terms; ++lag) total += 2.0 * (terms - lag) * c[lag] * c[lag];
    return std::pow(terms * c[0], 2) / total;
}

// White phase and white frequency noise are exact for sampled data. A random walk is continuous: its oracle sums 64
// steps within each sample.
TEST(AllanDegreesOfFreedom, EqualExactCovarianceSums) {
    constexpr int finer = 64;
    for (const bool overlapping : {true, false}) {
        const EstimatorShape shape{.differences = 2, .modified = false, .overlapping = overlapping};
        for (const int m : {1, 2, 3, 8, 20}) {
            const int stride = overlapping ? 1 : m;
            for (const int points : {2 * m + 1, 3 * m + 2, 64, 301}) {
                for (const int alpha : {2, 0}) {
                    const double oracle = exact(alpha, m, points, stride);
                    EXPECT_NEAR(degrees_of_freedom(shape, alpha, m, points), oracle, 1e-9 * oracle)
                        << alpha << ' ' << m << ' ' << points;
                }
                const double oracle = exact(-2, m * finer, (points - 1) * finer + 1, stride * finer);
                EXPECT_NEAR(degrees_of_freedom(shape, -2, m, points), oracle, 1e-3 * oracle) << m << ' ' << points;
            }
        }
    }
}

// A bounded number of starts in a tau: white noises by the same oracle, at the stride that follows.
TEST(AllanDegreesOfFreedom, BoundedStartsEqualExactCovarianceSums) {
    for (const int starts : {1, 4, 8}) {
        const EstimatorShape shape{.starts_per_tau = starts};
        for (const int m : {1, 2, 4, 8, 16, 64}) {
            const int stride = m > starts ? m / starts : 1;
            for (const int points : {2 * m + 1, 2 * m + 2, 3 * m + 2, 301}) {
                for (const int alpha : {2, 0}) {
                    const double oracle = exact(alpha, m, points, stride);
                    EXPECT_NEAR(degrees_of_freedom(shape, alpha, m, points), oracle, 1e-9 * oracle)
                        << alpha << ' ' << m << ' ' << points << ' ' << starts;
                }
            }
        }
    }
    EXPECT_THROW(degrees_of_freedom({.starts_per_tau = 8}, 0, 12, 100), std::domain_error);
}

// Long averaging: blocks of lags instead of single ones.
TEST(AllanDegreesOfFreedom, LongTausStayAccurate) {
    const EstimatorShape shape;
    for (const int points : {2 * 1500 + 1, 2 * 1500 + 400, 15000}) {
        const double oracle = exact(0, 1500, points, 1);
        EXPECT_NEAR(degrees_of_freedom(shape, 0, 1500, points), oracle, 1e-3 * oracle) << points;
    }
}

// The redder the noise, the fewer degrees of freedom.
TEST(AllanDegreesOfFreedom, FlickerLiesBetweenItsNeighbours) {
    const EstimatorShape shape;
    for (const std::int64_t m : {1, 10, 100, 1000, 100000}) {
        const std::int64_t points = 50 * m + 1;
        const double white_phase = degrees_of_freedom(shape, 2, m, points);
        const double flicker_phase = degrees_of_freedom(shape, 1, m, points);
        const double white = degrees_of_freedom(shape, 0, m, points);
        const double flicker = degrees_of_freedom(shape, -1, m, points);
        const double walk = degrees_of_freedom(shape, -2, m, points);
        if (m > 8) {
            EXPECT_GT(white_phase, flicker_phase) << m;
            EXPECT_GT(flicker_phase, white) << m;
            EXPECT_GT(white, flicker) << m;
        }
        EXPECT_GT(flicker, walk * 0.8) << m;
        EXPECT_LT(white, 2.0 * 49.0 + 2.0) << m;
    }
}

TEST(AllanDegreesOfFreedom, OneTermHasOneDegree) {
    for (const int alpha : {2, 1, 0, -1, -2}) EXPECT_NEAR(degrees_of_freedom({}, alpha, 50, 101), 1.0, 1e-12) << alpha;
}

TEST(AllanDegreesOfFreedom, RefusesWhatHasNoVariance) {
    EXPECT_THROW(degrees_of_freedom({}, -3, 1, 100), std::domain_error);
    EXPECT_THROW(degrees_of_freedom({}, 3, 1, 100), std::domain_error);
    EXPECT_THROW(degrees_of_freedom({}, 0, 50, 100), std::domain_error);
}

}  // namespace
}  // namespace allan_degrees_of_freedom_test
