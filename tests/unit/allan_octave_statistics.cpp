#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "analysis/allan/octave_deviation.hpp"
#include "analysis/allan/octave_stream.hpp"
#include "analysis/allan/statistics/degrees_of_freedom.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_octave_statistics_test {
namespace {

using namespace ringlock;
using allan::OctaveStream;

constexpr std::size_t records = 2048;
constexpr std::size_t samples = 513;
constexpr double unit = 0x1p-30;

struct Noise {
    std::string name;
    int alpha;
    test::Truth truth;
    /// Allan variance at tau0 = 1 s and m samples (IEEE Std 952).
    double variance(double m) const {
        return 3.0 * truth.q * truth.q / (m * m) + truth.n * truth.n / m + 0.441271 * truth.b * truth.b +
               truth.k * truth.k * m / 3.0;
    }
};

const std::vector<Noise>& noises() {
    static const std::vector<Noise> all = {{"white phase", 2, {.q = 1.0}},
                                           {"white rate", 0, {.n = 1.0}},
                                           {"flicker rate", -1, {.b = 1.0}},
                                           {"random walk", -2, {.k = 1.0}}};
    return all;
}

/// Many records of a noise, as counts; made once.
const std::vector<std::vector<std::int64_t>>& simulated(const Noise& noise) {
    static std::map<std::string, std::vector<std::vector<std::int64_t>>> cache;
    auto& all = cache[noise.name];
    for (std::size_t r = all.size(); r < records; ++r) {
        const auto angle = test::simulate_angle(noise.truth, samples - 1, 1.0, 1000 + r);
        all.emplace_back(samples);
        for (std::size_t i = 0; i < samples; ++i) all.back()[i] = std::llround(angle[i] / unit);
    }
    return all;
}

/// Points of all records, [record][octave].
std::vector<std::vector<allan::Point>> deviations(const Noise& noise) {
    const auto& all = simulated(noise);
    std::vector<std::vector<allan::Point>> out;
    for (std::size_t first = 0; first < records; first += simd::lanes) {
        std::vector<simd::LaneCounts> rows(samples);
        for (std::size_t i = 0; i < samples; ++i) {
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) rows[i][lane] = all[first + lane][i];
        }
        OctaveStream stream;
        stream.add(rows, simd::lanes);
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) out.push_back(allan::deviation(stream, lane, unit, 1.0));
    }
    return out;
}

struct Moments {
    double mean = 0.0;
    double variance = 0.0;
};

Moments moments(const std::vector<double>& v) {
    Moments m;
    for (const double x : v) m.mean += x / static_cast<double>(v.size());
    for (const double x : v) m.variance += (x - m.mean) * (x - m.mean) / static_cast<double>(v.size() - 1);
    return m;
}

/// Mean square of second differences at a stride.
double strided(const std::vector<std::int64_t>& x, std::size_t m, std::size_t stride) {
    double sum = 0.0;
    std::size_t terms = 0;
    for (std::size_t i = 0; i + 2 * m < x.size(); i += stride, ++terms) {
        const auto d = static_cast<double>(x[i + 2 * m] - 2 * x[i + m] + x[i]);
        sum += d * d;
    }
    return sum / static_cast<double>(terms);
}

// 2 mean^2/variance of the estimate over many records is its number of degrees of freedom. A sample variance of R
// chi-squared values has the relative variance (2 + 12/edf)/R; four standard errors are allowed, and 3 % for what the
// generalised covariances leave out beyond three averaging times. The mean is that of theory within four standard
// errors and the 1 % that the simulated flicker noise, a sum of relaxations an octave apart, is off at the shortest
// times.
TEST(AllanOctaveStatistics, DegreesOfFreedomAreThoseOfSimulatedRecords) {
    constexpr allan::EstimatorShape shape{.starts_per_tau = OctaveStream::starts_per_tau};
    for (const Noise& noise : noises()) {
        const auto points = deviations(noise);
        for (std::size_t octave = 0; octave < points[0].size(); ++octave) {
            const std::int64_t m = points[0][octave].m;
            std::vector<double> variances;
            for (const auto& record : points) variances.push_back(record[octave].dev * record[octave].dev);
            const Moments found = moments(variances);
            const double edf = allan::degrees_of_freedom(shape, noise.alpha, m, samples);
            const double measured = 2.0 * found.mean * found.mean / found.variance;
            const double error = std::sqrt((2.0 + 12.0 / edf) / records);
            fmt::print("{:12} m {:3}: edf {:8.2f}, simulated {:8.2f} ({:+.1f} standard errors)\n", noise.name, m, edf,
                       measured, (measured / edf - 1.0) / error);
            EXPECT_NEAR(measured, edf, (4.0 * error + 0.03) * edf) << noise.name << ' ' << m;
            const double theory = noise.variance(static_cast<double>(m));
            const double model = noise.alpha == -1 ? 0.01 : 0.0;
            EXPECT_NEAR(found.mean, theory, theory * (4.0 * std::sqrt(2.0 / edf / records) + model))
                << noise.name << ' ' << m;
        }
    }
}

