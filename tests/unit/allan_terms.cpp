#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "analysis/noise/allan_variance.hpp"

namespace allan_terms_test {
namespace {

using namespace ringlock;

noise::Coefficient of(double value) { return {true, value, value, value}; }

/// Allan variance of a rate with that covariance: of half the difference of two neighbouring means.
template <class Covariance>
double by_integration(const Covariance& covariance, double tau) {
    constexpr int n = 400;
    double sum = 0.0;
    for (int i = 0; i < 2 * n; ++i) {
        for (int j = 0; j < 2 * n; ++j) {
            const double sign = (i < n) == (j < n) ? 1.0 : -1.0;
            sum += sign * covariance(tau * std::abs(i - j) / n);
        }
    }
    return 0.5 * sum / (static_cast<double>(n) * n);
}

TEST(AllanTerms, AreThoseOfTheStandard) {
    noise::NoiseFit fit;
    fit.quantization_arcsec = of(0.5);
    fit.arw_deg_rt_h = of(0.003);
    fit.bias_instability_deg_h = of(0.02);
    fit.rrw_deg_h_rt_h = of(0.6);
    fit.rate_ramp_deg_h_h = of(7.2);
    const auto terms = noise::variance_terms(fit, {100.0});
    ASSERT_EQ(terms.size(), 5u);
    EXPECT_NEAR(terms[0].variances[0], 3.0 * 0.25 / 1e4, 1e-12);
    // 0.003 deg/sqrt(h) is 0.18 arcsec/sqrt(s).
    EXPECT_NEAR(terms[1].variances[0], 0.18 * 0.18 / 100.0, 1e-12);
    EXPECT_NEAR(terms[2].variances[0], 0.4412712 * 4e-4, 1e-9);
    EXPECT_NEAR(terms[3].variances[0], 1e-4 * 100.0 / 3.0, 1e-12);
    EXPECT_NEAR(terms[4].variances[0], 0.5 * 0.2 * 0.2, 1e-12);
    EXPECT_TRUE(noise::variance_terms({}, {1.0}).empty());
}

TEST(AllanTerms, CorrelatedNoiseAndSinusoidsAreWhatIntegrationGives) {
    noise::NoiseFit fit;
    fit.correlated.emplace();
    fit.correlated->correlation_time_s.value = 5.0;
    fit.correlated->rms_rate_deg_h.value = 0.3;
    fit.sinusoids.push_back({{0.07, 0.07, 0.07}, {2.0, 2.0, 2.0}, 0.0});
    const std::vector<double> tau_s = {0.001, 0.005, 1.0, 7.0, 60.0};
    const auto terms = noise::variance_terms(fit, tau_s);
    ASSERT_EQ(terms.size(), 2u);
    for (std::size_t i = 0; i < tau_s.size(); ++i) {
        const double tau = tau_s[i];
        const double expected = by_integration([](double t) { return 0.09 * std::exp(-t / 5.0); }, tau);
        EXPECT_NEAR(terms[0].variances[i], expected, 0.01 * expected) << tau;
        // A sinusoid of random phase: covariance Omega^2/2 cos.
        const double line = by_integration([](double t) { return 2.0 * std::cos(2.0 * M_PI * 0.07 * t); }, tau);
        EXPECT_NEAR(terms[1].variances[i], line, 0.01 * line + 1e-9) << tau;
    }
}

}  // namespace
}  // namespace allan_terms_test
