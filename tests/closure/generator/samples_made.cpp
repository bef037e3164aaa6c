// What each parameter of a truth does to a record of samples, against its formula.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "analysis/record/record.hpp"
#include "engine/core/error.hpp"
#include "tests/closure/generator/samples.hpp"

namespace generator_samples_made_test {
namespace {

using namespace ringlock;
using namespace ringlock::test::closure;

constexpr double pi = std::numbers::pi;

std::vector<double> values_of(const SampleTruth& truth) { return generate_samples(truth).samples->values; }
double mean_of(const std::vector<double>& x) {
    double sum = 0.0;
    for (const double v : x) sum += v;
    return sum / static_cast<double>(x.size());
}
double covariance(const std::vector<double>& x, const std::vector<double>& y, std::size_t lag = 0) {
    const double mx = mean_of(x);
    const double my = mean_of(y);
    double sum = 0.0;
    for (std::size_t i = lag; i < x.size(); ++i) sum += (x[i] - mx) * (y[i - lag] - my);
    return sum / static_cast<double>(x.size() - lag);
}

TEST(ClosureSamples, AMeanRateIsAsMuchInEverySample) {
    SampleTruth truth;
    truth.size = 1000;
    truth.mean_rate_deg_h = 36.0;
    for (const double v : values_of(truth)) EXPECT_NEAR(v, 0.36, 1e-12);
    truth.kind = record::SampleKind::angle_arcsec;
    const std::vector<double> angle = values_of(truth);
    for (std::size_t k = 0; k < angle.size(); ++k) EXPECT_NEAR(angle[k], 0.36 * static_cast<double>(k + 1), 1e-9);
    truth.kind = record::SampleKind::quarter_count;
    const record::Record counted = generate_samples(truth);
    ASSERT_TRUE(counted.samples->values.empty());
    EXPECT_EQ(counted.declared.scale_factor_arcsec, 0.5);
    for (std::size_t k = 0; k < truth.size; ++k) {
        EXPECT_NEAR(static_cast<double>(counted.samples->counts[k]) + 0.5, angle[k] / 0.125, 0.5 + 1e-6);
    }
}

TEST(ClosureSamples, PassTheChecksOfARecord) {
    SampleTruth truth;
    truth.size = 2000;
    truth.white_angle_arcsec = 0.1;
    truth.rates.quantum_noise_deg_rt_h = 1e-3;
    truth.case_motion.rms_arcsec = 1.0;
    truth.temperature.ramp_k_per_h = 5.0;
    for (const auto kind : {record::SampleKind::angle_increment_arcsec, record::SampleKind::angle_arcsec,
                            record::SampleKind::quarter_count}) {
        truth.kind = kind;
        for (const record::Finding& finding : record::check(generate_samples(truth))) {
            ADD_FAILURE() << finding.where << ": " << finding.what;
        }
    }
}

TEST(ClosureSamples, WhiteNoisesHaveTheirVariancesAndCorrelation) {
    // Increments of the angle's white noise a: variance 2 a^2, covariance of neighbours -a^2; of the rate's N^2 dt.
    SampleTruth truth;
    truth.size = 40000;
    truth.white_angle_arcsec = 0.2;
    truth.rates.quantum_noise_deg_rt_h = 0.03;
    const std::vector<double> x = values_of(truth);
    const double rate = std::pow(60.0 * 0.03, 2) / 100.0;
    const double variance = 2.0 * 0.04 + rate;
    // Four standard errors of 40000 increments whose neighbours are correlated
    const double error = 4.0 * std::sqrt(3.0 / 40000.0) * variance;
    EXPECT_NEAR(covariance(x, x), variance, error);
    EXPECT_NEAR(covariance(x, x, 1), -0.04, error);
    EXPECT_NEAR(covariance(x, x, 2), 0.0, error);
}

TEST(ClosureSamples, CountsHaveQuantizationNoise) {
    // (K/4)^2/12 on each reading, uncorrelated where many steps go by between readings.
    SampleTruth truth;
    truth.size = 20000;
    truth.mean_rate_deg_h = 5000.0 * std::numbers::sqrt2;
    truth.rates.quantum_noise_deg_rt_h = 0.1;
    const std::vector<double> smooth = values_of(truth);
    truth.count_quantization_arcsec = 0.125;
    const std::vector<double> stepped = values_of(truth);
    std::vector<double> error(truth.size);
    for (std::size_t k = 0; k < truth.size; ++k) {
        error[k] = stepped[k] - smooth[k];
        EXPECT_NEAR(stepped[k] / 0.125, std::round(stepped[k] / 0.125), 1e-5);
    }
    EXPECT_NEAR(covariance(error, error) / (2.0 * 0.125 * 0.125 / 12.0), 1.0, 4.0 * std::sqrt(3.0 / 20000.0));
}

/// Complex amplitude of x at f [1/samples].
std::complex<double> amplitude(const std::vector<double>& x, double f, std::size_t first = 0, std::size_t last = 0) {
    if (last == 0) last = x.size();
    std::complex<double> sum = 0.0;
    for (std::size_t k = first; k < last; ++k) {
        sum += x[k] * std::polar(1.0, -2.0 * pi * f * static_cast<double>(k));
    }
    return 2.0 * sum / static_cast<double>(last - first);
}

TEST(ClosureSamples, ResidueOfTheDitherAppearsAtItsAlias) {
    // 391 Hz sampled at 100 Hz: an alias at 9 Hz; increments have 2 sin(pi f/rate) of the angle's amplitude.
    SampleTruth truth;
    truth.size = 10000;
    truth.dither_residue = {391.0, 0.0, 0.7, 0.2};
    const std::vector<double> x = values_of(truth);
    EXPECT_NEAR(std::abs(amplitude(x, 0.09)), 0.7 * 2.0 * std::sin(pi * 0.09), 1e-9);
    // With a drift: the frequency named is that of mid-record, the first tenth is 45 s before it
    truth.dither_residue = {391.0, 0.01, 0.7, 0.2};
    const std::vector<double> drifting = values_of(truth);
    const auto peak = [&](std::size_t first, std::size_t last) {
        double best = 0.0, where = 0.0;
        for (double f = 0.07; f < 0.11; f += 2e-4) {
            const double a = std::abs(amplitude(drifting, f, first, last));
            if (a > best) {
                best = a;
                where = f;
            }
        }
        return where;
    };
    // The alias of a falling distance to 400 Hz: 9.45 Hz at 5 s, 8.55 Hz at 95 s; a tenth of the record tells 0.1 Hz
    EXPECT_NEAR(peak(0, 1000), 0.0945, 1e-3);
    EXPECT_NEAR(peak(9000, 10000), 0.0855, 1e-3);
}

TEST(ClosureSamples, LinesHaveTheirAmplitudesAndJump) {
    SampleTruth truth;
    truth.size = 10000;
    truth.lines = {{7.0, 40.0, 0.0}};
    truth.rates.base_vibration = {13.0, 20.0, 0.0};
    truth.jumping_line = {21.0, 10.0, 30.0, 50.0};
    const std::vector<double> x = values_of(truth);
    // The mean over an interval of a line is sin(pi f/rate)/(pi f/rate) of it; increments are that over the rate
    const auto expected = [](double rate, double f) { return rate * std::sin(pi * f / 100.0) / (pi * f); };
    EXPECT_NEAR(std::abs(amplitude(x, 0.07)), expected(40.0, 7.0), 1e-9);
    EXPECT_NEAR(std::abs(amplitude(x, 0.13)), expected(20.0, 13.0), 1e-9);
    EXPECT_NEAR(std::abs(amplitude(x, 0.21, 0, 5000)), expected(10.0, 21.0), 1e-9);
    EXPECT_NEAR(std::abs(amplitude(x, 0.21, 5000, 10000)), expected(30.0, 21.0), 1e-9);
}

TEST(ClosureSamples, ResamplingTakesAwayAndCorrelates) {
    for (const double from_hz : {61.8, 100.0 * std::numbers::sqrt2, 331.7}) {
        SampleTruth truth;
        truth.size = 60000;
        truth.rates.quantum_noise_deg_rt_h = 0.1;
        truth.resampling.from_hz = from_hz;
        const std::vector<double> x = values_of(truth);
        const double p = from_hz / 100.0;
        const double fresh = 36.0 / 100.0;  // N^2 dt, N = 6 arcsec/sqrt(s)
        const double ratio = p >= 1.0 ? 1.0 - 1.0 / (3.0 * p) : p - p * p / 3.0;
        const double error = 4.0 * std::sqrt(2.0 * (1.0 + 2.0 / std::min(p, 1.0)) / 60000.0);
        EXPECT_NEAR(covariance(x, x) / fresh, ratio, error) << from_hz;
        // No angle is lost: what increments lack in variance neighbours have in covariance, all lags together
        double all = covariance(x, x);
        for (std::size_t lag = 1; lag <= 4; ++lag) all += 2.0 * covariance(x, x, lag);
        EXPECT_NEAR(all / fresh, 1.0, 3.0 * error) << from_hz;
    }
    // A steady rate stays what it is, of the angle and of the rate
    SampleTruth steady;
    steady.size = 1000;
    steady.mean_rate_deg_h = 36.0;
    steady.resampling = {61.8, false};
    for (const double v : values_of(steady)) EXPECT_NEAR(v, 0.36, 1e-10);
    steady.resampling.of_rate = true;
    for (const double v : values_of(steady)) EXPECT_NEAR(v, 0.36, 1e-10);
}

TEST(ClosureSamples, CaseMotionIsSeenByItsWitness) {
    SampleTruth truth;
    truth.size = 200000;
    truth.case_motion = {"accel_y", 0.6, 2.0, 5.0, 4.0};
    truth.accelerometer_noise = 0.0;
    truth.kind = record::SampleKind::angle_arcsec;
    const record::Record made = generate_samples(truth);
    const std::vector<double>& angle = made.samples->values;
    // Correlation time of the motion some 1/(pi width) = 0.08 s: 25 000 independent values or so in 2000 s; four errors
    const double error = 4.0 * std::sqrt(2.0 / 12000.0);
    EXPECT_NEAR(std::sqrt(covariance(angle, angle)) / 2.0, 1.0, error);
    // Averages over blocks of 500 samples of cross- and auto-spectra at the centre and beside it
    const std::vector<double>& witness = made.samples->witnesses.at("accel_y");
    for (const double f : {0.03, 0.05, 0.07}) {
        double xx = 0.0, yy = 0.0;
        std::complex<double> xy = 0.0;
        for (std::size_t first = 0; first < truth.size; first += 500) {
            const auto x = amplitude(angle, f, first, first + 500);
            const auto y = amplitude(witness, f, first, first + 500);
            xx += std::norm(x);
            yy += std::norm(y);
            xy += x * std::conj(y);
        }
        // Standard error of a coherence from 400 blocks: sqrt(2 c) (1 - c)/20 = 0.022; four, and the window's leakage
        EXPECT_NEAR(std::norm(xy) / (xx * yy), 0.6, 0.1) << f;
        // Gravity's scale: g times the angle in rad, sqrt(coherence) of it
        EXPECT_NEAR(std::abs(xy) / xx / (9.80665 * pi / 648000.0), std::sqrt(0.6), 0.06) << f;
    }
    // The others see nothing but gravity
    for (const double v : made.samples->witnesses.at("accel_x")) ASSERT_EQ(v, 0.0);
    for (const double v : made.samples->witnesses.at("accel_z")) ASSERT_EQ(v, 9.80665);
}

TEST(ClosureSamples, AWitnessSeesLessOfAMotionThroughItsNoise) {
    SampleTruth truth;
    truth.size = 200000;
    truth.case_motion = {"accel_y", 0.6, 2.0, 5.0, 4.0};
    truth.accelerometer_noise = 4e-4;
    truth.kind = record::SampleKind::angle_arcsec;
    const record::Record made = generate_samples(truth);
    const std::vector<double>& witness = made.samples->witnesses.at("accel_y");
    constexpr std::size_t block = 500;
    double coherent = 0.0;
    double all = 0.0;
    for (std::size_t k = 5; k <= 45; k += 4) {  // fifths of a hertz, within a width of the centre
        const double f = static_cast<double>(k) / block;
        double xx = 0.0, yy = 0.0;
        std::complex<double> xy = 0.0;
        for (std::size_t first = 0; first < truth.size; first += block) {
            const auto x = amplitude(made.samples->values, f, first, first + block);
            const auto y = amplitude(witness, f, first, first + block);
            xx += std::norm(x);
            yy += std::norm(y);
            xy += x * std::conj(y);
        }
        coherent += std::norm(xy) / yy;
        all += xx;
    }
    const double expected = coherence_with_noise(truth);
    EXPECT_LT(expected, 0.45);
    // As above, of eleven frequencies; and the window's leakage
    EXPECT_NEAR(coherent / all, expected, 0.04);
}

TEST(ClosureSamples, TemperatureIsAWitness) {
    SampleTruth truth;
    truth.size = 1000;
    truth.temperature.ramp_k_per_h = 3600.0;
    truth.bias_temperature_deg_h_per_k = 5.0;
    const record::Record made = generate_samples(truth);
    for (std::size_t k = 0; k < truth.size; ++k) {
        const double warmer = (static_cast<double>(k) + 0.5) / 100.0;
        EXPECT_NEAR(made.samples->witnesses.at("temperature_c")[k], 20.0 + warmer, 1e-12);
        EXPECT_NEAR(made.samples->values[k], 5.0 * warmer / 100.0, 1e-12);
    }
}

// A first-order lag of a ramp is late by the lag, but for how it begins.
TEST(ClosureSamples, ABiasMayFollowTheTemperatureLate) {
    SampleTruth truth;
    truth.size = 6000;
    truth.temperature.ramp_k_per_h = 3600.0;
    truth.late_temperature = {2.0, 10.0};
    const record::Record made = generate_samples(truth);
    for (std::size_t k = 0; k < truth.size; k += 100) {
        const double t = (static_cast<double>(k) + 0.5) / 100.0;
        // Steps of a thousandth of the lag
        EXPECT_NEAR(made.samples->values[k], 2.0 * (t - 10.0 + 10.0 * std::exp(-t / 10.0)) / 100.0, 1e-3 / 100.0) << k;
    }
}

TEST(ClosureSamples, ABiasMayFollowAnAcceleration) {
    SampleTruth truth;
    truth.size = 100000;
    truth.accelerometer_noise = 0.0;
    truth.slow_acceleration = {0.01, 2.0, 500.0};
    const record::Record made = generate_samples(truth);
    const std::vector<double>& seen = made.samples->witnesses.at("accel_x");
    double squares = 0.0;
    double neighbours = 0.0;
    for (std::size_t k = 0; k < truth.size; ++k) {
        EXPECT_NEAR(made.samples->values[k], 500.0 * seen[k] / 100.0, 1e-9);
        squares += seen[k] * seen[k] / static_cast<double>(truth.size);
        if (k >= 200) neighbours += seen[k] * seen[k - 200] / static_cast<double>(truth.size);
    }
    // 1000 s at a correlation time of 2 s: 500 independent values
    EXPECT_NEAR(squares / 1e-4, 1.0, 4.0 * std::sqrt(2.0 / 500.0));
    EXPECT_NEAR(neighbours / squares, std::exp(-1.0), 4.0 / std::sqrt(500.0));
}

TEST(ClosureSamples, SaturationClipsIncrements) {
    SampleTruth truth;
    truth.size = 20000;
    truth.rates.quantum_noise_deg_rt_h = 0.1;
    const std::vector<double> free = values_of(truth);
    truth.saturation_arcsec = 1.0;
    const std::vector<double> clipped = values_of(truth);
    std::size_t hit = 0;
    for (std::size_t k = 0; k < truth.size; ++k) {
        EXPECT_NEAR(clipped[k], std::clamp(free[k], -1.0, 1.0), 1e-9);
        if (std::abs(free[k]) > 1.0) ++hit;
    }
    EXPECT_GT(hit, 500U) << "0.6 arcsec rms: one in ten";
}

TEST(ClosureSamples, RefuseWhatMakesNoSense) {
    SampleTruth truth;
    truth.case_motion.witness = "temperature_c";
    EXPECT_THROW(generate_samples(truth), InputError);
    truth = {};
    truth.rate_hz = 0.0;
    EXPECT_THROW(generate_samples(truth), InputError);
}

}  // namespace
}  // namespace generator_samples_made_test
