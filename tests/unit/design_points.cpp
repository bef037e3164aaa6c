// Points of designs: strata of Latin hypercubes, nets of scrambled Sobol' sequences, grids, lists, correlations. The
// statistical tests have fixed seeds.
#include <Random123/philox.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <boost/random/sobol.hpp>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include "analysis/design/design.hpp"
#include "engine/core/error.hpp"
#include "engine/random/stream.hpp"
#include "tests/support/expect_throw.hpp"

namespace ringlock::test {
namespace design_points_test {
namespace {

using namespace design;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr std::uint64_t no_limit = UINT64_MAX;

std::vector<double> column(const Points& points, std::size_t dimension) {
    std::vector<double> values(points.count);
    for (std::size_t i = 0; i < points.count; ++i) values[i] = points[i][dimension];
    return values;
}

double mean(const std::vector<double>& x) {
    return std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(x.size());
}

double pearson(const std::vector<double>& x, const std::vector<double>& y) {
    const double mx = mean(x);
    const double my = mean(y);
    double xx = 0.0;
    double yy = 0.0;
    double xy = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        xx += (x[i] - mx) * (x[i] - mx);
        yy += (y[i] - my) * (y[i] - my);
        xy += (x[i] - mx) * (y[i] - my);
    }
    return xy / std::sqrt(xx * yy);
}

std::vector<double> ranks(const std::vector<double>& x) {
    std::vector<std::size_t> order(x.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return x[a] < x[b]; });
    std::vector<double> rank(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) rank[order[i]] = static_cast<double>(i);
    return rank;
}

TEST(LatinHypercube, HasOnePointInEachStratum) {
    for (const std::uint64_t n : {1U, 2U, 3U, 10U, 49U, 1000U}) {
        const Points points = latin_hypercube(n, 7, 11, no_limit);
        for (std::size_t dimension = 0; dimension < 7; ++dimension) {
            std::set<std::uint64_t> strata;
            for (const double u : column(points, dimension)) {
                EXPECT_GT(u, 0.0);
                EXPECT_LT(u, 1.0);
                strata.insert(static_cast<std::uint64_t>(u * static_cast<double>(n)));
            }
            EXPECT_EQ(strata.size(), n) << "dimension " << dimension;
        }
    }
}

TEST(LatinHypercube, IsRandomWithinStrataAndBetweenDimensions) {
    const std::uint64_t n = 4000;
    const Points points = latin_hypercube(n, 3, 12, no_limit);
    const double standard_error = 1.0 / std::sqrt(static_cast<double>(n));
    std::vector<double> within(n);
    for (std::size_t dimension = 0; dimension < 3; ++dimension) {
        const auto u = column(points, dimension);
        double whole = 0.0;
        for (std::size_t i = 0; i < n; ++i) within[i] = std::modf(u[i] * static_cast<double>(n), &whole);
        EXPECT_NEAR(mean(within), 0.5, 4.0 * standard_error / std::sqrt(12.0));
        EXPECT_LT(std::abs(pearson(u, within)), 4.0 * standard_error);
        EXPECT_LT(std::abs(pearson(u, column(points, (dimension + 1) % 3))), 4.0 * standard_error);
        // The order is random, too.
        std::vector<double> order(n);
        std::iota(order.begin(), order.end(), 0.0);
        EXPECT_LT(std::abs(pearson(u, order)), 4.0 * standard_error);
    }
}

TEST(LatinHypercube, FollowsTheSeed) {
    EXPECT_EQ(latin_hypercube(50, 3, 13, no_limit).values, latin_hypercube(50, 3, 13, no_limit).values);
    EXPECT_NE(latin_hypercube(50, 3, 13, no_limit).values, latin_hypercube(50, 3, 14, no_limit).values);
}

/// Numbers of points in the elementary intervals of 2^-a by 2^-b.
std::vector<int> counts(const std::vector<double>& x, const std::vector<double>& y, int a, int b) {
    std::vector<int> count(std::size_t{1} << (a + b), 0);
    for (std::size_t i = 0; i < x.size(); ++i) {
        const auto row = static_cast<std::size_t>(std::ldexp(x[i], a));
        const auto col = static_cast<std::size_t>(std::ldexp(y[i], b));
        ++count[(row << b) + col];
    }
    return count;
}

TEST(ScrambledSobol, HasOnePointInEachIntervalOfEachDimension) {
    const std::size_t dimensions = 60;
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
        for (int m = 0; m <= 12; m += 3) {
            const Points points = sobol(std::uint64_t{1} << m, dimensions, seed, no_limit);
            for (std::size_t d = 0; d < dimensions; ++d) {
                const auto u = column(points, d);
                for (const int n : counts(u, u, m, 0)) ASSERT_EQ(n, 1) << "dimension " << d << ", 2^" << m;
            }
        }
    }
}

