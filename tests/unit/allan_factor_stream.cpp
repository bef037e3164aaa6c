#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/factor_stream.hpp"
#include "analysis/allan/octave_deviation.hpp"
#include "engine/core/error.hpp"
#include "engine/random/stream.hpp"

namespace ringlock::allan {
namespace allan_factor_stream_test {
namespace {

/// Counts of random walks of very different sizes, one a lane; that of the last lane wraps around.
std::vector<simd::LaneCounts> walks(std::size_t samples) {
    std::vector<simd::LaneCounts> rows(samples);
    std::vector<random::NormalStream> steps;
    for (std::uint64_t lane = 0; lane < simd::lanes; ++lane) {
        steps.emplace_back(random::Identity{7, lane}, random::Purpose::detector_noise);
    }
    std::array<std::uint64_t, simd::lanes> now{};
    now[simd::lanes - 1] = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()) - 1000;
    for (simd::LaneCounts& row : rows) {
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const double size = std::ldexp(1.0, 4 + 2 * static_cast<int>(lane));
            now[lane] += static_cast<std::uint64_t>(std::llround(size * steps[lane]()));
            row[lane] = static_cast<std::int64_t>(now[lane]);
        }
    }
    return rows;
}

TEST(FactorStream, IsTheOctaveStreamAtOctaves) {
    const auto rows = walks(1000);
    OctaveStream octaves;
    octaves.add(rows, simd::lanes);
    for (const std::int64_t m : {1, 2, 4, 8, 16, 64, 128, 256}) {
        FactorStream stream(m);
        // Pieces of all sizes.
        for (std::size_t from = 0, size = 1; from < rows.size(); from += size, size = size % 97 + 5) {
            size = std::min(size, rows.size() - from);
            stream.add(std::span(rows).subspan(from, size), simd::lanes);
        }
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            for (const Octave& octave : octaves.octaves(lane)) {
                if (octave.m != m) continue;
                EXPECT_EQ(stream.sum(lane).terms, octave.terms) << m;
                EXPECT_EQ(stream.sum(lane).sum, octave.sum) << m << ", lane " << lane;
            }
        }
    }
}

TEST(FactorStream, IsTheSumOverItsStarts) {
    const auto rows = walks(700);
    for (const std::int64_t m : {3, 5, 7, 9, 15, 17, 23, 100, 233, 349}) {
        FactorStream stream(m);
        stream.add(rows, simd::lanes);
        const std::int64_t stride = std::max<std::int64_t>(1, m / 8);
        for (const std::size_t lane : {std::size_t{0}, std::size_t{5}, simd::lanes - 1}) {
            double sum = 0.0;
            std::int64_t terms = 0;
            for (std::int64_t i = 0; i + 2 * m < static_cast<std::int64_t>(rows.size()); i += stride, ++terms) {
                const auto x = [&](std::int64_t k) {
                    return static_cast<std::uint64_t>(rows[static_cast<std::size_t>(k)][lane]);
                };
                const auto d = static_cast<std::int64_t>(x(i + 2 * m) - 2 * x(i + m) + x(i));
                sum += static_cast<double>(d) * static_cast<double>(d);
            }
            EXPECT_EQ(stream.sum(lane).terms, terms) << m;
            EXPECT_NEAR(stream.sum(lane).sum.rounded() / sum, 1.0, 1e-12) << m;
        }
    }
}

TEST(FactorStream, HasTheDeviationOfTheStoredRecord) {
    const auto rows = walks(4000);
    std::vector<double> phase;
    for (const simd::LaneCounts& row : rows) phase.push_back(0.5 * static_cast<double>(row[3]));
    OctaveStream octaves;
    octaves.add(rows, simd::lanes);
    const auto octave_points = deviation(octaves, 3, 0.5, 0.01);
    for (const std::int64_t m : {3, 11, 150, 1000}) {
        FactorStream stream(m);
        stream.add(rows, simd::lanes);
        const Point point = deviation(stream, 3, octave_points, 0.5, 0.01);
        const Point stored = deviation(Estimator::oadev, phase, 0.01, std::vector<std::int64_t>{m}).front();
        EXPECT_EQ(point.m, m);
        EXPECT_DOUBLE_EQ(point.tau_s, 0.01 * static_cast<double>(m));
        // A stride of tau/8 costs some 0.15 of the standard error; edf shows it (docs/dev/allan-streams.md).
        EXPECT_NEAR(point.dev / stored.dev, 1.0, 0.5 / std::sqrt(2.0 * stored.edf)) << m;
        EXPECT_NEAR(point.edf / stored.edf, 1.0, 0.1) << m;
        EXPECT_LT(point.lo, point.dev);
        EXPECT_GT(point.hi, point.dev);
    }
}

TEST(FactorStream, RefusesWhatHasNoDifference) {
    EXPECT_THROW(FactorStream(0), std::invalid_argument);
    FactorStream stream(10);
    const auto rows = walks(20);
    stream.add(rows, simd::lanes);
    EXPECT_EQ(stream.sum(0).terms, 0);
    EXPECT_THROW(deviation(stream, 0, {Point{}}, 1.0, 1.0), InputError);
    const auto more = walks(21);
    stream.add(std::span(more).last(1), simd::lanes);
    EXPECT_EQ(stream.sum(0).terms, 1);
}

}  // namespace
}  // namespace allan_factor_stream_test
}  // namespace ringlock::allan
