#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "analysis/allan/running_deviation.hpp"
#include "engine/core/error.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_running_test {
namespace {

using namespace ringlock;
using allan::Estimator;
using allan::Kind;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// The same sums with a record that is all there, in long double; NaN points are left out, and so is what would reach
/// across a lost origin.
struct Batch {
    long double variance = 0.0L;
    std::int64_t terms = 0;
};

Batch batch(const std::vector<long double>& x, const std::vector<int>& origin, std::int64_t m, int order) {
    Batch out;
    const auto n = static_cast<std::int64_t>(x.size());
    const std::int64_t stride = std::max<std::int64_t>(1, m / 8);
    for (std::int64_t i = 0; i + order * m < n; i += stride) {
        if (!origin.empty() && origin[i] != origin[i + order * m]) continue;
        const long double z =
            order == 2 ? x[i + 2 * m] - 2 * x[i + m] + x[i] : x[i + 3 * m] - 3 * x[i + 2 * m] + 3 * x[i + m] - x[i];
        if (std::isnan(z)) continue;
        out.variance += z * z;
        ++out.terms;
    }
    out.variance /= static_cast<long double>(out.terms) * (order == 2 ? 2 : 6) * m * m;
    return out;
}

void expect_batch(const std::vector<allan::Point>& points, const std::vector<long double>& x, int order) {
    ASSERT_FALSE(points.empty());
    for (const allan::Point& p : points) {
        const Batch b = batch(x, {}, p.m, order);
        EXPECT_EQ(p.terms, b.terms) << p.m;
        const double dev = static_cast<double>(std::sqrt(b.variance));
        EXPECT_NEAR(p.dev, dev, 1e-12 * dev) << p.m;
        EXPECT_LT(p.lo, p.dev);
        EXPECT_GT(p.hi, p.dev);
    }
    EXPECT_GT(order * 2 * points.back().m, static_cast<std::int64_t>(x.size()) - 1);
}

std::vector<double> rates(std::size_t n, std::uint64_t seed) {
    const auto angle = test::simulate_angle({.q = 0.2, .n = 1.0, .k = 0.01}, n, 1.0, seed);
    std::vector<double> out;
    for (std::size_t i = 0; i < n; ++i) out.push_back(angle[i + 1] - angle[i]);
    return out;
}

TEST(AllanRunning, IsTheBatchOfTheSameStride) {
    for (const std::size_t n : {2U, 3U, 511U, 1023U, 1024U, 4095U, 5000U, 32'767U, 70'000U}) {
        const std::vector<double> y = rates(n, n);
        std::vector<long double> x = {0.0L};
        for (const double v : y) x.push_back(x.back() + static_cast<long double>(v));
        for (const auto& [estimator, order] : {std::pair{Estimator::oadev, 2}, std::pair{Estimator::ohdev, 3}}) {
            if (n < static_cast<std::size_t>(order)) continue;
            allan::RunningDeviation running(Kind::increment, 1.0, estimator);
            running.add(y);
            expect_batch(running.points(), x, order);
        }
    }
}

// Phase of a 10 MHz counter: the numbers have 16 digits, the noise is in the last ones.
TEST(AllanRunning, LargePhaseKeepsItsDigits) {
    std::mt19937_64 random(4);
    std::uniform_int_distribution<std::int64_t> step(-30, 30);
    std::vector<double> x;
    std::vector<long double> exact;
    std::int64_t walk = 0;
    for (std::int64_t i = 0; i < 20'000; ++i) {
        walk += step(random);
        x.push_back(static_cast<double>(1'000'000'000'000'000 + 10'000'007 * i + walk));
        exact.push_back(x.back());
    }
    allan::RunningDeviation running(Kind::phase, 1.0);
    running.add(x);
    expect_batch(running.points(), exact, 2);
}

TEST(AllanRunning, PiecesDoNotMatter) {
    const std::vector<double> y = rates(9000, 7);
    allan::RunningDeviation whole(Kind::rate, 0.5);
    whole.add(y);
    std::mt19937_64 random(5);
    allan::RunningDeviation pieces(Kind::rate, 0.5);
    for (std::size_t i = 0; i < y.size();) {
        const std::size_t n = std::min<std::size_t>(y.size() - i, random() % 700);
        pieces.add(std::span(y).subspan(i, n));
        i += n;
    }
    const auto a = whole.points();
    const auto b = pieces.points();
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
        EXPECT_EQ(a[i].terms, b[i].terms);
        EXPECT_NEAR(a[i].dev, b[i].dev, 1e-14 * a[i].dev);
    }
    EXPECT_EQ(pieces.samples(), 9000);
}

TEST(AllanRunning, MissingPhaseIsLeftOut) {
    std::vector<double> x = test::simulate_angle({.n = 1.0}, 8000, 1.0, 8);
    std::mt19937_64 random(6);
    std::int64_t missing = 0;
    for (std::size_t i = 1; i < x.size(); ++i) {
        if (random() % 50 == 0) x[i] = nan, ++missing;
    }
    allan::RunningDeviation running(Kind::phase, 1.0);
    running.add(x);
    EXPECT_EQ(running.missing(), missing);
    for (const allan::Point& p : running.points()) {
        const Batch b = batch({x.begin(), x.end()}, {}, p.m, 2);
        EXPECT_EQ(p.terms, b.terms) << p.m;
        EXPECT_NEAR(p.dev, static_cast<double>(std::sqrt(b.variance)), 1e-11 * p.dev) << p.m;
    }
}

// A missing increment loses the origin: nothing reaches across. Behind it starts are counted anew, so that the strided
// sums are not those of one grid; at m <= 8 every start counts and they are.
TEST(AllanRunning, MissingIncrementsPartTheRecord) {
    std::vector<double> y = rates(6000, 9);
    for (const std::size_t at : {700U, 701U, 3000U, 5990U}) y[at] = nan;
    std::vector<long double> x = {0.0L};
    std::vector<int> origin = {0};
    for (const double v : y) {
        const bool there = !std::isnan(v);
        x.push_back(there ? x.back() + static_cast<long double>(v) : x.back());
        origin.push_back(origin.back() + (there ? 0 : 1));
    }
    allan::RunningDeviation running(Kind::increment, 1.0);
    running.add(y);
    EXPECT_EQ(running.missing(), 4);
    const auto points = running.points();
    for (std::size_t k = 0; k < 4; ++k) {
        const Batch b = batch(x, origin, points[k].m, 2);
        EXPECT_EQ(points[k].terms, b.terms);
        EXPECT_NEAR(points[k].dev, static_cast<double>(std::sqrt(b.variance)), 1e-12 * points[k].dev);
    }
    for (const allan::Point& p : points) EXPECT_LE(2 * p.m, 3000);
}

// What is kept for a fit is the phase less a line.
TEST(AllanRunning, ThinnedPhaseIsThePhase) {
    for (const std::size_t n : {100U, 32'768U, 32'769U, 200'000U}) {
        const std::vector<double> x = test::simulate_angle({.n = 1.0}, n - 1, 1.0, n);
        allan::RunningDeviation running(Kind::phase, 1.0);
        running.add(x);
        const std::vector<double> thin = running.thinned_phase();
        const auto every = static_cast<std::size_t>(running.thinning());
        ASSERT_EQ(thin.size(), (n - 1) / every + 1) << n;
        EXPECT_LE(thin.size(), 32'768U);
        EXPECT_GT(2 * thin.size(), std::min<std::size_t>(n, 32'768U));
        for (std::size_t k = 2; k < thin.size(); ++k) {
            const double z = thin[k] - 2.0 * thin[k - 1] + thin[k - 2];
            EXPECT_NEAR(z, x[k * every] - 2.0 * x[(k - 1) * every] + x[(k - 2) * every], 1e-8) << n;
        }
    }
}

TEST(AllanRunning, RefusesWhatItCannot) {
    EXPECT_THROW(allan::RunningDeviation(Kind::phase, 1.0, Estimator::mdev), InputError);
    EXPECT_THROW(allan::RunningDeviation(Kind::phase, 0.0), InputError);
    allan::RunningDeviation empty(Kind::phase, 1.0);
    EXPECT_TRUE(empty.points().empty());
    empty.add(std::vector<double>{nan, nan, 1.0, 2.0, nan});
    EXPECT_TRUE(empty.points().empty());
    EXPECT_EQ(empty.missing(), 3);
}

}  // namespace
}  // namespace allan_running_test
