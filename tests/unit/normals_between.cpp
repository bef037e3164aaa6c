// Normal numbers between two bounds, against Boost.Math, on every instruction set.
#include "analysis/closure/stats/normals_between.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/math/special_functions/erf.hpp>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "engine/simd/target.hpp"

namespace ringlock::test {
namespace normals_between_test {
namespace {

using Values = std::vector<double>;

struct Between {
    Values probability, number;
};

Between between(const Values& low, double width, const Values& share) {
    Between result{Values(low.size()), Values(low.size())};
    closure::normals_between(low, width, share, result.probability, result.number);
    return result;
}

long double above(long double z) { return 0.5L * std::erfc(z / std::numbers::sqrt2_v<long double>); }

class Normals : public testing::TestWithParam<double> {
   protected:
    ~Normals() override { simd::use_best_target(); }
};

TEST_P(Normals, BetweenBoundsAreAsProbableAndLieWhereTheyShould) {
    const double width = GetParam();
    std::mt19937_64 generator(1);
    std::uniform_real_distribution<double> uniform;
    Values low;
    Values share;
    for (int i = 0; i < 20001; ++i) {  // no whole number of vectors
        low.push_back(-width - 36.0 + (width + 72.0) * uniform(generator));
        share.push_back(uniform(generator));
    }
    for (const std::string& target : simd::available_targets()) {
        SCOPED_TRACE(target);
        simd::use_target(target);
        const Between found = between(low, width, share);
        for (std::size_t i = 0; i < low.size(); ++i) {
            // The side on which both tails are small
            const bool turned = 2.0 * low[i] + width < 0.0;
            const long double near = turned ? -(static_cast<long double>(low[i]) + width) : low[i];
            const long double of_near = above(near);
            const long double of_far = above(near + width);
            ASSERT_NEAR(static_cast<double>(found.probability[i] / (of_near - of_far)), 1.0,
                        1e-11 / std::min(width, 1.0))
                << low[i];
            const long double tail = of_far + (turned ? share[i] : 1.0 - share[i]) * (of_near - of_far);
            // A tail of nearly one is known by what is left of it.
            const long double z =
                tail < 0.5L ? std::numbers::sqrt2_v<long double> * boost::math::erfc_inv(2.0L * tail)
                            : -std::numbers::sqrt2_v<long double> * boost::math::erfc_inv(2.0L * (1.0L - tail));
            const double exact = static_cast<double>(turned ? -z : z);
            ASSERT_NEAR(found.number[i], exact, 1e-10) << low[i] << " share " << share[i];
            ASSERT_GE(found.number[i], low[i]);
            ASSERT_LE(found.number[i], low[i] + width);
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Widths, Normals, testing::Values(0.3, 1.0, 3.0, 10.0, 60.0));

// Beyond 37 standard deviations nothing is left: no number is lost all the same.
TEST(NormalsBetween, FarAwayAreAtTheBound) {
    const Between found = between({60.0, -70.0, 1e6, -1e9}, 10.0, {0.5, 0.5, 0.0, 1.0});
    EXPECT_EQ(found.probability, Values(4, 0.0));
    EXPECT_EQ(found.number, (Values{60.0, -60.0, 1e6, -1e9 + 10.0}));
}

}  // namespace
}  // namespace normals_between_test
}  // namespace ringlock::test
