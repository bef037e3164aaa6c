#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/sums/phase.hpp"
#include "analysis/noise/fit.hpp"
#include "analysis/stability/density.hpp"
#include "analysis/stability/dynamic.hpp"
#include "analysis/stability/three_cornered_hat.hpp"
#include "tests/unit/allan_support.hpp"

namespace stability_test {
namespace {

using namespace ringlock;

std::vector<double> rates_of(const std::vector<double>& angle, double tau0_s) {
    std::vector<double> out;
    for (std::size_t i = 1; i < angle.size(); ++i) out.push_back((angle[i] - angle[i - 1]) / tau0_s);
    return out;
}

double mean_density(const std::vector<stability::DensityPoint>& points) {
    double sum = 0.0;
    for (const auto& p : points) sum += p.density;
    return sum / static_cast<double>(points.size());
}

// White noise N arcsec/sqrt(s) has the two-sided density N^2, whatever the sampling rate. The means over all
// frequencies have about the relative standard error sqrt(2/n) = 1.1 % (Welch's windows lose a little more): four of
// them allowed.
TEST(Stability, WhiteNoiseHasTheDensityOfItsCoefficient) {
    for (const double tau0_s : {0.01, 2.0}) {
        const auto rates = rates_of(test::simulate_angle({.n = 0.3}, 16384, tau0_s, 5), tau0_s);
        const auto welch = stability::welch_density(rates, tau0_s, 256);
        EXPECT_NEAR(mean_density(welch), 0.09, 0.09 * 0.05);
        EXPECT_EQ(welch.size(), 128U);
        EXPECT_DOUBLE_EQ(welch.back().frequency_hz, 0.5 / tau0_s);
        EXPECT_EQ(welch.front().count, 127U);  // 16384 samples, a segment of 256 begins at every 128th
        double sum = 0.0;
        double count = 0.0;
        for (const auto& p : stability::cosine_density(rates, tau0_s)) {
            sum += p.density * static_cast<double>(p.count);
            count += static_cast<double>(p.count);
        }
        EXPECT_NEAR(sum / count, 0.09, 0.09 * 0.05);
    }
}

// A line of amplitude A in the middle of a cell of frequency puts A^2/4 into either side; with a Hann window the line
// itself has 2/3 of the power that its three cells have together (1, 1/4 and 1/4 squared amplitudes).
TEST(Stability, ALineHasItsPowerInThreeCellsOfTheHannWindow) {
    constexpr std::size_t segment = 64;
    std::vector<double> rate(512);
    for (std::size_t i = 0; i < rate.size(); ++i) {
        rate[i] = 7.0 + 3.0 * std::sin(2.0 * std::numbers::pi * 10.0 * static_cast<double>(i) / segment + 0.4);
    }
    const auto points = stability::welch_density(rate, 0.5, segment);
    const double cell_hz = 1.0 / (segment * 0.5);
    const double power = cell_hz * (points[8].density + points[9].density + points[10].density);
    EXPECT_NEAR(power, 9.0 / 4.0, 1e-9);
    EXPECT_NEAR(cell_hz * points[9].density, 2.0 / 3.0 * power, 1e-9);
    EXPECT_NEAR(points[20].density, 0.0, 1e-18);
}

TEST(Stability, SegmentsWithMissingValuesAreLeftOut) {
    std::vector<double> rate(1024, 1.0);
    for (std::size_t i = 0; i < rate.size(); ++i) rate[i] = std::sin(0.1 * static_cast<double>(i * i % 97));
    rate[500] = std::numeric_limits<double>::quiet_NaN();
    const auto points = stability::welch_density(rate, 1.0, 128);
    ASSERT_FALSE(points.empty());
    EXPECT_EQ(points.front().count, 13U);  // of 15, those from 384 and from 448 have it
    for (const auto& p : points) EXPECT_TRUE(std::isfinite(p.density));
    EXPECT_TRUE(stability::welch_density(std::span(rate).subspan(490, 30), 1.0, 30).empty());
}

// The model has the density of each term as docs/dev/allan-coefficients.md writes it, far below the sampling rate,
// where neither averaging nor aliases count: N^2, B^2/(2 pi f), K^2/(2 pi f)^2.
TEST(Stability, TheModelHasTheDensitiesOfItsTerms) {
    constexpr double tau0_s = 0.1;
    const std::vector<double> f = {1e-3};
    const auto with = [](double value) {
        return noise::Coefficient{.resolved = true, .value = value, .lo = 0.0, .hi = 0.0};
    };
    noise::NoiseFit n;
    n.arw_deg_rt_h = with(0.005);  // 0.3 arcsec/sqrt(s)
    EXPECT_NEAR(stability::model_density(n, tau0_s, f)[0], 0.09, 1e-12);
    noise::NoiseFit b;
    b.bias_instability_deg_h = with(0.2);
    EXPECT_NEAR(stability::model_density(b, tau0_s, f)[0], 0.04 / (2.0 * std::numbers::pi * 1e-3), 0.01);
    noise::NoiseFit k;
    k.rrw_deg_h_rt_h = with(6.0);  // 0.1 arcsec/s/sqrt(s)
    EXPECT_NEAR(stability::model_density(k, tau0_s, f)[0], 0.01 / std::pow(2.0 * std::numbers::pi * 1e-3, 2), 1e-3);
    noise::NoiseFit q;
    q.quantization_arcsec = with(0.5);
    EXPECT_NEAR(stability::model_density(q, tau0_s, f)[0], tau0_s * std::pow(2.0 * std::numbers::pi * 1e-3 * 0.5, 2),
                1e-9);
}

std::vector<allan::Point> deviations(const std::vector<double>& a, const std::vector<double>& b) {
    std::vector<double> difference(a.size());
    for (std::size_t i = 0; i < a.size(); ++i) difference[i] = a[i] - b[i];
    const auto phase = allan::phase_of(difference, allan::Kind::rate, 1.0);
    return allan::deviation(allan::Estimator::oadev, phase, 1.0, std::vector<std::int64_t>{1, 8, 64});
}

// Three independent white noises; the standard error is that of many such records: of 200 estimates at each averaging
// time the scatter over the stated error is within 5/sqrt(400) of 1, and the mean within 4 of its errors of the truth.
TEST(Stability, TheHatFindsEachOfThreeAndItsError) {
    constexpr int records = 200;
    const std::vector<double> truth = {1.0, 2.0, 0.5};
    std::vector<std::vector<double>> estimates(9);
    std::vector<double> errors(9);
    for (int seed = 0; seed < records; ++seed) {
        std::vector<std::vector<double>> rate;
        for (std::size_t i = 0; i < 3; ++i) {
            const auto stream = static_cast<std::uint64_t>(3 * seed) + i + 1;
            rate.push_back(rates_of(test::simulate_angle({.n = truth[i]}, 1000, 1.0, stream), 1.0));
        }
        const auto points = stability::three_cornered_hat(deviations(rate[0], rate[1]), deviations(rate[0], rate[2]),
                                                          deviations(rate[1], rate[2]));
        ASSERT_EQ(points.size(), 3U);
        for (std::size_t t = 0; t < 3; ++t) {
            for (std::size_t i = 0; i < 3; ++i) {
                estimates[3 * t + i].push_back(points[t].variance[i] * points[t].tau_s);
                errors[3 * t + i] += points[t].standard_error[i] * points[t].tau_s / records;
            }
        }
    }
    for (std::size_t k = 0; k < estimates.size(); ++k) {
        const auto& e = estimates[k];
        const double mean = std::accumulate(e.begin(), e.end(), 0.0) / records;
        double scatter = 0.0;
        for (const double v : e) scatter += (v - mean) * (v - mean) / (records - 1);
        scatter = std::sqrt(scatter);
        EXPECT_NEAR(mean, truth[k % 3] * truth[k % 3], 4.0 * scatter / std::sqrt(records)) << k;
        EXPECT_NEAR(scatter / errors[k], 1.0, 0.25) << k;
    }
}

TEST(Stability, TheHatReportsNegativeVariancesAndSkipsMissingFactors) {
    const auto point = [](std::int64_t m, double dev) {
        return allan::Point{.m = m, .tau_s = static_cast<double>(m), .dev = dev, .edf = 10.0};
    };
    const std::vector<allan::Point> ab = {point(1, 3.0), point(2, 1.0)};
    const std::vector<allan::Point> ac = {point(1, 1.0)};
    const std::vector<allan::Point> bc = {point(1, 1.0), point(2, 1.0)};
    const auto hat = stability::three_cornered_hat(ab, ac, bc);
    ASSERT_EQ(hat.size(), 1U);
    EXPECT_DOUBLE_EQ(hat[0].variance[0], 4.5);
    EXPECT_DOUBLE_EQ(hat[0].variance[1], 4.5);
    EXPECT_DOUBLE_EQ(hat[0].variance[2], -3.5);
    EXPECT_DOUBLE_EQ(hat[0].standard_error[2], std::sqrt((1.0 + 3.5 * 3.5) / 10.0));
}

// A window by itself is a record by itself.
TEST(Stability, WindowsHaveTheDeviationsOfTheirPartOfTheRecord) {
    auto rate = rates_of(test::simulate_angle({.n = 1.0}, 1000, 0.5, 3), 0.5);
    for (std::size_t i = 600; i < rate.size(); ++i) rate[i] *= 4.0;
    rate[50] = std::numeric_limits<double>::quiet_NaN();
    const stability::Windows windows = stability::windows_of(200, rate.size(), 400);
    EXPECT_EQ(windows.step, 100U);
    const auto found =
        stability::dynamic_deviation(allan::Estimator::oadev, rate, {}, allan::Kind::rate, 0.5, 1.0, windows, {});
    ASSERT_EQ(found.size(), 9U);
    EXPECT_DOUBLE_EQ(found[8].begin_s, 400.0);
    EXPECT_DOUBLE_EQ(found[8].end_s, 500.0);
    const std::vector<double> part(rate.begin() + 300, rate.begin() + 500);
    const auto phase = allan::phase_of(part, allan::Kind::rate, 0.5);
    const auto alone =
        allan::deviation(allan::Estimator::oadev, phase, 0.5, std::vector<std::int64_t>{1, 2, 4, 8, 16, 32});
    ASSERT_EQ(found[3].points.size(), alone.size());
    for (std::size_t i = 0; i < alone.size(); ++i) EXPECT_DOUBLE_EQ(found[3].points[i].dev, alone[i].dev);
    EXPECT_GT(found[7].points[0].dev, 3.0 * found[3].points[0].dev);
    EXPECT_LT(found[0].points[0].terms, alone[0].terms);
}

TEST(Stability, LongRecordsHaveNoMoreWindowsThanAsked) {
    for (const std::size_t intervals : {200UL, 1000UL, 100'000UL, 99'999UL}) {
        const stability::Windows w = stability::windows_of(200, intervals, 40);
        EXPECT_LE((intervals - 200) / w.step + 1, 40U) << intervals;
        EXPECT_GE(w.step, 100U);
    }
}

}  // namespace
}  // namespace stability_test