TEST(ScrambledSobol, IsANetInTwoDimensions) {
    // The first two dimensions of Sobol' have t = 0: each elementary interval of size 2^-m holds one of 2^m points.
    for (const std::uint64_t seed : {4U, 5U, 6U}) {
        for (int m = 1; m <= 12; ++m) {
            const Points points = sobol(std::uint64_t{1} << m, 2, seed, no_limit);
            for (int a = 0; a <= m; ++a) {
                for (const int n : counts(column(points, 0), column(points, 1), a, m - a)) {
                    ASSERT_EQ(n, 1) << "2^-" << a << " by 2^-" << m - a;
                }
            }
        }
    }
}

TEST(ScrambledSobol, KeepsTheNetsOfSobolInAllPairs) {
    // Scrambling moves elementary intervals about: how many hold how many points stays.
    const int m = 8;
    const std::size_t dimensions = 12;
    const std::size_t n = std::size_t{1} << m;
    boost::random::sobol sequence(dimensions);
    Points plain = room_for(n, dimensions, no_limit);
    for (std::size_t i = dimensions; i < n * dimensions; ++i) {
        plain.values[i] = std::ldexp(static_cast<double>(sequence() >> 12), -52);
    }
    const Points scrambled = sobol(n, dimensions, 7, no_limit);
    for (std::size_t d = 0; d < dimensions; ++d) {
        for (std::size_t e = d + 1; e < dimensions; ++e) {
            for (int a = 0; a <= m; ++a) {
                auto before = counts(column(plain, d), column(plain, e), a, m - a);
                auto after = counts(column(scrambled, d), column(scrambled, e), a, m - a);
                std::ranges::sort(before);
                std::ranges::sort(after);
                ASSERT_EQ(before, after) << "dimensions " << d << " and " << e;
            }
        }
    }
}

/// Digits of point `index` by the definition: direction numbers from the polynomials and first numbers that Joe and Kuo
/// publish (new-joe-kuo-6.21201, dimensions 1 to 6).
std::uint64_t defined_digits(std::uint64_t index, std::size_t dimension) {
    struct Row {
        unsigned s;
        unsigned a;
        std::vector<std::uint64_t> m;
    };
    static const Row table[] = {{0, 0, {}},        {1, 0, {1}},       {2, 1, {1, 3}},
                                {3, 1, {1, 3, 1}}, {3, 2, {1, 1, 1}}, {4, 1, {1, 1, 3, 3}}};
    const Row& row = table[dimension];
    const std::uint64_t gray = index ^ (index >> 1);
    std::vector<std::uint64_t> m = row.m;
    std::uint64_t digits = 0;
    for (unsigned k = 0; k < 64; ++k) {
        if (row.s == 0) {
            m.push_back(1);
        } else if (k >= row.s) {
            std::uint64_t next = m[k - row.s] ^ (m[k - row.s] << row.s);
            for (unsigned j = 1; j < row.s; ++j) {
                if (((row.a >> (row.s - 1 - j)) & 1) != 0) next ^= m[k - j] << j;
            }
            m.push_back(next);
        }
        if (((gray >> k) & 1) != 0) digits ^= m[k] << (63 - k);
    }
    return digits;
}

/// Owen's scrambling, digit by digit: what the chance of a node is does not depend on how many are drawn together.
double defined_coordinate(std::uint64_t digits, std::size_t dimension, std::uint64_t seed) {
    const r123::Philox4x64::key_type key = {{seed, static_cast<std::uint64_t>(random::Purpose::design_scrambling)}};
    double u = 0x1p-53;
    for (unsigned level = 0; level < 52; ++level) {
        const unsigned start = level / 8 * 8;
        const auto leading = [&](unsigned n) { return n == 0 ? std::uint64_t{0} : digits >> (64 - n); };
        const r123::Philox4x64::ctr_type counter = {{leading(start), start, dimension, 0}};
        const std::uint64_t within = leading(level) - (leading(start) << (level - start));
        const std::uint64_t node = (std::uint64_t{1} << (level - start)) + within;
        const std::uint64_t flip = (r123::Philox4x64()(counter, key)[node / 64] >> (node % 64)) & 1;
        const std::uint64_t digit = (digits >> (63 - level)) & 1;
        if (digit != flip) u += std::ldexp(1.0, -static_cast<int>(level) - 1);
    }
    return u;
}

