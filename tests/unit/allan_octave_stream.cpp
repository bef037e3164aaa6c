#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/octave_deviation.hpp"
#include "analysis/allan/octave_stream.hpp"
#include "engine/core/error.hpp"
#include "engine/simd/target.hpp"

namespace allan_octave_stream_test {
namespace {

using namespace ringlock;
using allan::Octave;
using allan::OctaveStream;
using allan::SquareSum;
using simd::LaneCounts;

__extension__ using Wide = unsigned __int128;
__extension__ using Signed = __int128;

constexpr std::int64_t least = std::numeric_limits<std::int64_t>::min();
constexpr std::int64_t largest = std::numeric_limits<std::int64_t>::max();

/// Straight from the definition on a record that is all there. Squares are summed as two halves of 64 bits.
std::vector<Octave> plain(const std::vector<LaneCounts>& rows, std::size_t lane) {
    const auto n = static_cast<std::int64_t>(rows.size());
    const auto x = [&](std::int64_t i) { return static_cast<std::uint64_t>(rows[static_cast<std::size_t>(i)][lane]); };
    std::vector<Octave> out;
    for (std::int64_t m = 1; 2 * m < n; m *= 2) {
        Octave octave{m, {}, 0};
        Wide lower = 0;
        Wide upper = 0;
        for (std::int64_t i = 0; i + 2 * m < n; i += std::max<std::int64_t>(1, m / OctaveStream::starts_per_tau)) {
            const auto d = static_cast<std::int64_t>(x(i + 2 * m) - 2 * x(i + m) + x(i));
            const Wide square = static_cast<Wide>(static_cast<Signed>(d) * d);
            lower += static_cast<std::uint64_t>(square);
            upper += static_cast<std::uint64_t>(square >> 64);
            ++octave.terms;
        }
        const Wide carried = upper + static_cast<std::uint64_t>(lower >> 64);
        octave.sum.words = {static_cast<std::uint64_t>(lower), static_cast<std::uint64_t>(carried),
                            static_cast<std::uint64_t>(carried >> 64)};
        out.push_back(octave);
    }
    return out;
}

void expect_equal(const std::vector<Octave>& found, const std::vector<Octave>& expected, const std::string& where) {
    ASSERT_EQ(found.size(), expected.size()) << where;
    for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].m, expected[i].m) << where;
        EXPECT_EQ(found[i].terms, expected[i].terms) << where << " m " << found[i].m;
        EXPECT_EQ(found[i].sum, expected[i].sum) << where << " m " << found[i].m;
    }
}

OctaveStream streamed(const std::vector<LaneCounts>& rows, std::size_t lanes = simd::lanes, std::size_t piece = 64) {
    OctaveStream stream;
    for (std::size_t i = 0; i < rows.size(); i += piece) {
        stream.add(std::span(rows).subspan(i, std::min(piece, rows.size() - i)), lanes);
    }
    return stream;
}

void expect_exact(const std::vector<LaneCounts>& rows, const std::string& what) {
    const OctaveStream stream = streamed(rows);
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        expect_equal(stream.octaves(lane), plain(rows, lane), what + " lane " + std::to_string(lane));
    }
}

/// Walks whose steps have `bits` bits and a sign.
std::vector<LaneCounts> walks(std::size_t samples, int bits, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::vector<LaneCounts> rows(samples);
    for (std::size_t i = 1; i < samples; ++i) {
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const std::int64_t step = static_cast<std::int64_t>(random()) >> (63 - bits);
            rows[i][lane] = static_cast<std::int64_t>(static_cast<std::uint64_t>(rows[i - 1][lane]) + step);
        }
    }
    return rows;
}

/// Puts the best instruction set back.
struct OctaveStreamTest : testing::Test {
    void TearDown() override { simd::use_best_target(); }
};

// 20 bits: every second difference has less than 32; 26: the long octaves have more; 31: around the bound; 45: all
// have more. Beyond 65536 terms running sums are put away.
TEST_F(OctaveStreamTest, EqualsThePlainLoopOnEveryInstructionSet) {
    for (const std::string& target : simd::available_targets()) {
        simd::use_target(target);
        for (const int bits : {20, 26, 31, 45}) {
            expect_exact(walks(3001, bits, 1), target + " bits " + std::to_string(bits));
        }
    }
    simd::use_best_target();
    expect_exact(walks(150000, 20, 2), "long narrow");
    expect_exact(walks(150000, 45, 3), "long wide");
}

TEST_F(OctaveStreamTest, ShortRecordsHaveTheOctavesThatFit) {
    const auto rows = walks(700, 30, 4);
    for (std::size_t samples = 0; samples <= rows.size(); ++samples) {
        const std::vector<LaneCounts> head(rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(samples));
        const OctaveStream stream = streamed(head);
        EXPECT_EQ(stream.samples(), static_cast<std::int64_t>(samples));
        const auto found = stream.octaves(3);
        expect_equal(found, plain(head, 3), "samples " + std::to_string(samples));
        const auto batch =
            allan::octave_factors(allan::largest_factor(allan::Estimator::oadev, static_cast<std::int64_t>(samples)));
        EXPECT_EQ(found.size(), batch.size()) << samples;
    }
    EXPECT_TRUE(OctaveStream().octaves(0).empty());
}

