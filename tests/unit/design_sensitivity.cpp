// Sensitivity indices against closed forms. The statistical tests have fixed seeds; "standard errors" are those of
// independent base points, by the delta method, which Sobol' points do not exceed.
#include <gtest/gtest.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "analysis/design/sensitivity.hpp"
#include "engine/core/error.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/sensitivity_functions.hpp"

namespace ringlock::test {
namespace design_sensitivity_test {
namespace {

using namespace design;
using testing::HasSubstr;

constexpr std::uint64_t no_limit = UINT64_MAX;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// y = sum of c_i x_i, x uniform in 0...1: both indices are c_i^2 over the sum of all.
KnownFunction linear(const std::vector<double>& c) {
    KnownFunction f;
    f.name = "linear";
    double sum = 0.0;
    for (const double ci : c) sum += ci * ci;
    for (std::size_t i = 0; i < c.size(); ++i) {
        f.factors.push_back({.key = std::to_string(i), .takes = Uniform{0.0, 1.0}});
        f.indices.push_back({c[i] * c[i] / sum, c[i] * c[i] / sum});
        f.mean += 0.5 * c[i];
    }
    f.variance = sum / 12.0;
    f.value = [c](std::span<const double> x) { return std::inner_product(x.begin(), x.end(), c.begin(), 0.0); };
    return f;
}

std::vector<double> sobol_values(const KnownFunction& f, std::size_t base_points, std::uint64_t seed) {
    return evaluate(f, sensitivity_points(base_points, f.factors.size(), seed, no_limit));
}

/// Standard error of an index that is a ratio mean(p)/mean(q), with q the squares about the known mean.
KnownIndices standard_errors(const KnownFunction& f, std::span<const double> values, std::size_t i) {
    const std::size_t each = f.factors.size() + 2;
    const std::size_t n = values.size() / each;
    KnownIndices squares;
    for (std::size_t base = 0; base < n; ++base) {
        const double a = values[base * each] - f.mean;
        const double b = values[base * each + 1] - f.mean;
        const double ab = values[base * each + 2 + i] - f.mean;
        const double q = 0.5 * (a * a + b * b);
        squares.first += std::pow(b * (ab - a) - f.indices[i].first * q, 2);
        squares.total += std::pow(0.5 * (a - ab) * (a - ab) - f.indices[i].total * q, 2);
    }
    return {std::sqrt(squares.first) / static_cast<double>(n) / f.variance,
            std::sqrt(squares.total) / static_cast<double>(n) / f.variance};
}

void expect_closed_form(const KnownFunction& f, std::size_t base_points, std::uint64_t seed) {
    const auto values = sobol_values(f, base_points, seed);
    const OutputIndices seen = indices_of_values(values, f.factors.size());
    ASSERT_EQ(seen.absent, "");
    EXPECT_EQ(seen.base_points, base_points);
    EXPECT_EQ(seen.left_out, 0U);
    EXPECT_FALSE(seen.noise_share.has_value());
    ASSERT_EQ(seen.factors.size(), f.factors.size());
    for (std::size_t i = 0; i < f.factors.size(); ++i) {
        const KnownIndices error = standard_errors(f, values, i);
        const FactorIndices& of = seen.factors[i];
        std::printf("%s S%zu %.5f (%.5f +- %.5f), ST%zu %.5f (%.5f +- %.5f)\n", f.name.c_str(), i + 1,
                    of.first.estimate, f.indices[i].first, error.first, i + 1, of.total.estimate, f.indices[i].total,
                    error.total);
        EXPECT_NEAR(of.first.estimate, f.indices[i].first, 4.0 * error.first);
        EXPECT_NEAR(of.total.estimate, f.indices[i].total, 4.0 * error.total);
        // The bootstrap sees the spread of the base points: 1.96 standard errors to either side, to the accuracy that a
        // thousand rounds give a quantile, some 6 % (a standard error of it).
        EXPECT_NEAR(0.5 * (of.first.hi - of.first.lo), 1.96 * error.first, 0.25 * 1.96 * error.first);
        EXPECT_NEAR(0.5 * (of.total.hi - of.total.lo), 1.96 * error.total, 0.25 * 1.96 * error.total);
    }
}

TEST(SensitivityIndices, OfALinearModel) { expect_closed_form(linear({1.0, 2.0, 0.5, 3.0}), 1 << 12, 41); }

TEST(SensitivityIndices, OfIshigamisFunction) {
    const KnownFunction f = ishigami();
    expect_closed_form(f, 1 << 12, 42);
    const OutputIndices seen = indices_of_values(sobol_values(f, 1 << 12, 42), 3);
    // The function's sixth power has few large values: its variance at 2 x 4096 points, each better than independent.
    EXPECT_NEAR(*seen.mean, f.mean, 4.0 * std::sqrt(f.variance / 8192.0));
    EXPECT_NEAR(*seen.variance, f.variance, 4.0 * f.variance * std::sqrt(3.0 / 8192.0));
}

TEST(SensitivityIndices, OfTheGFunction) { expect_closed_form(g_function(), 1 << 12, 43); }

TEST(SensitivityIndices, AFactorWithoutInfluenceHasNone) {
    const OutputIndices seen = indices_of_values(sobol_values(linear({1.0, 0.0}), 256, 44), 2);
    for (const Index& index : {seen.factors[1].first, seen.factors[1].total}) {
        EXPECT_EQ(index.estimate, 0.0);
        EXPECT_EQ(index.lo, 0.0);
        EXPECT_EQ(index.hi, 0.0);
    }
}

TEST(SensitivityIndices, DoNotDependOnOffsetAndUnit) {
    auto values = sobol_values(ishigami(), 512, 45);
    const OutputIndices before = indices_of_values(values, 3);
    for (double& v : values) v = 1e-3 * v + 1e4;
    const OutputIndices after = indices_of_values(values, 3);
    for (std::size_t i = 0; i < 3; ++i) {
        // Values were rounded to 1e4 epsilon/2 of a spread of 4e-3: 3e-10, and products of two.
        EXPECT_NEAR(after.factors[i].first.estimate, before.factors[i].first.estimate, 1e-8);
        EXPECT_NEAR(after.factors[i].total.hi, before.factors[i].total.hi, 1e-8);
    }
    // A power of 2 changes no bit, although squares of such values are near the end of what a double holds.
    for (double& v : values) v *= 0x1p480;
    EXPECT_EQ(indices_of_values(values, 3).factors[0].first.estimate, after.factors[0].first.estimate);
}

TEST(SensitivityPoints, AreABAndAWithOneCoordinateOfB) {
    const std::size_t k = 3;
    const Points points = sensitivity_points(8, k, 46, 40);
    const Points both = sobol(8, 2 * k, 46, 8);
    ASSERT_EQ(points.count, 40U);
    for (std::size_t base = 0; base < 8; ++base) {
        for (std::size_t j = 0; j < k + 2; ++j) {
            for (std::size_t i = 0; i < k; ++i) {
                EXPECT_EQ(points[base * (k + 2) + j][i], both[base][j == 1 || j == i + 2 ? k + i : i]);
            }
        }
    }
    const Points fewer = sensitivity_points(5, k, 46, 40);
    EXPECT_TRUE(std::ranges::equal(fewer.values, std::span(points.values).first(fewer.values.size())));
}

TEST(SensitivityPoints, RefuseWhatCannotBe) {
    EXPECT_THROW(sensitivity_points(0, 3, 1, 100), InputError);
    EXPECT_THROW(sensitivity_points(8, 0, 1, 100), InputError);
    EXPECT_THAT(message_of<InputError>([] { sensitivity_points(8, 3, 1, 39); }), HasSubstr("7 base points or fewer"));
    EXPECT_THROW(sensitivity_points(std::uint64_t{1} << 62, 3, 1, no_limit), InputError);
    EXPECT_THROW(sensitivity_points(8, 1834, 1, no_limit), InputError);
    EXPECT_THROW(sensitivity_points(8, no_limit, 1, no_limit), InputError);
}

TEST(SensitivityIndices, BasePointsWithoutValuesAreLeftOut) {
    // Two outputs; one lacks values at three base points, one value among them an infinite one.
    const std::size_t n = 128;
    const std::size_t each = 5;
    const auto first = sobol_values(ishigami(), n, 47);
    std::vector<double> values;
    for (const double v : first) {
        values.push_back(v);
        values.push_back(-2.0 * v);
    }
    values[2 * (7 * each + 0)] = nan;
    values[2 * (50 * each + 4)] = -std::numeric_limits<double>::infinity();
    values[2 * (127 * each + 1)] = nan;
    values[2 * (127 * each + 2)] = nan;
    const auto seen = sensitivity_indices({.base_points = n, .factors = 3, .outputs = 2, .values = values});
    ASSERT_EQ(seen.size(), 2U);
    EXPECT_EQ(seen[0].left_out, 3U);
    EXPECT_EQ(seen[0].base_points, n - 3);
    EXPECT_EQ(seen[1].left_out, 0U);
    std::vector<double> kept;
    for (std::size_t base = 0; base < n; ++base) {
        if (base == 7 || base == 50 || base == 127) continue;
        kept.insert(kept.end(), first.begin() + static_cast<std::ptrdiff_t>(base * each),
                    first.begin() + static_cast<std::ptrdiff_t>((base + 1) * each));
    }
    const OutputIndices without = indices_of_values(kept, 3);
    const OutputIndices whole = indices_of_values(first, 3);
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(seen[0].factors[i].first.estimate, without.factors[i].first.estimate);
        EXPECT_EQ(seen[0].factors[i].total.lo, without.factors[i].total.lo);
        // Scaled by a power of 2: the same bits.
        EXPECT_EQ(seen[1].factors[i].first.estimate, whole.factors[i].first.estimate);
        EXPECT_EQ(seen[1].factors[i].total.hi, whole.factors[i].total.hi);
    }
}

TEST(SensitivityIndices, AreAbsentWithAReason) {
    const std::size_t n = 64;
    std::vector<double> values(n * 4, 0.1);
    OutputIndices seen = indices_of_values(values, 2);
    EXPECT_THAT(seen.absent, HasSubstr("does not vary"));
    EXPECT_TRUE(seen.factors.empty());
    EXPECT_NEAR(*seen.mean, 0.1, 1e-15);
    EXPECT_EQ(*seen.variance, 0.0);
    // Rounding is no variance.
    for (std::size_t i = 0; i < values.size(); i += 3) values[i] = std::nextafter(0.1, 1.0);
    EXPECT_THAT(indices_of_values(values, 2).absent, HasSubstr("does not vary"));
    // A and B do not vary, but one AB_i does.
    std::ranges::fill(values, 0.1);
    values[2] = 5.0;
    EXPECT_THAT(indices_of_values(values, 2).absent, HasSubstr("does not vary"));
    // One base point in A varies: e^-1 of the resamplings are without it.
    values[0] = 5.0;
    EXPECT_THAT(indices_of_values(values, 2).absent, HasSubstr("resamplings do not vary"));
    std::ranges::fill(values, 0.0);
    EXPECT_THAT(indices_of_values(values, 2).absent, HasSubstr("does not vary"));
    std::ranges::fill(values, nan);
    seen = indices_of_values(values, 2);
    EXPECT_THAT(seen.absent, HasSubstr("only 0 of 64 base points"));
    EXPECT_EQ(seen.left_out, n);
    EXPECT_FALSE(seen.mean.has_value());
    EXPECT_FALSE(seen.variance.has_value());
    const auto few = sobol_values(linear({1.0, 2.0}), fewest_base_points, 48);
    EXPECT_EQ(indices_of_values(few, 2).absent, "");
    EXPECT_THAT(indices_of_values(std::span(few).first(4 * (fewest_base_points - 1)), 2).absent,
                HasSubstr("only 15 of 15 base points"));
    EXPECT_THAT(indices_of_values(std::span(few).first(4), 2).absent, HasSubstr("only 1 of 1"));
    std::vector<double> large = few;
    for (double& v : large) v = v < 1.0 ? -1.7e308 : 1.7e308;
    EXPECT_THAT(indices_of_values(large, 2).absent, HasSubstr("too large"));
}

TEST(SensitivityIndices, TheShareOfNoiseIsTold) {
    // Independent noise of a quarter of the model's variance: a fifth of the whole.
    const KnownFunction f = linear({1.0, 2.0, 0.0});
    const std::size_t n = 1 << 13;
    auto values = sobol_values(f, n, 49);
    const double noise_variance = 0.25 * f.variance;
    std::mt19937_64 random(50);
    std::normal_distribution<double> noise(0.0, std::sqrt(noise_variance));
    for (double& v : values) v += noise(random);
    const std::vector<double> variances(values.size(), noise_variance);
    const Evaluations evaluations{
        .base_points = n, .factors = 3, .outputs = 1, .values = values, .noise_variance = variances};
    const OutputIndices seen = sensitivity_indices(evaluations).front();
    // Variances of 2 n values of kurtosis 3 at most: relative standard error sqrt(2/(2 n)).
    const double error = std::sqrt(1.0 / static_cast<double>(n));
    EXPECT_NEAR(*seen.noise_share, 0.2, 4.0 * 0.2 * error);
    KnownFunction noisy = f;
    noisy.variance += noise_variance;
    for (KnownIndices& i : noisy.indices) i = {0.8 * i.first, 0.8 * i.total + 0.2};
    for (std::size_t i = 0; i < 3; ++i) {
        const KnownIndices of = standard_errors(noisy, values, i);
        EXPECT_NEAR(seen.factors[i].first.estimate, noisy.indices[i].first, 4.0 * of.first);
        EXPECT_NEAR(seen.factors[i].total.estimate, noisy.indices[i].total, 4.0 * of.total);
    }
}

TEST(SensitivityIndices, IntervalsHoldTheTruthAsOftenAsTheySay) {
    // Independent base points, as the bootstrap has it.
    const KnownFunction f = linear({1.0, 2.0, 3.0});
    const int seeds = 200;
    for (const Bootstrap kind : {Bootstrap::percentile, Bootstrap::bca}) {
        int first = 0;
        int total = 0;
        for (std::uint64_t seed = 0; seed < seeds; ++seed) {
            const auto values = evaluate(f, independent_sensitivity_points(512, 3, seed));
            const OutputIndices seen = indices_of_values(values, 3, {.seed = seed, .rounds = 400, .bootstrap = kind});
            const auto holds = [&](const Index& i) { return i.lo <= f.indices[1].first && f.indices[1].first <= i.hi; };
            first += holds(seen.factors[1].first) ? 1 : 0;
            total += holds(seen.factors[1].total) ? 1 : 0;
        }
        std::printf("%d and %d of %d\n", first, total, seeds);
        // Four standard errors of a share of 0.95: 0.062; 0.95 + 0.05 is all of them.
        EXPECT_GE(first, 0.888 * seeds);
        EXPECT_GE(total, 0.888 * seeds);
        // They are not so wide that they could not miss: none of 200 missed has a chance of 4e-5.
        EXPECT_LT(first, seeds);
        EXPECT_LT(total, seeds);
    }
}

TEST(SensitivityIndices, AreTheSameForAnyNumberOfThreads) {
    const auto values = sobol_values(ishigami(), 300, 51);
    OutputIndices one;
    OutputIndices four;
    tbb::task_arena(1).execute([&] { one = indices_of_values(values, 3); });
    tbb::task_arena(4).execute([&] { four = indices_of_values(values, 3); });
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(one.factors[i].first.lo, four.factors[i].first.lo);
        EXPECT_EQ(one.factors[i].first.hi, four.factors[i].first.hi);
        EXPECT_EQ(one.factors[i].total.lo, four.factors[i].total.lo);
    }
    // The seed is of the resampling alone.
    const OutputIndices other = indices_of_values(values, 3, {.seed = 1});
    EXPECT_EQ(other.factors[0].first.estimate, one.factors[0].first.estimate);
    EXPECT_NE(other.factors[0].first.lo, one.factors[0].first.lo);
}

TEST(SensitivityIndices, RefuseWhatDoesNotFit) {
    std::vector<double> values(64, 1.0);
    std::iota(values.begin(), values.end(), 0.0);
    const auto of = [&](Evaluations e, const SensitivityOptions& o = {}) {
        if (e.values.empty()) e.values = values;
        return message_of<InputError>([&] { sensitivity_indices(e, o); });
    };
    EXPECT_THAT(of({.base_points = 0, .factors = 2, .outputs = 1}), HasSubstr("one of each"));
    EXPECT_THAT(of({.base_points = 16, .factors = 0, .outputs = 1}), HasSubstr("one of each"));
    EXPECT_THAT(of({.base_points = 16, .factors = 2, .outputs = 0}), HasSubstr("one of each"));
    EXPECT_THAT(of({.base_points = 15, .factors = 2, .outputs = 1}),
                HasSubstr("64 values of 1 outputs at 15 base points of 2 factors"));
    EXPECT_THAT(of({.base_points = 16, .factors = 3, .outputs = 1}),
                HasSubstr("outputs x base points x (factors + 2)"));
    EXPECT_THAT(of({.base_points = 64, .factors = SIZE_MAX, .outputs = 1}), HasSubstr("outputs x base points"));
    std::vector<double> noise(63, 1.0);
    Evaluations e{.base_points = 16, .factors = 2, .outputs = 1, .values = values, .noise_variance = noise};
    EXPECT_THAT(of(e), HasSubstr("63 noise variances for 64 values"));
    for (const double bad : {-1.0, nan, std::numeric_limits<double>::infinity()}) {
        noise.assign(64, 1.0);
        noise[5] = bad;
        e.noise_variance = noise;
        EXPECT_THAT(of(e), HasSubstr("of output 0 at evaluation 5"));
    }
    // Of a value that is not there nothing is known, nor needed.
    values[5] = nan;
    EXPECT_NO_THROW(sensitivity_indices(e));
    e.noise_variance = {};
    for (const double confidence : {0.0, 1.0, nan}) {
        EXPECT_THAT(of(e, {.confidence = confidence}), HasSubstr("between 0 and 1"));
    }
    EXPECT_THAT(of(e, {.rounds = 99}), HasSubstr("100 at least"));
}

}  // namespace
}  // namespace design_sensitivity_test
}  // namespace ringlock::test