TEST(ScrambledSobol, IsWhatItsDefinitionSays) {
    const Points points = sobol(5000, 6, 0x0123456789abcdefU, no_limit);
    for (std::size_t i = 0; i < points.count; i += i < 70 ? 1 : 97) {
        for (std::size_t d = 0; d < 6; ++d) {
            ASSERT_EQ(points[i][d], defined_coordinate(defined_digits(i, d), d, 0x0123456789abcdefU))
                << "point " << i << ", dimension " << d;
        }
    }
}

TEST(ScrambledSobol, BeginsWithTheShorterSequence) {
    const Points shorter = sobol(100, 5, 8, no_limit);
    const Points longer = sobol(1000, 5, 8, no_limit);
    EXPECT_TRUE(std::ranges::equal(shorter.values, std::span(longer.values).first(shorter.values.size())));
    EXPECT_EQ(longer.values, sobol(1000, 5, 8, no_limit).values);
    EXPECT_NE(longer.values, sobol(1000, 5, 9, no_limit).values);
    // Dimensions do not depend on how many there are.
    EXPECT_EQ(column(longer, 2), column(sobol(1000, 3, 8, no_limit), 2));
}

TEST(ScrambledSobol, ChancesOfAllNodesAreIndependent) {
    // Over seeds: each coordinate is uniform; and the second digits of two points whose first digits differ are flipped
    // independently, which one shift of the digits for all points would not do.
    const std::uint64_t seeds = 4096;
    std::vector<double> first(seeds);
    std::vector<double> other(seeds);
    std::vector<double> dimension(seeds);
    int equal = 0;
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
        const Points points = sobol(2, 2, seed, no_limit);
        first[seed] = points[0][0];
        other[seed] = points[1][0];
        dimension[seed] = points[0][1];
        equal += static_cast<int>(4.0 * first[seed]) % 2 == static_cast<int>(4.0 * other[seed]) % 2 ? 1 : 0;
    }
    const double root = std::sqrt(static_cast<double>(seeds));
    EXPECT_NEAR(equal, seeds / 2, 4.0 * 0.5 * root);
    for (const auto* u : {&first, &other, &dimension}) EXPECT_NEAR(mean(*u), 0.5, 4.0 / (std::sqrt(12.0) * root));
    // The two points of one dimension lie in different halves: correlation -3/4.
    EXPECT_NEAR(pearson(first, other), -0.75, 4.0 / root);
    EXPECT_LT(std::abs(pearson(first, dimension)), 4.0 / root);
}

TEST(ScrambledSobol, IntegratesFarBetterThanMonteCarlo) {
    // The product of 1 + (x_i - 1/2) over five dimensions: mean 1, variance (13/12)^5 - 1.
    const std::uint64_t n = 1 << 12;
    const double monte_carlo = std::sqrt((std::pow(13.0 / 12.0, 5) - 1.0) / static_cast<double>(n));
    double squares = 0.0;
    const std::uint64_t seeds = 16;
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
        const Points points = sobol(n, 5, seed, no_limit);
        double sum = 0.0;
        for (std::size_t i = 0; i < n; ++i) {
            double product = 1.0;
            for (const double x : points[i]) product *= 0.5 + x;
            sum += product;
        }
        squares += std::pow(sum / static_cast<double>(n) - 1.0, 2);
    }
    const double rms = std::sqrt(squares / static_cast<double>(seeds));
    std::printf("rms error %.3g, of Monte Carlo %.3g\n", rms, monte_carlo);
    // The error falls as n^-3/2 but for powers of ln n (Owen, Ann. Stat. 25, 1541, 1997), from n^-1/2 at the first
    // points.
    EXPECT_LT(rms, monte_carlo / 50.0);
    EXPECT_GT(rms, 0.0);
}

