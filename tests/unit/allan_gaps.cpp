#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "tests/unit/allan_support.hpp"

/// Records of which samples are missing.
namespace allan_gaps_test {
namespace {

using namespace ringlock;
using allan::Estimator;
using allan::Kind;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

std::vector<double> with_gaps(std::vector<double> x, std::uint64_t seed, unsigned one_in) {
    std::mt19937_64 random(seed);
    for (double& v : x) v = random() % one_in == 0 ? nan : v;
    return x;
}

struct Mean {
    double square = 0.0;
    std::int64_t terms = 0;
    void add(double z) {
        if (std::isnan(z)) return;
        square += z * z;
        ++terms;
    }
    double root(double scale) const { return std::sqrt(square / static_cast<double>(terms) / scale); }
};

/// Phase known at some instants only: every term that meets a NaN is a NaN.
Mean plain(Estimator e, const std::vector<double>& x, std::int64_t m) {
    const auto n = static_cast<std::int64_t>(x.size());
    Mean out;
    const auto reflected = [&](std::int64_t i) {
        return i < 0 ? 2 * x[0] - x[-i] : i >= n ? 2 * x[n - 1] - x[2 * (n - 1) - i] : x[i];
    };
    if (e == Estimator::totdev) {
        for (std::int64_t i = 1; i + 1 < n; ++i) out.add(reflected(i - m) - 2 * x[i] + reflected(i + m));
        return out;
    }
    if (e == Estimator::mdev) {
        for (std::int64_t i = 0; i + 3 * m <= n; ++i) {
            double z = 0.0;
            for (std::int64_t j = i; j < i + m; ++j) z += x[j] - 2 * x[j + m] + x[j + 2 * m];
            out.add(z / static_cast<double>(m));
        }
        return out;
    }
    const int order = allan::traits(e).differences;
    for (std::int64_t i = 0; i + order * m < n; i += allan::traits(e).overlapping ? 1 : m) {
        out.add(order == 1   ? x[i + m] - x[i]
                : order == 2 ? x[i + 2 * m] - 2 * x[i + m] + x[i]
                             : x[i + 3 * m] - 3 * x[i + 2 * m] + 3 * x[i + m] - x[i]);
    }
    return out;
}

TEST(AllanGaps, TermsThatNeedMissingPhaseAreLeftOut) {
    std::vector<double> x = with_gaps(test::simulate_angle({.q = 0.3, .n = 1.0}, 600, 1.0, 1), 2, 40);
    x.front() = 1.0;
    x.back() = 2.0;
    const allan::Phase phase = allan::phase_of(x, Kind::phase, 1.0);
    ASSERT_FALSE(phase.whole());
    for (const Estimator e : {Estimator::adev, Estimator::oadev, Estimator::hdev, Estimator::ohdev, Estimator::tierms,
                              Estimator::totdev, Estimator::mdev}) {
        const std::vector<std::int64_t> factors = {1, 2, 7, 20, 100};
        for (const allan::Point& p : allan::deviation(e, phase, 1.0, factors)) {
            const Mean expected = plain(e, x, p.m);
            EXPECT_EQ(p.terms, expected.terms) << allan::name(e) << " m = " << p.m;
            const double scale = e == Estimator::tierms ? 1.0 : allan::traits(e).differences == 3 ? 6.0 : 2.0;
            const double tau = e == Estimator::tierms ? 1.0 : p.tau_s;
            EXPECT_NEAR(p.dev * std::sqrt(p.bias), expected.root(scale) / tau, 1e-9 * p.dev) << allan::name(e) << p.m;
        }
    }
}

TEST(AllanGaps, LargestErrorsLeaveMissingPointsOut) {
    const std::vector<double> x = with_gaps(test::simulate_angle({.n = 1.0}, 300, 1.0, 3), 4, 10);
    const allan::Phase phase = allan::phase_of(x, Kind::phase, 1.0);
    const std::vector<std::int64_t> factors = {1, 5, 50, 200};
    for (const allan::Point& p : allan::deviation(Estimator::mtie, phase, 1.0, factors)) {
        double largest = 0.0;
        for (std::size_t i = 0; i + p.m < x.size(); ++i) {
            double low = std::numeric_limits<double>::infinity();
            double high = -low;
            for (std::size_t j = i; j <= i + p.m; ++j) {
                if (std::isnan(x[j])) continue;
                low = std::min(low, x[j]);
                high = std::max(high, x[j]);
            }
            largest = std::max(largest, high - low);
        }
        EXPECT_NEAR(p.dev, largest, 1e-9 * largest) << p.m;
    }
}

// Means of which nine tenths are there count, and are means of those.
TEST(AllanGaps, MeanRatesAreThoseOfWhatIsThere) {
    std::vector<double> y = with_gaps(test::simulate_angle({.n = 1.0}, 800, 1.0, 5), 6, 60);
    for (std::size_t i = 300; i < 340; ++i) y[i] = nan;
    y.front() = y.back() = 1.0;
    const allan::Phase phase = allan::phase_of(y, Kind::rate, 2.0);
    ASSERT_FALSE(phase.one_origin);
    for (const Estimator e : {Estimator::oadev, Estimator::adev, Estimator::ohdev}) {
        const std::vector<std::int64_t> factors = {1, 9, 10, 33, 100};
        for (const allan::Point& p : allan::deviation(e, phase, 2.0, factors)) {
            const auto m = static_cast<std::size_t>(p.m);
            Mean expected;
            const std::size_t order = e == Estimator::ohdev ? 3 : 2;
            for (std::size_t i = 0; i + order * m <= y.size(); i += e == Estimator::adev ? m : 1) {
                std::vector<double> mean;
                for (std::size_t k = 0; k < order; ++k) {
                    double sum = 0.0;
                    double count = 0.0;
                    for (std::size_t j = i + k * m; j < i + (k + 1) * m; ++j) {
                        if (std::isnan(y[j])) continue;
                        sum += y[j];
                        count += 1.0;
                    }
                    mean.push_back(10.0 * count >= 9.0 * static_cast<double>(m) ? sum / count : nan);
                }
                expected.add(order == 2 ? mean[1] - mean[0] : mean[2] - 2.0 * mean[1] + mean[0]);
            }
            EXPECT_EQ(p.terms, expected.terms) << allan::name(e) << " m = " << p.m;
            EXPECT_NEAR(p.dev, expected.root(order == 2 ? 2.0 : 6.0), 1e-10 * p.dev)
                << allan::name(e) << " m = " << p.m;
        }
    }
}

// Pieces lie within the parts without gaps: those of each part on its own, none that reaches across.
TEST(AllanGaps, TotalsOfPiecesAreThoseOfThePartsWithoutGaps) {
    std::vector<double> x = test::simulate_angle({.q = 0.3, .n = 1.0}, 600, 1.0, 8);
    x[250] = x[251] = x[400] = nan;
    const allan::Phase phase = allan::phase_of(x, Kind::phase, 1.0);
    const std::vector<std::vector<double>> parts = {
        {x.begin(), x.begin() + 250}, {x.begin() + 252, x.begin() + 400}, {x.begin() + 401, x.end()}};
    for (const Estimator e : {Estimator::mtotdev, Estimator::htotdev}) {
        const std::vector<std::int64_t> factors = {1, 7, 20, 60};
        for (const allan::Point& p : allan::deviation(e, phase, 1.0, factors, {.bias = allan::Bias::none})) {
            double squares = 0.0;
            std::int64_t terms = 0;
            for (const std::vector<double>& part : parts) {
                if (allan::largest_factor(e, static_cast<std::int64_t>(part.size())) < p.m) continue;
                const std::vector<std::int64_t> one = {p.m};
                const allan::Point of_part = allan::deviation(e, part, 1.0, one, {.bias = allan::Bias::none}).at(0);
                squares += of_part.dev * of_part.dev * static_cast<double>(of_part.terms);
                terms += of_part.terms;
            }
            EXPECT_EQ(p.terms, terms) << allan::name(e) << " m = " << p.m;
            // The line through the whole record is taken out of one, none of the other: rounding of the phase.
            EXPECT_NEAR(p.dev, std::sqrt(squares / static_cast<double>(terms)), 1e-11 * p.dev)
                << allan::name(e) << " m = " << p.m;
        }
    }
}

// Nothing is closed up: a hundred samples left out of a ramp would show as a step of 50. At the edges of the gap means
// lack a tenth at one side, which moves them by up to m/40.
TEST(AllanGaps, ARampWithAGapIsARamp) {
    std::vector<double> y;
    for (int i = 0; i < 1000; ++i) y.push_back(i >= 400 && i < 500 ? nan : 0.5 * i);
    const std::vector<std::int64_t> factors = {1, 20, 200};
    for (const allan::Point& p :
         allan::deviation(Estimator::oadev, allan::phase_of(y, Kind::rate, 1.0), 1.0, factors)) {
        EXPECT_NEAR(p.dev, 0.5 * p.tau_s / std::sqrt(2.0), 0.01 * p.dev) << p.m;
    }
}

TEST(AllanGaps, MissingEndsAreNotThere) {
    const std::vector<double> whole = test::simulate_angle({.n = 1.0}, 200, 1.0, 7);
    std::vector<double> longer(5, nan);
    longer.insert(longer.end(), whole.begin(), whole.end());
    longer.insert(longer.end(), 9, nan);
    for (const Kind kind : {Kind::phase, Kind::increment, Kind::rate}) {
        const allan::Phase a = allan::phase_of(whole, kind, 1.0);
        const allan::Phase b = allan::phase_of(longer, kind, 1.0);
        EXPECT_EQ(a.x, b.x);
        EXPECT_TRUE(b.whole());
    }
    EXPECT_TRUE(allan::phase_of(std::vector<double>(4, nan), Kind::rate, 1.0).x.empty());
}

// Two in a hundred missing changes nothing but the number of terms.
TEST(AllanGaps, VariancesStayUnbiased) {
    constexpr int records = 300;
    const std::vector<std::int64_t> factors = {1, 16, 128};
    std::vector<double> variance(factors.size());
    for (int k = 0; k < records; ++k) {
        const auto angle = test::simulate_angle({.n = 1.0}, 2000, 1.0, 300 + k);
        std::vector<double> steps;
        for (std::size_t i = 0; i + 1 < angle.size(); ++i) steps.push_back(angle[i + 1] - angle[i]);
        const allan::Phase phase = allan::phase_of(with_gaps(steps, 900 + k, 50), Kind::increment, 1.0);
        const auto points = allan::deviation(Estimator::oadev, phase, 1.0, factors);
        ASSERT_EQ(points.size(), factors.size());
        for (std::size_t i = 0; i < points.size(); ++i) variance[i] += points[i].dev * points[i].dev / records;
    }
    // Errors of the means: 0.2, 0.6 and 2 %; means of 98 samples in a hundred have 2 % more variance.
    EXPECT_NEAR(variance[0], 1.0, 0.01);
    EXPECT_NEAR(variance[1] * 16.0, 1.02, 0.03);
    EXPECT_NEAR(variance[2] * 128.0, 1.02, 0.08);
}

}  // namespace
}  // namespace allan_gaps_test
