#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "analysis/noise/model/likelihood.hpp"
#include "analysis/noise/model/spectrum.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_spectrum_test {
namespace {

using namespace ringlock;
using namespace ringlock::noise;
using std::numbers::pi;

/// Variance of sum_i v_i r_i, where r_i are rates with covariance c(|i - k|).
template <class Covariance>
double variance_of(const std::vector<double>& v, const Covariance& c) {
    double sum = 0.0;
    for (std::size_t i = 0; i < v.size(); ++i) {
        for (std::size_t k = 0; k < v.size(); ++k) sum += v[i] * v[k] * c(i > k ? i - k : k - i);
    }
    return sum;
}

std::vector<double> cosine(std::size_t n, std::size_t j) {
    std::vector<double> v(n);
    for (std::size_t i = 0; i < n; ++i) {
        v[i] = std::sqrt(2.0 / static_cast<double>(n)) *
               std::cos(pi * static_cast<double>(j) * (static_cast<double>(i) + 0.5) / static_cast<double>(n));
    }
    return v;
}

// Generalised covariances of rates averaged over unit intervals: a multiple of the fourth-order second difference.
double averaged(double (*integrated_twice)(double), std::size_t lag) {
    const auto t = static_cast<double>(lag);
    return integrated_twice(t + 1) - 2.0 * integrated_twice(t) + integrated_twice(std::abs(t - 1));
}

// Random walk of intensity 1: generalised covariance -|t|/2, integrated twice -|t|^3/12.
TEST(AllanSpectrum, RandomWalkIsExactlyDiagonal) {
    constexpr std::size_t n = 48;
    const auto c = [](std::size_t lag) { return averaged([](double t) { return -t * t * t / 12.0; }, lag); };
    for (const std::size_t j : {1, 2, 3, 20, 47}) {
        const double x = 0.5 * static_cast<double>(j) / n;
        const double expected = shapes(x, static_cast<double>(j))[rate_random_walk];
        EXPECT_NEAR(variance_of(cosine(n, j), c), expected, 1e-9 * expected) << j;
    }
}

// Flicker with S = 1/(2 pi f): generalised covariance -ln|t|/pi, integrated twice -(t^2/2)(ln|t| - 3/2)/pi. The model's
// variance is the aliased spectrum times the correction for the ends, good to a part in a hundred or so.
TEST(AllanSpectrum, FlickerIsNearlyDiagonal) {
    const auto c = [](std::size_t lag) {
        return averaged([](double t) { return t > 0 ? -0.5 * t * t * (std::log(t) - 1.5) / pi : 0.0; }, lag);
    };
    for (const std::size_t n : {40, 200}) {
        for (const std::size_t j : {1, 2, 3, 4, 5, 9, 20, 39}) {
            const double x = 0.5 * static_cast<double>(j) / static_cast<double>(n);
            const double expected = shapes(x, static_cast<double>(j))[flicker];
            EXPECT_NEAR(variance_of(cosine(n, j), c), expected, 0.02 * expected) << n << ' ' << j;
        }
    }
}

// Covariance exp(-|t|/T), integrated twice T^2 exp(-|t|/T) + T |t|. The model leaves out exp(-n/T), which is 5e-5 at
// the longest time.
TEST(AllanSpectrum, CorrelatedNoiseHasTheDiagonalOfItsCovariance) {
    for (const std::size_t n : {40, 200}) {
        const LogTimes range = log_times(n);
        for (const double log_time : {range.lo, 0.3, range.hi}) {
            const double time = std::exp(log_time);
            const auto f = [&](double t) { return time * time * std::exp(-std::abs(t) / time) + time * std::abs(t); };
            const auto c = [&](std::size_t lag) {
                const auto t = static_cast<double>(lag);
                return f(t + 1) - 2.0 * f(t) + f(t - 1);
            };
            const CorrelatedShape shape(log_time, n);
            for (const std::size_t j : {1, 2, 3, 9, 20, 39}) {
                const double s = std::sin(0.5 * pi * static_cast<double>(j) / static_cast<double>(n));
                const double expected = shape(s * s).shape;
                EXPECT_NEAR(variance_of(cosine(n, j), c), expected, 6e-5 * expected) << n << ' ' << time << ' ' << j;
            }
        }
    }
}

// Of long times it is a random walk, of short ones white.
TEST(AllanSpectrum, CorrelatedNoiseBetweenItsLimits) {
    constexpr std::size_t n = 1000000;
    const double time = 1e5;
    const double x = 0.2;
    const double s2 = std::pow(std::sin(pi * x), 2);
    EXPECT_NEAR(CorrelatedShape(std::log(time), n)(s2).shape * time / 2.0 / shapes(x)[rate_random_walk], 1.0, 1e-4);
    // q_c T_c = 1 is a variance of 1/(2 T). Of first order in T what neighbours share is missing: 2 T s^2.
    const double brief = 0.02;
    EXPECT_NEAR(CorrelatedShape(std::log(brief), n)(s2).shape / (2.0 * brief), 1.0 - 2.0 * brief * s2, 1e-3);
}

TEST(AllanSpectrum, SlopeOfCorrelatedNoiseIsItsDerivative) {
    for (const double log_time : {-0.6, 0.0, 2.2, 2.4, 5.0}) {  // on both sides of where a series takes over
        for (const double s2 : {1e-6, 1e-3, 0.2, 1.0}) {
            constexpr double h = 1e-4;
            const double up = CorrelatedShape(log_time + h, 4000)(s2).shape;
            const double down = CorrelatedShape(log_time - h, 4000)(s2).shape;
            const CorrelatedShape::Value at = CorrelatedShape(log_time, 4000)(s2);
            // third derivatives are of the size of the shape: h^2 of it
            EXPECT_NEAR(at.slope, 0.5 * (up - down) / h, 1e-6 * at.shape) << log_time << ' ' << s2;
        }
    }
}

// White angle noise is the diagonal part plus the two end errors.
TEST(AllanSpectrum, AngleNoiseIsDiagonalButForTheEnds) {
    constexpr std::size_t n = 48;
    const auto c = [](std::size_t lag) { return lag == 0 ? 2.0 : lag == 1 ? -1.0 : 0.0; };
    Spectrum s;
    s.samples = n;
    for (const std::size_t j : {1, 2, 3, 20, 47}) {
        const double model = shapes(s.x(j))[quantisation] + s.corner(j) * s.corner(j);
        EXPECT_NEAR(variance_of(cosine(n, j), c), model, 1e-12) << j;
    }
}

TEST(AllanSpectrum, CoefficientsAreThoseOfTheDefinition) {
    random::NormalStream g({3, 0}, random::Purpose::bootstrap);
    for (const std::size_t n : {9, 64, 91}) {
        std::vector<double> rate(n);
        for (double& r : rate) r = 1e6 + g();
        const Spectrum s = cosine_spectrum(rate);
        ASSERT_EQ(s.samples, n);
        std::vector<double> ramp(n);
        for (std::size_t i = 0; i < n; ++i) ramp[i] = static_cast<double>(i);
        const Spectrum of_ramp = cosine_spectrum(ramp);
        double bins = 0.0;
        for (const Bin& b : s.bins) bins += b.count;
        EXPECT_EQ(bins, static_cast<double>(n - 1));
        for (std::size_t j = 1; j < n; ++j) {
            const auto v = cosine(n, j);
            double direct = 0.0;
            for (std::size_t i = 0; i < n; ++i) direct += v[i] * (rate[i] - 1e6);
            EXPECT_NEAR(s.z[j - 1], direct, 1e-8) << n << ' ' << j;
            EXPECT_NEAR(of_ramp.z[j - 1], s.ramp(j), 1e-10 * static_cast<double>(n * n)) << n << ' ' << j;
        }
    }
}

// A large prime length is shortened a little, not transformed slowly.
TEST(AllanSpectrum, AwkwardLengthsAreShortenedLittle) {
    for (const std::size_t n : {101, 1009, 36007}) {
        const Spectrum s = cosine_spectrum(std::vector<double>(n, 0.0));
        EXPECT_LE(s.samples, n);
        EXPECT_GE(static_cast<double>(s.samples), 0.98 * static_cast<double>(n)) << n;
    }
}

// The search ends where no neighbour is likelier, at zero or inside.
TEST(AllanSpectrum, MaximumIsAMaximum) {
    for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6, 7, 8}) {
        const auto angle = test::simulate_angle({.q = 0.2, .n = 0.2, .k = 0.02}, 1000, 1.0, seed);
        std::vector<double> rate(1000);
        for (std::size_t i = 0; i < 1000; ++i) rate[i] = angle[i + 1] - angle[i];
        const Spectrum s = cosine_spectrum(rate);
        const Likelihood likelihood(s);
        Model all;
        all.has = {true, true, true, true};
        all.ramp = true;
        all.restricted = seed % 2 == 0;
        const Maximum best = likelihood.maximise(all);
        for (std::size_t i = 0; i < term_count; ++i) {
            const double scale = best.theta[i] > 0.0 ? best.theta[i] : 1e-4;
            for (const double factor : {-0.01, 0.01}) {
                const double there = best.theta[i] + factor * scale;
                if (there < 0.0) continue;
                Model frozen = all;
                Parameters start = best.theta;
                const Maximum other = likelihood.maximise(frozen, &start, i, there);
                EXPECT_GE(other.deviance, best.deviance - 1e-4) << seed << " term " << i;
            }
        }
    }
}