TEST(UnitCube, RefusesWhatCannotBe) {
    EXPECT_THAT(message_of<InputError>([] { sobol(101, 2, 1, 100); }), HasSubstr("101 points: 100 is the limit"));
    EXPECT_THAT(message_of<InputError>([] { latin_hypercube(101, 2, 1, 100); }), HasSubstr("100 is the limit"));
    EXPECT_THROW(sobol(0, 2, 1, 100), InputError);
    EXPECT_THROW(sobol(1, 0, 1, 100), InputError);
    EXPECT_THROW(latin_hypercube(0, 2, 1, 100), InputError);
    EXPECT_THROW(latin_hypercube(1, 0, 1, 100), InputError);
    EXPECT_EQ(most_sobol_dimensions(), 3667U);
    EXPECT_NO_THROW(sobol(2, 3667, 1, 100));
    EXPECT_THAT(message_of<InputError>([] { sobol(2, 3668, 1, 100); }), HasSubstr("known for 3667"));
    // More than memory can hold, with products that would overflow.
    EXPECT_THAT(message_of<InputError>([] { sobol(std::uint64_t{1} << 62, 8, 1, no_limit); }), HasSubstr("memory"));
    EXPECT_THAT(message_of<InputError>([] { latin_hypercube(no_limit, 3, 1, no_limit); }), HasSubstr("memory"));
}

Factor values(std::string key, std::vector<double> list) {
    return {.key = std::move(key), .takes = Values{std::move(list)}};
}

TEST(Designs, GridsHaveTheLastFactorFastest) {
    const Plan plan{
        .kind = Kind::grid,
        .factors = {values("a", {1.0, 2.0}), values("b", {5.0}), {.key = "c", .takes = Range{0.0, 1.0, 3}}}};
    EXPECT_EQ(point_count(plan, 6), 6U);
    const Points points = make_points(plan, 6);
    EXPECT_EQ(points.dimensions, 3U);
    EXPECT_THAT(points.values, ElementsAre(1, 5, 0, 1, 5, 0.5, 1, 5, 1, 2, 5, 0, 2, 5, 0.5, 2, 5, 1));
    EXPECT_THAT(message_of<InputError>([&] { point_count(plan, 5); }), HasSubstr("2 x 1 x 3 points: 5 is the limit"));
}

TEST(Designs, GridsAreCountedBeforeMemoryIsAskedFor) {
    Plan plan{.kind = Kind::grid, .factors = {}};
    for (int i = 0; i < 10; ++i) {
        plan.factors.push_back({.key = fmt::format("f{}", i), .takes = Range{0.0, 1.0, 1000}});
    }
    EXPECT_THAT(message_of<InputError>([&] { make_points(plan, 1000000); }), HasSubstr("1000 x 1000"));
    EXPECT_THROW(make_points(plan, no_limit), InputError);
    // A product of 2^64 would be 0.
    plan.factors.assign(2, {.key = "a", .takes = Range{0.0, 1.0, std::uint64_t{1} << 32}});
    plan.factors[1].key = "b";
    EXPECT_THROW(point_count(plan, no_limit), InputError);
    plan.factors[1].takes = Range{0.0, 1.0, (std::uint64_t{1} << 32) - 1};
    EXPECT_EQ(point_count(plan, no_limit), ((std::uint64_t{1} << 32) - 1) << 32);
}

TEST(Designs, ListsPairTheValues) {
    Plan plan{.kind = Kind::list, .factors = {values("a", {1.0, 2.0, 3.0}), values("b", {6.0, 5.0, 4.0})}};
    EXPECT_THAT(make_points(plan, 3).values, ElementsAre(1, 6, 2, 5, 3, 4));
    EXPECT_THROW(make_points(plan, 2), InputError);
    plan.points = 4;
    EXPECT_THAT(message_of<InputError>([&] { make_points(plan, 9); }), HasSubstr("its factors make 3"));
    plan.points = 3;
    EXPECT_NO_THROW(make_points(plan, 9));
    plan.factors[1] = values("b", {6.0, 5.0});
    EXPECT_THAT(message_of<InputError>([&] { make_points(plan, 9); }), HasSubstr("a has 3 values and factor b has 2"));
    plan.factors[1] = {.key = "b", .takes = Range{0.0, 1.0, 3}};
    EXPECT_THAT(message_of<InputError>([&] { make_points(plan, 9); }),
                HasSubstr("factor b: in a list every factor has values"));
}

