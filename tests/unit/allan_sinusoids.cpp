#include <gtest/gtest.h>

#include <algorithm>
#include <boost/random/uniform_real_distribution.hpp>
#include <cmath>
#include <numbers>

#include "analysis/noise/fit.hpp"
#include "analysis/noise/model/line.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_sinusoids_test {
namespace {

using namespace ringlock;
using noise::NoiseFit;
using std::numbers::pi;
using test::Truth;

/// Distance from the truth in standard errors.
double errors_off(const noise::Estimate& e, double truth) { return std::abs(e.value - truth) / (0.5 * (e.hi - e.lo)); }

const Truth five{.q = 0.3, .n = 0.3, .b = 0.1, .k = 0.01, .r = 1e-4};

// Columns in closed form against the transform of the sinusoid itself; at whole indices they are limits.
TEST(AllanSinusoids, ColumnsAreTheTransformOfASinusoid) {
    for (const std::size_t n : {60, 91}) {
        const noise::LineFinder finder(n);
        for (const double index : {9.0, 9.0000001, 10.0, 17.37, 31.5, 50.0 - 1e-5}) {
            const noise::Line line{.index = index, .cosine = 0.7, .sine = -1.3};
            std::vector<double> rate(n);
            for (std::size_t k = 0; k < n; ++k) {
                const double t = static_cast<double>(k) - 0.5 * static_cast<double>(n - 1);
                const double turn = pi * index / static_cast<double>(n) * t;
                rate[k] = line.cosine * std::cos(turn) + line.sine * std::sin(turn);
            }
            const noise::Spectrum s = noise::cosine_spectrum(rate);
            std::vector<double> z(n - 1);
            finder.add(line, 1.0, z);
            // 1e-7 of a coefficient is how far whole indices are kept off
            for (std::size_t j = 1; j < n; ++j)
                EXPECT_NEAR(z[j - 1], s.z[j - 1], 3e-6) << n << ' ' << index << ' ' << j;
        }
    }
}

// Amplitudes and frequency against the bound for white noise: variance of a 2 sigma^2/n, of the angular frequency
// 24 sigma^2/(A^2 n^3) (D. Rife, R. Boorstyn, IEEE Trans. IT 20 (1974) 591).
TEST(AllanSinusoids, ErrorsAreTheBoundForWhiteNoise) {
    constexpr std::size_t n = 400;
    const noise::LineFinder finder(n);
    const std::vector<double> variance(n - 1, 0.25);
    std::vector<double> z(n - 1);
    finder.add({.index = 123.4, .cosine = 2.0, .sine = 1.0}, 1.0, z);
    noise::Line line{.index = 123.2};
    finder.refine(line, z, variance);
    EXPECT_NEAR(line.index, 123.4, 1e-6);
    EXPECT_NEAR(line.cosine, 2.0, 1e-6);
    EXPECT_NEAR(line.sine, 1.0, 1e-6);
    const double of_amplitude = 2.0 * 0.25 / n;
    const double of_index = 24.0 * 0.25 / (5.0 * std::pow(n, 3)) * std::pow(n / pi, 2);
    EXPECT_NEAR(line.amplitude_variance(), of_amplitude, 0.02 * of_amplitude);
    EXPECT_NEAR(line.covariance[2][2], of_index, 0.02 * of_index);
}

TEST(AllanSinusoids, TwoLinesAreNamedBesideFiveTerms) {
    constexpr int records = 40;
    Truth truth = five;
    truth.lines = {{.amplitude = 0.2, .frequency_hz = 0.4 / 2.0, .phase_rad = 1.0},
                   {.amplitude = 0.08, .frequency_hz = 0.02371 / 2.0, .phase_rad = 4.0}};
    int within = 0;
    int described = 0;
    int arw_held = 0;
    for (int k = 0; k < records; ++k) {
        SCOPED_TRACE(k);
        const NoiseFit f = noise::fit_noise(test::simulate_angle(truth, 4096, 2.0, 400 + k), 2.0);
        described += f.described ? 1 : 0;
        ASSERT_EQ(f.sinusoids.size(), 2u) << f.reason;
        for (std::size_t i = 0; i < 2; ++i) {
            const test::TrueLine& line = truth.lines[1 - i];
            for (const double off : {errors_off(f.sinusoids[i].frequency_hz, line.frequency_hz),
                                     errors_off(f.sinusoids[i].rate_amplitude_deg_h, line.amplitude)}) {
                EXPECT_LT(off, 4.5);
                within += off < 1.0 ? 1 : 0;
            }
        }
        ASSERT_TRUE(f.arw_deg_rt_h.resolved);
        arw_held += *f.arw_deg_rt_h.lo <= truth.n / 60.0 && truth.n / 60.0 <= *f.arw_deg_rt_h.hi ? 1 : 0;
    }
    EXPECT_GE(described, records - 2);
    // 160 figures within one standard error: 109 expected, standard deviation 5.9; of 40: 27 and 2.9; four of each
    EXPECT_NEAR(within, 109, 24);
    EXPECT_NEAR(arw_held, 27, 12);
}

TEST(AllanSinusoids, AStrongLineHidesNothing) {
    Truth truth = five;
    const NoiseFit without = noise::fit_noise(test::simulate_angle(truth, 8192, 1.0, 3), 1.0);
    truth.lines = {{.amplitude = 3000.0, .frequency_hz = 0.123456789, .phase_rad = 0.4}};
    const NoiseFit f = noise::fit_noise(test::simulate_angle(truth, 8192, 1.0, 3), 1.0);
    ASSERT_EQ(f.sinusoids.size(), 1u);
    EXPECT_TRUE(f.described) << f.reason;
    EXPECT_LT(errors_off(f.sinusoids[0].frequency_hz, 0.123456789), 4.0);
    EXPECT_LT(errors_off(f.sinusoids[0].rate_amplitude_deg_h, 3000.0), 4.0);
    ASSERT_TRUE(f.arw_deg_rt_h.resolved && without.arw_deg_rt_h.resolved);
    // The line takes three of 8191 coefficients with it.
    EXPECT_NEAR(*f.arw_deg_rt_h.value / *without.arw_deg_rt_h.value, 1.0, 0.01);
    EXPECT_EQ(f.bias_instability_deg_h.resolved, without.bias_instability_deg_h.resolved);
}

TEST(AllanSinusoids, FourLinesAreWithheld) {
    Truth truth{.n = 0.3};
    for (const double frequency_hz : {0.05, 0.13, 0.27, 0.41}) {
        truth.lines.push_back({.amplitude = 0.3, .frequency_hz = frequency_hz});
    }
    const NoiseFit f = noise::fit_noise(test::simulate_angle(truth, 4096, 1.0, 8), 1.0);
    EXPECT_FALSE(f.described);
    EXPECT_NE(f.reason.find("line"), std::string::npos) << f.reason;
}

// A resonance a few coefficients wide: a line whose phase wanders, coherent over a tenth of the record.
TEST(AllanSinusoids, AWanderingLineIsWithheld) {
    for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
        std::vector<double> angle = test::simulate_angle({.n = 0.3}, 4096, 1.0, seed);
        random::NormalStream normal({seed, 9}, random::Purpose::bootstrap);
        double phase = 0.0;
        for (double& a : angle) {
            phase += 0.8 + 0.07 * normal();
            a += 0.6 * std::sin(phase);
        }
        EXPECT_FALSE(noise::fit_noise(angle, 1.0).described) << seed;
    }
}

