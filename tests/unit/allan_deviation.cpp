#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/interval.hpp"
#include "analysis/allan/statistics/noise_identification.hpp"
#include "engine/core/error.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_deviation_test {
namespace {

using namespace ringlock;
using allan::Estimator;
using allan::Kind;

std::vector<std::string> printed(Estimator e, const std::vector<double>& phase, std::vector<std::int64_t> m,
                                 int digits) {
    std::vector<std::string> out;
    for (const auto& p : allan::deviation(e, phase, 1.0, m)) out.push_back(fmt::format("{:.{}e}", p.dev, digits));
    return out;
}

/// Straight from the definition, in long double, without centring.
long double plain_definition(const std::vector<double>& phase, std::int64_t m, std::int64_t stride, double tau0) {
    long double sum = 0.0L;
    std::int64_t terms = 0;
    for (std::int64_t i = 0; i + 2 * m < static_cast<std::int64_t>(phase.size()); i += stride, ++terms) {
        const long double z = static_cast<long double>(phase[i + 2 * m]) - 2.0L * phase[i + m] + phase[i];
        sum += z * z;
    }
    return std::sqrt(sum / (2.0L * terms)) / (static_cast<long double>(m) * tau0);
}

// Many degrees of freedom are taken by an expansion, few by inversion: both are the chi-squared interval. 1e-12: what
// is left out of the expansion, and the inversion's own rounding.
TEST(AllanDeviation, IntervalsAreChiSquared) {
    for (const double confidence : {0.5, 0.6827, 0.95, 0.999}) {
        for (const double edf : {0.7, 1.0, 40.0, 9.9e4, 1e5, 3e6, 2e8}) {
            allan::Point p;
            p.dev = 2.0;
            p.edf = edf;
            allan::set_interval(p, confidence);
            const boost::math::chi_squared chi2(edf);
            const double lo = 2.0 * std::sqrt(edf / boost::math::quantile(chi2, 0.5 + 0.5 * confidence));
            const double hi = 2.0 * std::sqrt(edf / boost::math::quantile(chi2, 0.5 - 0.5 * confidence));
            EXPECT_NEAR(p.lo, lo, 1e-12 * lo) << edf;
            EXPECT_NEAR(p.hi, hi, 1e-12 * hi) << edf;
        }
    }
}

// Published figures: W. Riley, "The calculation of time domain frequency stability", tables II and III; NIST SP1065
// tables 30, 31.
TEST(AllanDeviation, Nbs14TenPointsMatchPublishedFigures) {
    const std::vector<double> frequency = {892, 809, 823, 798, 671, 644, 883, 903, 677};
    const auto from_rate = allan::centred_phase(frequency, Kind::rate, 1.0);
    EXPECT_THAT(printed(Estimator::adev, from_rate, {1, 2}, 6), testing::ElementsAre("9.122945e+01", "1.158082e+02"));
    EXPECT_THAT(printed(Estimator::oadev, from_rate, {1, 2}, 6), testing::ElementsAre("9.122945e+01", "8.595287e+01"));
    const std::vector<double> phase = {0.00000,  103.11111, 123.22222, 157.33333, 166.44444,
                                       48.55555, -96.33333, -2.22222,  111.88889, 0.00000};
    const auto from_phase = allan::centred_phase(phase, Kind::phase, 1.0);
    EXPECT_THAT(printed(Estimator::oadev, from_phase, {1, 2}, 5), testing::ElementsAre("9.12294e+01", "8.59529e+01"));
}

TEST(AllanDeviation, Sp1065ThousandPointsMatchPublishedFigures) {
    const auto phase = allan::centred_phase(test::sp1065_frequencies(), Kind::rate, 1.0);
    EXPECT_THAT(printed(Estimator::oadev, phase, {1, 10, 100}, 6),
                testing::ElementsAre("2.922319e-01", "9.159953e-02", "3.241343e-02"));
    EXPECT_THAT(printed(Estimator::adev, phase, {1, 10, 100}, 6),
                testing::ElementsAre("2.922319e-01", "9.965736e-02", "3.897804e-02"));
}

TEST(AllanDeviation, AgreesWithTheDefinitionInLongDouble) {
    const auto phase = test::simulate_angle({.q = 0.3, .n = 1.0, .k = 0.01}, 2000, 0.1, 5);
    const auto factors = allan::all_factors(allan::largest_factor(Estimator::oadev, 2001));
    ASSERT_EQ(factors.back(), 1000);
    const auto centred = allan::centred_phase(phase, Kind::phase, 0.1);
    for (const auto e : {Estimator::oadev, Estimator::adev}) {
        for (const auto& p : allan::deviation(e, centred, 0.1, factors)) {
            const auto oracle = static_cast<double>(plain_definition(phase, p.m, e == Estimator::adev ? p.m : 1, 0.1));
            ASSERT_NEAR(p.dev, oracle, 1e-12 * oracle) << allan::name(e) << " m " << p.m;
        }
    }
}

// A counter at 10 MHz: whole counts, exact in double up to 2^53, so the answer is known exactly.
TEST(AllanDeviation, LargeOffsetsLoseNoDigits) {
    random::NormalStream g({11, 0}, random::Purpose::bootstrap);
    std::vector<double> increments;
    std::vector<double> counts{4e15};
    for (int i = 0; i < 20000; ++i) {
        increments.push_back(1e7 + std::round(3.0 * g()));
        counts.push_back(counts.back() + increments.back());
    }
    const auto from_counts = allan::centred_phase(counts, Kind::phase, 1.0);
    const auto from_increments = allan::centred_phase(increments, Kind::increment, 1.0);
    const std::vector<std::int64_t> m = {1, 7, 100, 3000};
    const auto a = allan::deviation(Estimator::oadev, from_counts, 1.0, m);
    const auto b = allan::deviation(Estimator::oadev, from_increments, 1.0, m);
    for (std::size_t i = 0; i < m.size(); ++i) {
        const auto oracle = static_cast<double>(plain_definition(counts, m[i], 1, 1.0));
        EXPECT_NEAR(a[i].dev, oracle, 1e-13 * oracle) << m[i];
        EXPECT_NEAR(b[i].dev, oracle, 1e-13 * oracle) << m[i];
    }
}

TEST(AllanDeviation, IsBlindToOffsetAndSlopeAndScales) {
    const auto angle = test::simulate_angle({.n = 1.0}, 500, 1.0, 3);
    std::vector<double> changed;
    for (std::size_t i = 0; i < angle.size(); ++i)
        changed.push_back(-2.0 * angle[i] + 1e5 + 50.0 * static_cast<double>(i));
    const std::vector<std::int64_t> m = {1, 3, 50};
    const auto a = allan::deviation(Estimator::oadev, allan::centred_phase(angle, Kind::phase, 1.0), 1.0, m);
    const auto b = allan::deviation(Estimator::oadev, allan::centred_phase(changed, Kind::phase, 1.0), 1.0, m);
    for (std::size_t i = 0; i < m.size(); ++i) EXPECT_NEAR(b[i].dev, 2.0 * a[i].dev, 1e-9 * a[i].dev);
}

// sigma^2 = 3Q^2/tau^2 + N^2/tau + 0.4413 B^2 + K^2 tau/3 + R^2 tau^2/2: each term alone, mean over records.
TEST(AllanDeviation, EachNoiseHasItsLevelAndIsIdentified) {
    struct Case {
        test::Truth truth;
        int alpha;
    };
    const std::vector<Case> cases = {{{.q = 0.7}, 2}, {{.n = 0.7}, 0}, {{.b = 0.7}, -1}, {{.k = 0.7}, -2}};
    constexpr int records = 200;
    constexpr double tau0 = 0.5;
    const std::vector<std::int64_t> factors = {1, 4, 16};
    for (const Case& c : cases) {
        std::vector<double> variance(factors.size());
        int identified = 0;
        for (int k = 0; k < records; ++k) {
            const auto phase = test::simulate_angle(c.truth, 2048, tau0, 100 + k);
            const auto points = allan::deviation(Estimator::oadev, phase, tau0, factors);
            for (std::size_t i = 0; i < factors.size(); ++i) variance[i] += points[i].dev * points[i].dev / records;
            identified += points[1].alpha == c.alpha ? 1 : 0;
        }
        for (std::size_t i = 0; i < factors.size(); ++i) {
            const double tau = tau0 * static_cast<double>(factors[i]);
            const auto& t = c.truth;
            const double expected = 3 * t.q * t.q / (tau * tau) + t.n * t.n / tau +
                                    2 * std::numbers::ln2 / std::numbers::pi * t.b * t.b + t.k * t.k * tau / 3;
            EXPECT_NEAR(variance[i] / expected, 1.0, 0.03) << "alpha " << c.alpha << " tau " << tau;
        }
        EXPECT_GE(identified, records * 9 / 10) << "alpha " << c.alpha;
    }
}

// What Riley and Greenhall's formula gives for means of a continuous process: not -1 and -2. Standard errors of the
// means of 300 records: 0.006 to 0.01.
TEST(AllanDeviation, ExponentsOfContinuousNoiseAreNotThoseOfIndependentSamples) {
    struct Case {
        test::Truth truth;
        double exponent;
        int alpha;
    };
    for (const Case& c : {Case{{.q = 1.0}, 2.0, 2}, Case{{.n = 1.0}, 0.0, 0}, Case{{.b = 1.0}, -1.45, -1},
                          Case{{.k = 1.0}, -2.40, -2}}) {
        double mean = 0.0;
        for (int k = 0; k < 300; ++k) {
            mean += *allan::noise_exponent(test::simulate_angle(c.truth, 2048, 1.0, 700 + k), 4) / 300.0;
        }
        EXPECT_NEAR(mean, c.exponent, 0.04) << c.alpha;
        EXPECT_EQ(allan::nearest_noise(mean), c.alpha);
    }
}

TEST(AllanDeviation, IntervalsCoverWhatTheySay) {
    constexpr int records = 4000;
    constexpr std::size_t n = 512;
    const std::vector<std::int64_t> factors = {1, 4, 16, 64};
    std::vector<int> covered(factors.size());
    for (int k = 0; k < records; ++k) {
        const auto phase = test::simulate_angle({.n = 1.0}, n, 1.0, 5000 + k);
        const auto points = allan::deviation(Estimator::oadev, phase, 1.0, factors);
        for (std::size_t i = 0; i < factors.size(); ++i) {
            const double truth = 1.0 / std::sqrt(points[i].tau_s);
            covered[i] += points[i].lo <= truth && truth <= points[i].hi ? 1 : 0;
        }
    }
    for (std::size_t i = 0; i < factors.size(); ++i) {
        const double share = static_cast<double>(covered[i]) / records;
        RecordProperty("coverage_m" + std::to_string(factors[i]), std::to_string(share));
        EXPECT_GE(share, 0.64) << factors[i];
        EXPECT_LE(share, 0.72) << factors[i];
    }
}

TEST(AllanDeviation, FactorListsAndErrors) {
    EXPECT_THAT(allan::octave_factors(9), testing::ElementsAre(1, 2, 4, 8));
    EXPECT_THAT(allan::decade_factors(45), testing::ElementsAre(1, 2, 4, 10, 20, 40));
    EXPECT_EQ(allan::largest_factor(Estimator::oadev, 11), 5);
    const std::vector<double> phase(11, 0.0);
    const std::vector<std::int64_t> six = {6};
    EXPECT_THROW(allan::deviation(Estimator::oadev, phase, 1.0, six), InputError);
    const std::vector<std::int64_t> five = {5};
    EXPECT_THROW(allan::deviation(Estimator::oadev, phase, 0.0, five), InputError);
    EXPECT_THROW(allan::deviation(Estimator::oadev, phase, 1.0, five, {.confidence = 1.0}), InputError);
    const auto flat = allan::deviation(Estimator::oadev, phase, 1.0, five);
    EXPECT_EQ(flat[0].terms, 1);
    EXPECT_EQ(flat[0].dev, 0.0);
    EXPECT_EQ(flat[0].hi, 0.0);
}

}  // namespace
}  // namespace allan_deviation_test