TEST(Designs, UnitCubesAreMappedToQuantiles) {
    const Factor normal{.key = "a", .takes = Normal{1.0, 2.0}, .lower = 0.0, .upper = 4.0};
    const Factor levels = values("b", {1.0, 5.0, 3.0});
    for (const Kind kind : {Kind::sobol, Kind::latin_hypercube}) {
        const Plan plan{.kind = kind, .factors = {normal, levels}, .points = 300, .seed = 21};
        const Points points = make_points(plan, 300);
        const Points unit = kind == Kind::sobol ? sobol(300, 2, 21, 300) : latin_hypercube(300, 2, 21, 300);
        const Marginal marginal(normal);
        std::map<double, int> count;
        for (std::size_t i = 0; i < 300; ++i) {
            EXPECT_EQ(points[i][0], marginal(unit[i][0]));
            ++count[points[i][1]];
        }
        EXPECT_EQ(points.values, at_quantiles(unit, plan.factors).values);
        // A Latin hypercube has each of three levels a hundred times of 300.
        EXPECT_EQ(count.size(), 3U);
        if (kind == Kind::latin_hypercube) {
            for (const auto& [value, n] : count) EXPECT_EQ(n, 100) << value;
        }
    }
    EXPECT_THROW(at_quantiles(sobol(4, 3, 1, 4), std::vector{normal, levels}), InputError);
}

TEST(Designs, PlansThatCannotBeAreRefused) {
    Plan plan{.kind = Kind::sobol, .factors = {{.key = "a", .takes = Normal{}}}};
    EXPECT_THAT(message_of<InputError>([&] { make_points(plan, 10); }), HasSubstr("of no points"));
    plan.points = 11;
    EXPECT_THAT(message_of<InputError>([&] { make_points(plan, 10); }), HasSubstr("10 is the limit"));
    plan.kind = Kind::grid;
    plan.points = 0;
    EXPECT_THAT(message_of<InputError>([&] { make_points(plan, 10); }),
                HasSubstr("a: a grid has no place for a distribution"));
    plan.factors.push_back({.key = "b", .takes = Normal{}});
    plan.correlations = {{"a", "b", 0.5}};
    EXPECT_THAT(message_of<InputError>([&] { make_points(plan, 10); }), HasSubstr("a grid has no correlations"));
    plan.factors.clear();
    EXPECT_THROW(make_points(plan, 10), InputError);
}

Plan correlated_plan(CorrelationOf of) {
    return {.kind = Kind::latin_hypercube,
            .factors = {{.key = "a", .takes = Normal{10.0, 2.0}, .lower = 9.0},
                        values("levels", {1.0, 2.0}),
                        {.key = "b", .takes = Lognormal{1.0, 0.5}},
                        {.key = "c", .takes = Uniform{0.0, 1.0}, .upper = 0.7},
                        {.key = "d", .takes = Triangular{0.0, 0.2, 1.0}}},
            .correlations = {{"a", "b", 0.8}, {"c", "a", -0.5}, {"b", "c", -0.3}},
            .correlation_of = of,
            .points = 1 << 16,
            .seed = 31};
}

TEST(Correlations, AreThoseAskedFor) {
    const boost::math::normal standard;
    for (const CorrelationOf of : {CorrelationOf::ranks, CorrelationOf::normal_scores}) {
        const Plan plan = correlated_plan(of);
        const Points points = make_points(plan, no_limit);
        const auto n = static_cast<double>(points.count);
        std::vector<std::vector<double>> scores(plan.factors.size());
        for (std::size_t f = 0; f < scores.size(); ++f) {
            scores[f] = ranks(column(points, f));
            if (of == CorrelationOf::ranks) continue;
            for (double& s : scores[f]) s = boost::math::quantile(standard, (s + 0.5) / n);
        }
        const double wanted[5][5] = {
            {1, 0, 0.8, -0.5, 0}, {0, 1, 0, 0, 0}, {0.8, 0, 1, -0.3, 0}, {-0.5, 0, -0.3, 1, 0}, {0, 0, 0, 0, 1}};
        for (std::size_t i = 0; i < 5; ++i) {
            for (std::size_t j = 0; j < i; ++j) {
                const double r = wanted[i][j];
                // Of Spearman's: Bonett, Wright, Psychometrika 65, 23 (2000). Ties of the two levels change nothing, as
                // their ranks are in the order of the points.
                const double more = of == CorrelationOf::ranks ? std::sqrt(1.0 + 0.5 * r * r) : 1.0;
                const double standard_error = more * (1.0 - r * r) / std::sqrt(n);
                const double seen = pearson(scores[i], scores[j]);
                std::printf("%s, %s: %+.4f, %+.2f standard errors off\n", plan.factors[i].key.c_str(),
                            plan.factors[j].key.c_str(), seen, (seen - r) / standard_error);
                EXPECT_NEAR(seen, r, 4.0 * standard_error);
            }
        }
    }
}