// One in a thousand records of five terms may have a line by chance: 2 of 150 come once in 80 trials.
TEST(AllanSinusoids, FiveTermsHaveNone) {
    int lines = 0;
    for (std::uint64_t seed = 0; seed < 150; ++seed) {
        lines += noise::fit_noise(test::simulate_angle(five, 2048, 1.0, seed), 1.0).sinusoids.empty() ? 0 : 1;
    }
    EXPECT_LE(lines, 1);
}

// Whatever the record: its unit, the length of a sample, its direction in time, an offset and a slope change the line
// as they should.
TEST(AllanSinusoids, SymmetriesOfARecord) {
    random::Engine engine = random::make_engine({11, 0}, random::Purpose::bootstrap);
    boost::random::uniform_real_distribution<double> uniform(0.0, 1.0);
    for (int k = 0; k < 12; ++k) {
        SCOPED_TRACE(k);
        Truth truth = five;
        truth.lines = {{.amplitude = std::pow(10.0, 2.0 * uniform(engine)),
                        .frequency_hz = 0.01 + 0.48 * uniform(engine),
                        .phase_rad = 6.28 * uniform(engine)}};
        const std::vector<double> angle = test::simulate_angle(truth, 2048, 1.0, 600 + k);
        const NoiseFit a = noise::fit_noise(angle, 1.0);
        ASSERT_GE(a.sinusoids.size(), 1u);
        const auto strongest = [](const NoiseFit& f) {
            return *std::max_element(f.sinusoids.begin(), f.sinusoids.end(), [](const auto& one, const auto& other) {
                return one.rate_amplitude_deg_h.value < other.rate_amplitude_deg_h.value;
            });
        };
        const noise::Sinusoid line = strongest(a);
        const double error = line.frequency_hz.hi - line.frequency_hz.value;
        std::vector<double> changed(angle.rbegin(), angle.rend());
        for (std::size_t i = 0; i < changed.size(); ++i) changed[i] = 7.0 * (changed[i] + 0.3 * static_cast<double>(i));
        const noise::Sinusoid other = strongest(noise::fit_noise(changed, 0.1));
        // The fit stops when the deviance moves by less than a hundredth.
        EXPECT_NEAR(other.frequency_hz.value, 10.0 * line.frequency_hz.value, 10.0 * 0.05 * error);
        EXPECT_NEAR(other.rate_amplitude_deg_h.value / (70.0 * line.rate_amplitude_deg_h.value), 1.0,
                    0.05 * (line.rate_amplitude_deg_h.hi / line.rate_amplitude_deg_h.value - 1.0));
    }
}

}  // namespace
}  // namespace allan_sinusoids_test