// What the stride costs against full overlap, in standard errors of the latter: eight starts in a tau do, four do not.
// The bound is for records of eight averaging times and more; at four, where the estimate has four degrees of freedom,
// it is 0.17. The rms itself is known to 1/sqrt(2 * 2048) = 1.6 %.
TEST(AllanOctaveStatistics, StrideStaysNearFullOverlap) {
    EXPECT_EQ(OctaveStream::starts_per_tau, 8);
    for (const Noise& noise : noises()) {
        for (const std::size_t m : {16, 32, 64, 128}) {
            std::vector<double> full;
            for (const auto& x : simulated(noise)) full.push_back(strided(x, m, 1));
            const double error = std::sqrt(moments(full).variance);
            const auto away = [&](std::size_t starts) {
                double sum = 0.0;
                for (std::size_t r = 0; r < records; ++r) {
                    const double d = (strided(simulated(noise)[r], m, m / starts) - full[r]) / error;
                    sum += d * d / static_cast<double>(records);
                }
                return std::sqrt(sum);
            };
            const double of_four = away(4);
            const double of_eight = away(8);
            fmt::print(
                "{:12} n/m {:2}, m {:3}: {:.3f} standard errors from full overlap with 8 starts, {:.3f} with 4\n",
                noise.name, samples / m, m, of_eight, of_four);
            if (noise.alpha > 0) continue;  // every term of white phase noise tells something new
            EXPECT_LT(of_eight, samples / m >= 8 ? 0.15 : 0.17) << noise.name << ' ' << m;
            if (noise.alpha == 0) {
                EXPECT_GT(of_four, 0.15) << m;
            }
        }
    }
}

// The same at long averaging times, by the degrees of freedom: the full mean has the least variance of all whose terms
// are its own, so that the excess of a strided one is the variance of the difference. 0.001: full overlap is summed in
// blocks of lags.
TEST(AllanOctaveStatistics, StrideStaysNearFullOverlapAtLongTimes) {
    constexpr allan::EstimatorShape eight{.starts_per_tau = 8};
    constexpr allan::EstimatorShape four{.starts_per_tau = 4};
    for (const int alpha : {0, -1, -2}) {
        for (const std::int64_t m : {1 << 10, 1 << 14, 1 << 20}) {
            for (const std::int64_t taus : {8, 100, 10000}) {
                const std::int64_t points = taus * m + 1;
                const double full = allan::degrees_of_freedom({}, alpha, m, points);
                const double excess = full / allan::degrees_of_freedom(eight, alpha, m, points) - 1.0;
                EXPECT_LT(excess, 0.15 * 0.15 + 0.001) << alpha << ' ' << m << ' ' << taus;
                if (alpha == 0) {
                    EXPECT_GT(full / allan::degrees_of_freedom(four, alpha, m, points) - 1.0, 0.15 * 0.15);
                }
            }
        }
    }
}

// The slope tells the four noises apart; and the intervals, whose degrees of freedom rest on what it tells,
// cover. 68.27 % of 2048 has a standard error of 1.03 %, four are allowed; six below five degrees of freedom, where the
// distribution is not quite chi-squared.
TEST(AllanOctaveStatistics, NoiseIsToldAndIntervalsCover) {
    for (const Noise& noise : noises()) {
        const auto points = deviations(noise);
        for (std::size_t octave = 0; octave < points[0].size(); ++octave) {
            const std::int64_t m = points[0][octave].m;
            const auto taus = static_cast<std::int64_t>(samples) / m;
            const double truth = std::sqrt(noise.variance(static_cast<double>(m)));
            double told = 0.0;
            double near = 0.0;
            double covered = 0.0;
            for (const auto& record : points) {
                const allan::Point& p = record[octave];
                told += p.alpha == noise.alpha ? 1.0 / records : 0.0;
                near += std::abs(p.alpha - noise.alpha) <= 1 ? 1.0 / records : 0.0;
                covered += p.lo <= truth && truth <= p.hi ? 1.0 / records : 0.0;
            }
            fmt::print("{:12} m {:3}: told {:5.1f} %, within one {:5.1f} %, covered {:.1f} %\n", noise.name, m,
                       100.0 * told, 100.0 * near, 100.0 * covered);
            EXPECT_GT(told, taus >= 100 ? 0.995 : 0.98) << noise.name << ' ' << m;
            EXPECT_GT(near, 0.995) << noise.name << ' ' << m;
            EXPECT_NEAR(covered, 0.6827, (taus >= 8 ? 4.0 : 6.0) * 0.0103) << noise.name << ' ' << m;
        }
    }
}

}  // namespace
}  // namespace allan_octave_statistics_test