// The same with correlated noise and its time; a wrong derivative by the time would end elsewhere.
TEST(AllanSpectrum, MaximumWithCorrelatedNoiseIsAMaximum) {
    for (const std::uint64_t seed : {1, 2, 3, 4}) {
        const test::Truth truth{.q = 0.2, .n = 0.2, .correlated_rms = 0.2, .correlation_time_s = 15.0};
        const auto angle = test::simulate_angle(truth, 4000, 1.0, seed);
        std::vector<double> rate(4000);
        for (std::size_t i = 0; i < 4000; ++i) rate[i] = angle[i + 1] - angle[i];
        const Spectrum s = cosine_spectrum(rate);
        const Likelihood likelihood(s);
        Model model;
        model.has = {true, true, false, false, true};
        model.ramp = true;
        model.restricted = seed % 2 == 0;
        Parameters start{0.04, 0.04, 0.0, 0.0, 0.04, std::log(5.0)};
        const Maximum best = likelihood.maximise(model, &start);
        EXPECT_NEAR(best.theta[log_time], std::log(15.0), 0.8) << seed;
        for (const std::size_t i :
             {std::size_t{quantisation}, std::size_t{angle_random_walk}, std::size_t{correlated}, log_time}) {
            for (const double step : {-0.02, 0.02}) {
                const double there = i == log_time ? best.theta[i] + step : best.theta[i] * (1.0 + step);
                const Maximum other = likelihood.maximise(model, &best.theta, i, there);
                EXPECT_GE(other.deviance, best.deviance - 1e-4) << seed << " parameter " << i;
            }
        }
    }
}

}  // namespace
}  // namespace allan_spectrum_test
