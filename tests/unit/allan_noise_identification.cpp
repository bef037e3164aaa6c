#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/statistics/noise_identification.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_noise_identification_test {
namespace {

using namespace ringlock;
using allan::Estimator;

constexpr std::size_t increments = 1024;
constexpr int records = 1000;

/// Share of the records in which the program tells this noise at one averaging factor.
double share_told(const test::Truth& truth, std::int64_t m, int alpha, std::uint64_t seed) {
    const std::array<std::int64_t, 1> factor = {m};
    double share = 0.0;
    for (std::uint64_t k = 0; k < records; ++k) {
        const auto phase = test::simulate_angle(truth, increments, 1.0, seed + k);
        share += allan::deviation(Estimator::oadev, phase, 1.0, factor)[0].alpha == alpha ? 1.0 / records : 0.0;
    }
    return share;
}

// What the test between octaves goes by: 2/sqrt(n) for the white noises (Riley and Greenhall: a lag-1 correlation r of
// independent samples has variance 1/n, the exponent is 2 - 2d - 2r/(1 + r)), 2.8/sqrt(n) for flicker, by simulation.
// 1000 records know a standard deviation to 2.2 %: three standard errors.
TEST(LongNoiseIdentification, ErrorsOfExponentsAreThoseOfTheirPoints) {
    struct Case {
        test::Truth truth;
        double deviation;
    };
    for (const Case& c : {Case{{.q = 1.0}, 2.0}, Case{{.n = 1.0}, 2.0}, Case{{.b = 1.0}, 2.8}}) {
        for (const std::int64_t m : {1, 4}) {
            double sum = 0.0;
            double squares = 0.0;
            for (std::uint64_t k = 0; k < records; ++k) {
                const double e = *allan::noise_exponent(test::simulate_angle(c.truth, 2048, 1.0, 20'000 + k), m);
                sum += e / records;
                squares += e * e / records;
            }
            const double points = 2048.0 / static_cast<double>(m);
            EXPECT_NEAR(std::sqrt((squares - sum * sum) * points) / c.deviation, 1.0, 0.07) << c.deviation << ' ' << m;
        }
    }
}

// One kind of noise, 129, 65 and 33 points. Bounds are three standard errors (1 % or less) below what 5000 records of
// other seeds show. An exponent by itself and with the octave below tells flicker in 88, 93 and 83 %.
TEST(LongNoiseIdentification, FewPointsTellTheNoiseOfTheirRecord) {
    struct Case {
        test::Truth truth;
        int alpha;
        std::array<double, 3> least;
    };
    for (const Case& c : {Case{{.q = 1.0}, 2, {0.99, 0.99, 0.985}}, Case{{.n = 1.0}, 0, {0.99, 0.985, 0.95}},
                          Case{{.b = 1.0}, -1, {0.98, 0.945, 0.885}}, Case{{.k = 1.0}, -2, {0.99, 0.99, 0.985}}}) {
        std::int64_t m = 8;
        for (const double least : c.least) {
            EXPECT_GE(share_told(c.truth, m, c.alpha, 30'000), least) << "alpha " << c.alpha << " m " << m;
            m *= 2;
        }
    }
}

// Octaves are not pooled across a change: the variances of white noise and random walk are equal at m = 4, at m = 1 the
// one has 94 % and at m = 16 the other.
TEST(NoiseIdentification, FollowsNoiseThatChangesWithTau) {
    const test::Truth truth{.n = 1.0, .k = std::sqrt(3.0) / 4.0};
    EXPECT_GE(share_told(truth, 1, 0, 40'000), 0.8);
    EXPECT_GE(share_told(truth, 8, -2, 40'000), 0.8);
    EXPECT_GE(share_told(truth, 16, -2, 40'000), 0.94);
    EXPECT_GE(share_told(truth, 32, -2, 40'000), 0.95);
}

// From 200 points on nothing is taken in.
TEST(NoiseIdentification, ManyPointsStandAlone) {
    const auto phase = test::simulate_angle({.n = 1.0, .k = 0.4}, 4096, 1.0, 7);
    for (const std::int64_t m : {1, 2, 4, 8, 16}) {
        EXPECT_EQ(allan::pooled_noise_exponent(phase, m), allan::noise_exponent(phase, m)) << m;
    }
    EXPECT_NE(allan::pooled_noise_exponent(phase, 64), allan::noise_exponent(phase, 64));
}

}  // namespace
}  // namespace allan_noise_identification_test