TEST(Correlations, LeaveTheDistributionsAsTheyAre) {
    const Plan plan = correlated_plan(CorrelationOf::ranks);
    Plan independent = plan;
    independent.correlations.clear();
    const Points points = make_points(plan, no_limit);
    const Points without = make_points(independent, no_limit);
    // Factors that nothing is said of, and the first of those that depend on each other, keep their values.
    for (const std::size_t f : {0U, 1U, 4U}) EXPECT_EQ(column(points, f), column(without, f));
    for (const std::size_t f : {2U, 3U}) {
        auto x = column(points, f);
        auto y = column(without, f);
        std::ranges::sort(x);
        std::ranges::sort(y);
        // Sorted values of the hypercube lie at the quantiles; those of the others scatter by Kolmogorov's law: 1 in
        // 1000 is above 1.95.
        double distance = 0.0;
        for (std::size_t i = 0; i < x.size(); ++i) {
            const auto rank = std::ranges::lower_bound(y, x[i]) - y.begin();
            distance = std::max(distance, std::abs(static_cast<double>(rank) - static_cast<double>(i)));
        }
        EXPECT_LT(distance / std::sqrt(static_cast<double>(x.size())), 1.95);
    }
}

TEST(Correlations, OfManyExtremesStayProbabilities) {
    std::vector<Factor> factors;
    std::vector<Correlation> correlations;
    for (int i = 0; i < 60; ++i) {
        factors.push_back({.key = std::to_string(i), .takes = Normal{}});
        for (int j = 0; j < i; ++j) correlations.push_back({std::to_string(j), std::to_string(i), 0.5});
    }
    const GaussianCopula copula(factors, correlations, CorrelationOf::normal_scores);
    for (const double u : {0x1p-53, 1.0 - 0x1p-53}) {
        std::vector<Probability> v(factors.size());
        copula(std::vector<double>(factors.size(), u), v);
        for (std::size_t i = 0; i < v.size(); ++i) EXPECT_TRUE(std::isfinite(Marginal(factors[i])(v[i])));
    }
}

TEST(Correlations, ThatCannotBeAreRefusedByName) {
    const Plan plan = correlated_plan(CorrelationOf::ranks);
    const auto refusal = [&](std::vector<Correlation> correlations) {
        return message_of<InputError>([&] { GaussianCopula(plan.factors, correlations, CorrelationOf::ranks); });
    };
    EXPECT_THAT(refusal({{"a", "z", 0.5}}), HasSubstr("correlation of a and z: no factor has the key z"));
    EXPECT_THAT(refusal({{"levels", "a", 0.5}}), HasSubstr("levels has values and no distribution"));
    EXPECT_THAT(refusal({{"a", "a", 0.5}}), HasSubstr("a with itself"));
    EXPECT_THAT(refusal({{"a", "b", 0.5}, {"b", "a", 0.5}}), HasSubstr("is given twice"));
    for (const double value : {1.5, -1.5, std::nan(""), 1.0, -1.0}) {
        EXPECT_THAT(refusal({{"a", "b", value}}), AllOf(HasSubstr("a and b"), HasSubstr("above -1 and below 1")));
    }
    EXPECT_THAT(refusal({{"a", "b", 0.9}, {"b", "c", 0.9}, {"a", "c", -0.9}, {"a", "d", 0.01}}),
                AllOf(HasSubstr("a, b, c contradict each other"), HasSubstr("eigenvalue"), Not(HasSubstr("d contra"))));
    EXPECT_TRUE(GaussianCopula(plan.factors, {}, CorrelationOf::ranks).independent());
    EXPECT_FALSE(GaussianCopula(plan.factors, plan.correlations, CorrelationOf::ranks).independent());
}

}  // namespace
}  // namespace design_points_test
}  // namespace ringlock::test