// Sums can be asked for at any time and the record goes on.
TEST_F(OctaveStreamTest, DoesNotDependOnPieces) {
    const auto rows = walks(5003, 40, 5);
    const auto expected = plain(rows, 11);
    for (const std::size_t piece : {1, 7, 32, 64, 1000, 5003}) {
        expect_equal(streamed(rows, simd::lanes, piece).octaves(11), expected, "piece " + std::to_string(piece));
    }
    std::mt19937_64 random(6);
    OctaveStream stream;
    for (std::size_t i = 0; i < rows.size();) {
        const std::size_t piece = std::min<std::size_t>(random() % 100, rows.size() - i);
        stream.add(std::span(rows).subspan(i, piece), simd::lanes);
        i += piece;
        if (i < 2000) {
            const std::vector<LaneCounts> head(rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(i));
            expect_equal(stream.octaves(11), plain(head, 11), "after " + std::to_string(i));
        }
    }
    expect_equal(stream.octaves(11), expected, "random pieces");
}

// The same gyro in any column, beside any others, with any number of columns meant. One of the others is wide, so that
// its vector is summed in the other way.
TEST_F(OctaveStreamTest, DoesNotDependOnTheLane) {
    const auto one = walks(2000, 20, 7);
    const auto expected = plain(one, 0);
    for (const std::string& target : simd::available_targets()) {
        simd::use_target(target);
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            auto rows = walks(2000, 50, 8 + lane);
            for (std::size_t i = 0; i < rows.size(); ++i) rows[i][lane] = one[i][0];
            for (const std::size_t lanes : {lane + 1, simd::lanes}) {
                expect_equal(streamed(rows, lanes).octaves(lane), expected, target + " lane " + std::to_string(lane));
            }
        }
    }
}

// Phase that runs away passes the largest number again and again: second differences are those of the phase at rest.
TEST_F(OctaveStreamTest, CountsMayWrapAround) {
    const auto rows = walks(3000, 44, 9);
    const auto expected = plain(rows, 5);
    for (const std::uint64_t rate : {0x2000000000000000ULL, 0x7123456789abcdefULL}) {
        auto running = rows;
        for (std::size_t i = 0; i < rows.size(); ++i) {
            running[i][5] = static_cast<std::int64_t>(static_cast<std::uint64_t>(rows[i][5]) + rate * (i + 7));
        }
        expect_equal(streamed(running).octaves(5), expected, "rate " + std::to_string(rate));
    }
}

// The largest second differences there are, up to -2^63 itself: the sums pass 128 bits.
TEST_F(OctaveStreamTest, HugeSecondDifferencesAreExact) {
    for (const std::string& target : simd::available_targets()) {
        simd::use_target(target);
        std::mt19937_64 random(10);
        for (const std::int64_t size : {std::int64_t{1} << 31, std::int64_t{1} << 32, (std::int64_t{1} << 62) - 1,
                                        std::int64_t{1} << 62, largest, least}) {
            std::vector<LaneCounts> rows(600);
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                // Sums of the second differences that are wanted at m = 1; longer ones take any value.
                std::uint64_t step = 0;
                std::uint64_t x = 0;
                for (std::size_t i = 0; i < rows.size(); ++i) {
                    x += step;
                    rows[i][lane] = static_cast<std::int64_t>(x);
                    const auto d = static_cast<std::uint64_t>(size) - random() % 3 * (lane % 2);
                    step += random() % 2 == 0 ? d : 0 - d;
                }
            }
            expect_exact(rows, target + " size " + std::to_string(size));
        }
    }
    std::vector<LaneCounts> rows(40);  // second differences -2^63, all of them
    std::uint64_t step = 0;
    for (std::size_t i = 1; i < rows.size(); ++i, step += std::uint64_t{1} << 63) {
        rows[i][0] = static_cast<std::int64_t>(static_cast<std::uint64_t>(rows[i - 1][0]) + step);
    }
    const Octave first = streamed(rows).octaves(0).front();
    EXPECT_EQ(first.sum.rounded(), 38 * 0x1p126);
}

TEST_F(OctaveStreamTest, RefusesLanesThatAreNotThere) {
    const auto rows = walks(5, 10, 11);
    OctaveStream stream;
    EXPECT_THROW(stream.add(rows, 0), std::invalid_argument);
    EXPECT_THROW(stream.add(rows, simd::lanes + 1), std::invalid_argument);
    stream.add(rows, 3);
    EXPECT_THROW(stream.add(rows, 4), std::invalid_argument);
    EXPECT_EQ(stream.samples(), 5);
    EXPECT_THROW(stream.octaves(3), std::out_of_range);
}

