// Normal deviates of the vector code: against Random123's words, normal statistics, and the stream made by
// Boost.Random. The statistical tests have fixed seeds; "standard errors" are those of independent normal deviates.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/poisson.hpp>
#include <boost/math/statistics/anderson_darling.hpp>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "engine/random/normal_lanes.hpp"
#include "engine/simd/target.hpp"

namespace ringlock::test {
namespace random_normals_test {
namespace {

using random::LaneIdentities;
using random::Purpose;
using simd::lanes;

constexpr Purpose noise = Purpose::noise_injection;

std::vector<simd::Lanes> draw(const LaneIdentities& who, Purpose purpose, std::uint64_t first_step, std::size_t steps,
                              std::size_t wanted = lanes) {
    std::vector<simd::Lanes> out(steps);
    random::normals(who, purpose, first_step, steps, wanted, out.front().data());
    return out;
}

LaneIdentities block(std::uint64_t seed, std::uint64_t first_gyro) {
    LaneIdentities who;
    who.seed = seed;
    for (std::size_t lane = 0; lane < lanes; ++lane) who.gyro[lane] = first_gyro + lane;
    return who;
}

/// One gyro after the other, each `steps` long.
std::vector<double> sample(std::uint64_t seed, Purpose purpose, std::size_t blocks, std::size_t steps,
                           std::uint64_t first_gyro = 0) {
    std::vector<double> values;
    values.reserve(blocks * lanes * steps);
    for (std::size_t i = 0; i < blocks; ++i) {
        const auto rows = draw(block(seed, first_gyro + i * lanes), purpose, 0, steps);
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            for (const auto& row : rows) values.push_back(row[lane]);
        }
    }
    return values;
}

/// The deviate as its definition says, from Random123's own words, in long double.
struct Defined {
    long double value;
    long double radius;
};

Defined defined(std::uint64_t seed, std::uint64_t gyro, Purpose purpose, std::uint64_t step) {
    const std::uint64_t pair = step / 2;
    const auto low = [](std::uint64_t x) { return static_cast<std::uint32_t>(x); };
    const auto high = [](std::uint64_t x) { return static_cast<std::uint32_t>(x >> 32); };
    const r123::Philox4x32::ctr_type counter = {
        {low(pair), high(pair), low(gyro), (high(gyro) << 8) | static_cast<std::uint32_t>(purpose)}};
    const r123::Philox4x32::key_type key = {{low(seed), high(seed)}};
    const auto words = r123::Philox4x32()(counter, key);
    // The upper 52 bits of two words.
    const auto fraction = [](std::uint32_t first, std::uint32_t second) {
        return static_cast<long double>((std::uint64_t{first} << 20) | (second >> 12)) * 0x1p-52L;
    };
    const long double pi = 3.141592653589793238462643383279502884L;
    const long double radius = std::sqrt(-2.0L * std::log(1.0L - fraction(words[0], words[1])));
    const long double angle = 2.0L * pi * fraction(words[2], words[3]);
    return {radius * (step % 2 == 0 ? std::cos(angle) : std::sin(angle)), radius};
}

class RandomNormals : public testing::Test {
   protected:
    ~RandomNormals() override { simd::use_best_target(); }
};

TEST_F(RandomNormals, AreThoseOfRandom123sWords) {
    std::mt19937_64 random(201);
    double worst = 0.0;
    for (int i = 0; i < 2000; ++i) {
        LaneIdentities who;
        who.seed = random();
        for (auto& gyro : who.gyro) gyro = random() >> (8 + random() % 56);  // up to 2^56, any size
        const auto purpose = static_cast<Purpose>(1 + random() % 255);
        const std::uint64_t first = random() >> (1 + random() % 63);
        const auto rows = draw(who, purpose, first, 3);
        for (std::size_t step = 0; step < rows.size(); ++step) {
            for (std::size_t lane = 0; lane < lanes; ++lane) {
                const Defined exact = defined(who.seed, who.gyro[lane], purpose, first + step);
                const auto error = static_cast<double>(std::abs(rows[step][lane] - exact.value));
                worst = std::max(worst, error / static_cast<double>(exact.radius));
            }
        }
    }
    std::printf("worst error %.3g of the radius\n", worst);
    // Logarithm 3e-16, halved by the root; root and product 1.1e-16 each; sine 2e-16.
    EXPECT_LT(worst, 6e-16);
}

TEST_F(RandomNormals, EveryWordOfTheCounterAndTheKeyMatters) {
    // One bit of any of them changes both deviates of the pair.
    const std::uint64_t seed = 0x0123456789abcdefU;
    const std::uint64_t gyro = 0x00fedcba98765432U;
    const std::uint64_t pair = 0x0102030405060708U;
    const auto at = [](std::uint64_t s, std::uint64_t g, std::uint64_t step) {
        return random::normal({s, g}, noise, step);
    };
    for (const std::uint64_t side : {0U, 1U}) {
        const double first = at(seed, gyro, 2 * pair + side);
        for (int bit = 0; bit < 64; ++bit) {
            const std::uint64_t mask = std::uint64_t{1} << bit;
            EXPECT_NE(at(seed ^ mask, gyro, 2 * pair + side), first) << "seed, bit " << bit;
            if (bit < 56) {
                EXPECT_NE(at(seed, gyro ^ mask, 2 * pair + side), first) << "gyro, bit " << bit;
            }
            if (bit < 63) {
                EXPECT_NE(at(seed, gyro, 2 * (pair ^ mask) + side), first) << "step, bit " << bit;
            }
        }
    }
}

TEST_F(RandomNormals, DependOnNothingButGyroPurposeAndStep) {
    // Gyros and steps on both sides of 2^32.
    const std::uint64_t seed = 77;
    const std::uint64_t first = (std::uint64_t{1} << 33) - 5;
    const std::size_t steps = 23;
    LaneIdentities who = block(seed, (std::uint64_t{1} << 32) - 7);
    const auto reference = draw(who, noise, first, steps);
    std::mt19937_64 random(202);
    for (const std::string& target : simd::available_targets()) {
        simd::use_target(target);
        for (int i = 0; i < 50; ++i) {
            // Other lanes, some lanes only, other pieces.
            std::array<std::size_t, lanes> from{};
            for (std::size_t lane = 0; lane < lanes; ++lane) from[lane] = lane;
            std::shuffle(from.begin(), from.end(), random);
            LaneIdentities moved = who;
            for (std::size_t lane = 0; lane < lanes; ++lane) moved.gyro[lane] = who.gyro[from[lane]];
            const std::size_t wanted = 1 + random() % lanes;
            std::size_t wrong = 0;
            for (std::size_t begin = 0; begin < steps;) {
                const std::size_t count = std::min<std::size_t>(1 + random() % 6, steps - begin);
                const auto rows = draw(moved, noise, first + begin, count, wanted);
                for (std::size_t step = 0; step < count; ++step) {
                    for (std::size_t lane = 0; lane < wanted; ++lane) {
                        wrong += rows[step][lane] == reference[begin + step][from[lane]] ? 0 : 1;
                    }
                }
                begin += count;
            }
            ASSERT_EQ(wrong, 0U) << target << ", " << wanted << " lanes";
        }
        for (std::size_t step = 0; step < steps; ++step) {
            ASSERT_EQ(random::normal({seed, who.gyro[3]}, noise, first + step), reference[step][3]) << target;
        }
    }
}

TEST_F(RandomNormals, EveryInstructionSetHasTheSameBits) {
    const LaneIdentities who = block(78, 0);
    const auto reference = draw(who, noise, 0, 20000);
    for (const std::string& target : simd::available_targets()) {
        simd::use_target(target);
        const auto rows = draw(who, noise, 0, reference.size());
        std::size_t wrong = 0;
        for (std::size_t step = 0; step < rows.size(); ++step) {
            for (std::size_t lane = 0; lane < lanes; ++lane) wrong += rows[step][lane] == reference[step][lane] ? 0 : 1;
        }
        EXPECT_EQ(wrong, 0U) << target;
    }
}

TEST_F(RandomNormals, WriteNoFurtherThanWholeVectors) {
    for (const std::string& target : simd::available_targets()) {
        simd::use_target(target);
        for (std::size_t wanted = 1; wanted <= lanes; ++wanted) {
            std::vector<simd::Lanes> rows(4);
            for (auto& row : rows) std::fill(std::begin(row.values), std::end(row.values), 1e9);
            random::normals(block(79, 0), noise, 5, 2, wanted, rows[1].data());
            for (std::size_t lane = 0; lane < lanes; ++lane) {
                EXPECT_EQ(rows[0][lane], 1e9) << target;
                EXPECT_EQ(rows[3][lane], 1e9) << target;
                // 8 lanes is the widest vector there is.
                if (lane >= (wanted + 7) / 8 * 8) {
                    EXPECT_EQ(rows[1][lane], 1e9) << target;
                }
            }
        }
    }
}

TEST_F(RandomNormals, MomentsToTheSixth) {
    const auto values = sample(301, noise, 4, 1 << 17);
    const auto n = static_cast<double>(values.size());
    double double_factorial[13] = {1.0};  // E x^k: (k - 1)!! for even k, 0 for odd
    for (int k = 2; k <= 12; k += 2) double_factorial[k] = double_factorial[k - 2] * (k - 1);
    std::vector<double> power(values.size(), 1.0);
    for (int k = 1; k <= 6; ++k) {
        double sum = 0.0;
        for (std::size_t i = 0; i < values.size(); ++i) sum += power[i] *= values[i];
        const double expected = double_factorial[k];
        const double standard_error = std::sqrt((double_factorial[2 * k] - expected * expected) / n);
        const double off = (sum / n - expected) / standard_error;
        std::printf("moment %d: %+.2f standard errors off\n", k, off);
        EXPECT_LT(std::abs(off), 4.0) << "moment " << k;
    }
}

TEST_F(RandomNormals, TailsBeyondFiveSigma) {
    const auto values = sample(302, noise, 16, 1 << 16);
    for (const double sigma : {3.0, 4.0, 5.0}) {
        for (const double side : {1.0, -1.0}) {
            const auto count = static_cast<double>(
                std::count_if(values.begin(), values.end(), [&](double x) { return side * x > sigma; }));
            const double mean = static_cast<double>(values.size()) * 0.5 * std::erfc(sigma / std::sqrt(2.0));
            const boost::math::poisson_distribution<double> expected(mean);
            std::printf("beyond %+.0f sigma: %.0f, expected %.1f\n", side * sigma, count, mean);
            // Each of the six has a chance of 2e-4 to fail.
            EXPECT_GE(count, boost::math::quantile(expected, 1e-4));
            EXPECT_LE(count, boost::math::quantile(boost::math::complement(expected, 1e-4)));
        }
    }
}

TEST_F(RandomNormals, AndersonAndDarlingFindThemNormal) {
    for (const std::uint64_t seed : {303U, 304U, 305U}) {
        auto values = sample(seed, noise, 1, 1 << 14);
        std::sort(values.begin(), values.end());
        const double statistic = boost::math::statistics::anderson_darling_normality_statistic(values, 0.0, 1.0);
        std::printf("Anderson-Darling: %.2f\n", statistic);
        // Mean and deviation known: 1 in 1000 is above 6.0 (Stephens, J. Am. Stat. Assoc. 69, 730, 1974).
        EXPECT_LT(statistic, 6.0);
        // The test can tell: 1.5 % more of deviation is found out.
        for (double& x : values) x *= 1.015;
        EXPECT_GT(boost::math::statistics::anderson_darling_normality_statistic(values, 0.0, 1.0), 6.0);
    }
}

/// Largest distance of two empirical distributions in units that have Kolmogorov's distribution.
double kolmogorov_smirnov(std::vector<double> a, std::vector<double> b) {
    std::sort(a.begin(), a.end());
    std::sort(b.begin(), b.end());
    const auto n = static_cast<double>(a.size());
    const auto m = static_cast<double>(b.size());
    double distance = 0.0;
    std::size_t i = 0;
    std::size_t j = 0;
    while (i < a.size() && j < b.size()) {
        a[i] <= b[j] ? ++i : ++j;
        distance = std::max(distance, std::abs(static_cast<double>(i) / n - static_cast<double>(j) / m));
    }
    return distance * std::sqrt(n * m / (n + m));
}

TEST_F(RandomNormals, AreDistributedAsBoostsAre) {
    const auto values = sample(306, noise, 1, 1 << 16);
    std::vector<double> reference;
    for (std::uint64_t gyro = 0; gyro < lanes; ++gyro) {
        random::NormalStream stream({306, gyro}, noise);
        for (int i = 0; i < 1 << 16; ++i) reference.push_back(stream());
    }
    const double distance = kolmogorov_smirnov(values, reference);
    std::printf("Kolmogorov-Smirnov: %.2f\n", distance);
    EXPECT_LT(distance, 1.95);  // 1 in 1000 is above
    for (double& x : reference) x += 0.005;
    EXPECT_GT(kolmogorov_smirnov(values, reference), 1.95);  // the test can tell
}

/// Correlation of two samples, and of their squares, in standard errors.
struct Correlation {
    double of_values;
    double of_squares;
};

Correlation correlation(const std::vector<double>& a, const std::vector<double>& b) {
    Correlation sum{0.0, 0.0};
    const std::size_t n = std::min(a.size(), b.size());
    for (std::size_t i = 0; i < n; ++i) {
        sum.of_values += a[i] * b[i];
        sum.of_squares += (a[i] * a[i] - 1.0) * (b[i] * b[i] - 1.0);
    }
    // Both have variance 1 and their squares 2.
    const double root = std::sqrt(static_cast<double>(n));
    return {sum.of_values / root, sum.of_squares / (2.0 * root)};
}

void expect_independent(const std::vector<double>& a, const std::vector<double>& b, const char* what) {
    const Correlation c = correlation(a, b);
    std::printf("%s: %+.2f, squares %+.2f standard errors\n", what, c.of_values, c.of_squares);
    // Two dozen figures in all: one in 300 seeds has one beyond 4.
    EXPECT_LT(std::abs(c.of_values), 4.0) << what;
    EXPECT_LT(std::abs(c.of_squares), 4.0) << what;
}

TEST_F(RandomNormals, StepsDoNotCorrelate) {
    const auto values = sample(307, noise, 1, 1 << 18);
    for (const std::size_t lag : {1U, 2U, 3U, 4U, 16U}) {
        const std::vector<double> later(values.begin() + static_cast<std::ptrdiff_t>(lag), values.end());
        expect_independent(values, later, ("lag " + std::to_string(lag)).c_str());
    }
    // The two of a pair share a radius, and must not show it.
    std::vector<double> even;
    std::vector<double> odd;
    for (std::size_t i = 0; i + 1 < values.size(); i += 2) {
        even.push_back(values[i]);
        odd.push_back(values[i + 1]);
    }
    expect_independent(even, odd, "pairs");
}

TEST_F(RandomNormals, GyrosPurposesAndSeedsDoNotCorrelate) {
    const std::size_t steps = 1 << 17;
    const auto values = sample(308, noise, 1, steps);
    expect_independent(values, sample(308, noise, 1, steps, 1), "next gyro");
    expect_independent(values, sample(308, noise, 1, steps, std::uint64_t{1} << 32), "gyro + 2^32");
    expect_independent(values, sample(308, Purpose::detector_noise, 1, steps), "next purpose");
    expect_independent(values, sample(309, noise, 1, steps), "next seed");
    expect_independent(values, sample(308 + (std::uint64_t{1} << 32), noise, 1, steps), "seed + 2^32");
    // Gyros that share a counter word with a purpose: 2^32 gyros on is 256 purposes on, never another purpose.
    expect_independent(values, sample(308, noise, 1, steps, std::uint64_t{1} << 40), "gyro + 2^40");
}

}  // namespace
}  // namespace random_normals_test
}  // namespace ringlock::test
