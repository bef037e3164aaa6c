#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "analysis/allan/bounded_record.hpp"
#include "analysis/noise/fit.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_bounded_record_test {
namespace {

using namespace ringlock;
using allan::BoundedRecord;
using simd::LaneCounts;

TEST(AllanBoundedRecord, TakesTheLeastPowerOfTwoThatIsNeeded) {
    for (std::int64_t total = 1; total < 400; ++total) {
        for (const std::int64_t most : {2, 3, 8, 10, 64}) {
            const std::int64_t interval = BoundedRecord(total, most).interval();
            EXPECT_EQ(interval & (interval - 1), 0);
            EXPECT_LE((total - 1) / interval + 1, most) << total;
            if (interval > 1) {
                EXPECT_GT((total - 1) / (interval / 2) + 1, most) << total;
            }
        }
    }
    EXPECT_EQ(BoundedRecord(300000000, 8192).interval(), 65536);  // a month of dither cycles
    EXPECT_EQ(BoundedRecord(8192, 8192).interval(), 1);
    EXPECT_EQ(BoundedRecord(8193, 8192).interval(), 2);
}

TEST(AllanBoundedRecord, KeepsTheSameSamplesFromAnyPieces) {
    std::vector<LaneCounts> rows(1000);
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i][4] = static_cast<std::int64_t>(i * i);
    for (const std::size_t piece : {1, 7, 8, 64, 1000}) {
        BoundedRecord record(1000, 130);
        ASSERT_EQ(record.interval(), 8);
        for (std::size_t i = 0; i < rows.size(); i += piece) {
            record.add(std::span(rows).subspan(i, std::min(piece, rows.size() - i)));
        }
        ASSERT_EQ(record.size(), 125u);
        const std::vector<double> phase = record.phase(4, 0.5);
        // i^2 at the last kept sample, 992, makes 7936 in each of the 124 increments.
        for (std::size_t k = 0; k < phase.size(); ++k) {
            const double i = 8.0 * static_cast<double>(k);
            EXPECT_EQ(phase[k], 0.5 * (i * i - 7936.0 * static_cast<double>(k))) << piece << ' ' << k;
        }
        EXPECT_THROW(record.add(std::span(rows).first(1)), std::length_error);
    }
}

// Counts that wrap around at nearly every sample leave what they go round with.
TEST(AllanBoundedRecord, CountsMayWrapAround) {
    constexpr std::uint64_t increment = 0x3123456789abcdefULL;  // to each kept sample
    for (const bool backwards : {false, true}) {
        std::vector<LaneCounts> rows(101);
        for (std::size_t i = 0; i < rows.size(); ++i) {
            const std::uint64_t run = increment * i;
            rows[i][0] = static_cast<std::int64_t>((backwards ? 0 - run : run) + i % 2);
        }
        BoundedRecord record(101, 101);
        record.add(rows);
        const std::vector<double> phase = record.phase(0, 2.0);
        for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(phase[i], 2.0 * static_cast<double>(i % 2)) << i;
    }
}

// An increment near half of what counts hold falls to either side of where they go round.
TEST(AllanBoundedRecord, IncrementsMayBeAsLargeAsCountsHold) {
    std::vector<LaneCounts> rows(101);
    for (std::size_t i = 1; i < rows.size(); ++i) {
        const std::uint64_t increment = (std::uint64_t{1} << 63) + (i % 2 == 0 ? 5 : 0) - (i % 2 == 0 ? 0 : 5);
        rows[i][3] = static_cast<std::int64_t>(static_cast<std::uint64_t>(rows[i - 1][3]) + increment);
    }
    BoundedRecord record(101, 101);
    record.add(rows);
    const std::vector<double> phase = record.phase(3, 1.0);
    for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(phase[i], i % 2 == 0 ? 0.0 : -5.0) << i;
}

TEST(AllanBoundedRecord, IsEmptyOrStillWithoutData) {
    BoundedRecord record(5, 4);
    EXPECT_TRUE(record.phase(0, 1.0).empty());
    record.add(std::vector<LaneCounts>(1));
    EXPECT_EQ(record.phase(15, 1.0), std::vector<double>{0.0});
    EXPECT_THROW(BoundedRecord(0, 4), std::invalid_argument);
    EXPECT_THROW(BoundedRecord(10, 1), std::invalid_argument);
}

// The fit of a record of a sixteenth of the samples finds the angle random walk that was put in. Its standard error is
// 1/sqrt(2 increments) = 1.1 %; four of them are allowed.
TEST(AllanBoundedRecord, SuitsTheFitOfNoiseCoefficients) {
    constexpr double unit_arcsec = 1e-6;
    constexpr double tau0_s = 0.05;
    constexpr double n_arcsec_rt_s = 0.3;
    const auto angle_arcsec = test::simulate_angle({.n = n_arcsec_rt_s}, 65536, tau0_s, 3);
    std::vector<LaneCounts> rows(angle_arcsec.size());
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i][7] = std::llround(angle_arcsec[i] / unit_arcsec);
    BoundedRecord record(static_cast<std::int64_t>(rows.size()), 4097);
    record.add(rows);
    ASSERT_EQ(record.interval(), 16);
    const auto fit = noise::fit_noise(record.phase(7, unit_arcsec), tau0_s * static_cast<double>(record.interval()));
    ASSERT_TRUE(fit.arw_deg_rt_h.resolved);
    EXPECT_NEAR(*fit.arw_deg_rt_h.value, n_arcsec_rt_s / 60.0, 0.044 * n_arcsec_rt_s / 60.0);
    EXPECT_FALSE(fit.bias_instability_deg_h.resolved);
}

}  // namespace
}  // namespace allan_bounded_record_test