TEST(AllanSquareSum, RoundsToNearestEven) {
    const auto of = [](std::uint64_t w0, std::uint64_t w1, std::uint64_t w2) {
        return SquareSum{{w0, w1, w2}}.rounded();
    };
    EXPECT_EQ(of(0, 0, 0), 0.0);
    EXPECT_EQ(of(3, 0, 0), 3.0);
    EXPECT_EQ(of(~0ULL, 0, 0), 0x1p64);
    EXPECT_EQ(of(~0ULL, ~0ULL, ~0ULL), 0x1p192);
    // 1 + 2^-53 of the leading bit is a tie and goes to the even neighbour, anything below makes it more.
    EXPECT_EQ(of(std::uint64_t{1} << 11, 1, 0), 0x1p64);
    EXPECT_EQ(of((std::uint64_t{1} << 11) + 1, 1, 0), 0x1p64 + 0x1p12);
    EXPECT_EQ(of(0, std::uint64_t{1} << 11, 1), 0x1p128);
    EXPECT_EQ(of(1, std::uint64_t{1} << 11, 1), 0x1p128 + 0x1p76);
    EXPECT_EQ(of(0, std::uint64_t{3} << 11, 1), 0x1p128 + 0x1p77);
    EXPECT_EQ(of(1, (std::uint64_t{1} << 63) + (std::uint64_t{1} << 10), 0), 0x1p127 + 0x1p75);
    EXPECT_EQ(of(0, (std::uint64_t{1} << 63) + (std::uint64_t{1} << 10), 0), 0x1p127);
}

// Where the stride is one sample the two are the same estimator; 1e-12 is the rounding of the sum of doubles.
TEST(AllanOctaveDeviation, EqualsTheOneOfStoredRecordsWhereTheStrideIsOneSample) {
    constexpr double unit = 1e-3;
    constexpr double tau0_s = 0.008;
    const auto rows = walks(4097, 22, 12);
    const OctaveStream stream = streamed(rows);
    for (const std::size_t lane : {std::size_t{0}, std::size_t{9}}) {
        std::vector<double> x;
        for (const LaneCounts& row : rows) x.push_back(unit * static_cast<double>(row[lane]));
        const auto factors = allan::octave_factors(allan::largest_factor(allan::Estimator::oadev, 4097));
        const auto stored = allan::deviation(allan::Estimator::oadev,
                                             allan::centred_phase(x, allan::Kind::phase, tau0_s), tau0_s, factors);
        const auto points = allan::deviation(stream, lane, unit, tau0_s);
        ASSERT_EQ(points.size(), stored.size());
        for (std::size_t i = 0; i < points.size(); ++i) {
            EXPECT_EQ(points[i].m, stored[i].m);
            EXPECT_DOUBLE_EQ(points[i].tau_s, stored[i].tau_s);
            if (points[i].m > OctaveStream::starts_per_tau) continue;
            EXPECT_NEAR(points[i].dev, stored[i].dev, 1e-12 * stored[i].dev) << points[i].m;
            EXPECT_EQ(points[i].terms, stored[i].terms);
            EXPECT_EQ(points[i].alpha, stored[i].alpha);
            EXPECT_NEAR(points[i].edf, stored[i].edf, 1e-9 * stored[i].edf) << points[i].m;
            EXPECT_NEAR(points[i].lo, stored[i].lo, 1e-9 * stored[i].dev);
            EXPECT_NEAR(points[i].hi, stored[i].hi, 1e-9 * stored[i].dev);
        }
    }
}

TEST(AllanOctaveDeviation, SaysNothingOfWhatIsNotThere) {
    const OctaveStream still = streamed(std::vector<LaneCounts>(100));
    for (const allan::Point& p : allan::deviation(still, 0, 1.0, 1.0)) {
        EXPECT_EQ(p.dev, 0.0);
        EXPECT_EQ(p.lo, 0.0);
        EXPECT_EQ(p.hi, 0.0);
        EXPECT_EQ(p.alpha, 0);
        EXPECT_GE(p.edf, 1.0 - 1e-12);
    }
    EXPECT_TRUE(allan::deviation(streamed(std::vector<LaneCounts>(2)), 0, 1.0, 1.0).empty());
    for (const double bad : {0.0, -1.0, std::numeric_limits<double>::infinity(), std::nan("")}) {
        EXPECT_THROW(allan::deviation(still, 0, bad, 1.0), InputError);
        EXPECT_THROW(allan::deviation(still, 0, 1.0, bad), InputError);
    }
    EXPECT_THROW(allan::deviation(still, 0, 1.0, 1.0, 1.0), InputError);
    EXPECT_THROW(allan::deviation(still, simd::lanes, 1.0, 1.0), std::out_of_range);
}

}  // namespace
}  // namespace allan_octave_stream_test
