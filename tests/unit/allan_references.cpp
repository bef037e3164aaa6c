#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "tests/unit/allan_support.hpp"

/// Published values of the Allan family, to every printed digit.
namespace allan_references_test {
namespace {

using namespace ringlock;
using allan::Estimator;

std::string printed(double value, int digits) { return fmt::format("{:.{}e}", value, digits); }

allan::Point at(Estimator e, const allan::Phase& phase, std::int64_t m, allan::Bias bias = allan::Bias::published) {
    const std::vector<std::int64_t> one = {m};
    return allan::deviation(e, phase, 1.0, one, {.bias = bias}).at(0);
}

struct Value {
    std::int64_t m;
    const char* dev;
};

void expect_values(Estimator e, const allan::Phase& phase, const std::vector<Value>& values, int digits,
                   allan::Bias bias = allan::Bias::published) {
    for (const Value& v : values) {
        EXPECT_EQ(printed(at(e, phase, v.m, bias).dev, digits), v.dev) << allan::name(e) << ", m = " << v.m;
    }
}

// NIST SP1065 section 12.4 (tables 30 and 31), and W. Riley, "The calculation of time domain frequency stability". The
// modified, time and Hadamard totals are printed there with the bias corrected for white frequency noise, and all were
// made from the phase, rounded to five decimals: the frequencies give another last digit in two of them.
TEST(AllanReferences, TenPointsOfNbsMonograph140) {
    const std::vector<double> x = {0.00000,  103.11111, 123.22222, 157.33333, 166.44444,
                                   48.55555, -96.33333, -2.22222,  111.88889, 0.00000};
    const allan::Phase phase = allan::phase_of(x, allan::Kind::phase, 1.0);
    expect_values(Estimator::adev, phase, {{1, "9.122945e+01"}, {2, "1.158082e+02"}}, 6);
    expect_values(Estimator::oadev, phase, {{1, "9.122945e+01"}, {2, "8.595287e+01"}}, 6);
    expect_values(Estimator::mdev, phase, {{1, "9.122945e+01"}, {2, "7.478849e+01"}}, 6);
    expect_values(Estimator::tdev, phase, {{1, "5.267135e+01"}, {2, "8.635831e+01"}}, 6);
    // For m = 1 hdev is printed as 70.80608, ohdev and htotdev, the same sum, as 70.80607.
    expect_values(Estimator::hdev, phase, {{1, "7.080607e+01"}, {2, "1.167980e+02"}}, 6);
    expect_values(Estimator::ohdev, phase, {{1, "7.080607e+01"}, {2, "8.561487e+01"}}, 6);
    expect_values(Estimator::totdev, phase, {{1, "9.122945e+01"}, {2, "9.390379e+01"}}, 6);
    expect_values(Estimator::mtotdev, phase, {{1, "7.550203e+01"}, {2, "7.583606e+01"}}, 6);
    expect_values(Estimator::ttotdev, phase, {{1, "4.359112e+01"}, {2, "8.756794e+01"}}, 6);
    expect_values(Estimator::htotdev, phase, {{1, "7.080607e+01"}, {2, "9.116396e+01"}}, 6);
    // Without correction, from Stable32 1.60 (test data of allantools).
    expect_values(Estimator::mtotdev, phase, {{1, "6.4509e+01"}, {2, "6.4794e+01"}}, 4, allan::Bias::none);
    expect_values(Estimator::ttotdev, phase, {{1, "3.7244e+01"}, {2, "7.4818e+01"}}, 4, allan::Bias::none);
}

TEST(AllanReferences, ThousandFrequenciesOfSp1065) {
    const allan::Phase phase = allan::phase_of(test::sp1065_frequencies(), allan::Kind::rate, 1.0);
    const auto expect = [&](Estimator e, const char* one, const char* ten, const char* hundred) {
        expect_values(e, phase, {{1, one}, {10, ten}, {100, hundred}}, 6);
    };
    expect(Estimator::adev, "2.922319e-01", "9.965736e-02", "3.897804e-02");
    expect(Estimator::oadev, "2.922319e-01", "9.159953e-02", "3.241343e-02");
    expect(Estimator::mdev, "2.922319e-01", "6.172376e-02", "2.170921e-02");
    expect(Estimator::tdev, "1.687202e-01", "3.563623e-01", "1.253382e+00");
    expect(Estimator::hdev, "2.943883e-01", "1.052754e-01", "3.910861e-02");
    expect(Estimator::ohdev, "2.943883e-01", "9.581083e-02", "3.237638e-02");
    expect(Estimator::totdev, "2.922319e-01", "9.134743e-02", "3.406530e-02");
    expect(Estimator::mtotdev, "2.418528e-01", "6.499161e-02", "2.287774e-02");
    expect(Estimator::ttotdev, "1.396338e-01", "3.752293e-01", "1.320847e+00");
    // At m = 10 9.614787e-02 is printed; the sum is 9.614787500962e-02, beyond the middle by a part in 1e10.
    expect(Estimator::htotdev, "2.943883e-01", "9.614788e-02", "3.058103e-02");
    EXPECT_EQ(printed(at(Estimator::htotdev, phase, 10).dev, 10), "9.6147875010e-02");
}

/// PHASE.DAT, which comes with Stable32: the sums of the thousand frequencies of SP1065 less their mean.
allan::Phase phase_dat() {
    std::vector<double> x = {0.0};
    const std::vector<double> y = test::sp1065_frequencies();
    double mean = 0.0;
    for (const double v : y) mean += v / 1000.0;
    for (const double v : y) x.push_back(x.back() + (v - mean));
    return allan::phase_of(x, allan::Kind::phase, 1.0);
}

// Stable32 1.60, as published among the test data of allantools (A. Wallin and others).
TEST(AllanReferences, PhaseDatAgreesWithStable32) {
    const allan::Phase phase = phase_dat();
    ASSERT_EQ(phase.x.size(), 1001U);
    expect_values(Estimator::adev, phase,
                  {{1, "2.9223e-01"},
                   {2, "2.0510e-01"},
                   {4, "1.4943e-01"},
                   {8, "1.1013e-01"},
                   {16, "6.2381e-02"},
                   {32, "5.6233e-02"},
                   {64, "3.2550e-02"},
                   {128, "3.3855e-02"}},
                  4);
    expect_values(Estimator::oadev, phase,
                  {{1, "2.9223e-01"},
                   {2, "2.0102e-01"},
                   {4, "1.4479e-01"},
                   {8, "1.0570e-01"},
                   {16, "6.1915e-02"},
                   {32, "4.8082e-02"},
                   {64, "3.6237e-02"},
                   {128, "2.7674e-02"}},
                  4);
    expect_values(Estimator::mdev, phase,
                  {{1, "2.9223e-01"},
                   {2, "1.5821e-01"},
                   {4, "1.0780e-01"},
                   {8, "7.4192e-02"},
                   {16, "4.1376e-02"},
                   {32, "3.4255e-02"},
                   {64, "2.7871e-02"},
                   {128, "1.8669e-02"}},
                  4);
    expect_values(Estimator::tdev, phase,
                  {{1, "1.6872e-01"},
                   {2, "1.8268e-01"},
                   {4, "2.4895e-01"},
                   {8, "3.4268e-01"},
                   {16, "3.8221e-01"},
                   {32, "6.3287e-01"},
                   {64, "1.0298e+00"},
                   {128, "1.3797e+00"}},
                  4);
    expect_values(Estimator::hdev, phase,
                  {{1, "2.9439e-01"},
                   {2, "2.0716e-01"},
                   {4, "1.4890e-01"},
                   {8, "1.1649e-01"},
                   {16, "5.9589e-02"},
                   {32, "5.4697e-02"},
                   {64, "3.0569e-02"},
                   {128, "3.8060e-02"}},
                  4);
    expect_values(Estimator::ohdev, phase,
                  {{1, "2.9439e-01"},
                   {2, "2.0125e-01"},
                   {4, "1.4368e-01"},
                   {8, "1.0987e-01"},
                   {16, "6.0638e-02"},
                   {32, "4.5095e-02"},
                   {64, "3.3824e-02"},
                   {128, "2.9147e-02"}},
                  4);
    expect_values(Estimator::totdev, phase,
                  {{1, "2.9223e-01"},
                   {2, "2.0089e-01"},
                   {4, "1.4444e-01"},
                   {8, "1.0540e-01"},
                   {16, "6.1788e-02"},
                   {32, "4.8580e-02"},
                   {64, "3.5905e-02"},
                   {128, "3.1259e-02"},
                   {256, "1.3369e-02"}},
                  4);
    expect_values(Estimator::mtotdev, phase,
                  {{1, "2.0664e-01"},
                   {2, "1.4337e-01"},
                   {4, "9.4613e-02"},
                   {8, "6.5721e-02"},
                   {16, "3.7135e-02"},
                   {32, "2.9114e-02"},
                   {64, "2.3606e-02"},
                   {128, "1.6668e-02"},
                   {256, "5.9607e-03"}},
                  4, allan::Bias::none);
    expect_values(Estimator::ttotdev, phase,
                  {{1, "1.1930e-01"},
                   {2, "1.6555e-01"},
                   {4, "2.1850e-01"},
                   {8, "3.0355e-01"},
                   {16, "3.4304e-01"},
                   {32, "5.3788e-01"},
                   {64, "8.7227e-01"},
                   {128, "1.2318e+00"},
                   {256, "8.8101e-01"}},
                  4, allan::Bias::none);
    expect_values(Estimator::mtie, phase,
                  {{1, "5.0597e-01"},
                   {3, "1.2984e+00"},
                   {7, "2.2922e+00"},
                   {15, "2.9949e+00"},
                   {31, "4.4550e+00"},
                   {63, "6.5989e+00"},
                   {127, "6.8061e+00"},
                   {255, "7.8205e+00"},
                   {511, "7.8205e+00"}},
                  4);
    expect_values(Estimator::tierms, phase,
                  {{1, "2.8832e-01"},
                   {2, "4.0240e-01"},
                   {10, "8.7588e-01"},
                   {32, "1.5871e+00"},
                   {71, "2.3318e+00"},
                   {101, "2.7603e+00"},
                   {149, "2.9344e+00"},
                   {200, "2.8163e+00"},
                   {247, "2.6144e+00"}},
                  4);
}

// With the bias corrected: Stable32 1.53 for the modified total, at factors where it took the noise for white, and 1.60
// for the Hadamard total up to where it did.
TEST(AllanReferences, TotalsWithBiasCorrectedAgreeWithStable32) {
    const allan::Phase phase = phase_dat();
    expect_values(Estimator::mtotdev, phase,
                  {{1, "2.4185e-01"},
                   {2, "1.6780e-01"},
                   {3, "1.2701e-01"},
                   {5, "9.9581e-02"},
                   {9, "7.0655e-02"},
                   {13, "5.1608e-02"},
                   {17, "4.1711e-02"},
                   {21, "3.8190e-02"},
                   {25, "3.6662e-02"},
                   {29, "3.5243e-02"}},
                  4);
    expect_values(Estimator::htotdev, phase,
                  {{1, "2.9439e-01"},
                   {2, "2.0297e-01"},
                   {4, "1.4252e-01"},
                   {8, "1.0822e-01"},
                   {16, "6.5265e-02"},
                   {32, "4.4644e-02"},
                   {64, "3.3576e-02"}},
                  4);
    expect_values(Estimator::htotdev, phase,
                  {{2, "2.0247e-01"},
                   {4, "1.4216e-01"},
                   {8, "1.0795e-01"},
                   {16, "6.5102e-02"},
                   {32, "4.4532e-02"},
                   {64, "3.3492e-02"},
                   {128, "2.8790e-02"},
                   {256, "1.4773e-02"}},
                  4, allan::Bias::none);
}

// The terms that Stable32 counts.
TEST(AllanReferences, TermsAreThoseOfStable32) {
    const allan::Phase phase = phase_dat();
    const std::vector<std::pair<Estimator, std::vector<std::pair<std::int64_t, std::int64_t>>>> counted = {
        {Estimator::adev, {{1, 999}, {2, 499}, {8, 124}, {128, 6}}},
        {Estimator::oadev, {{1, 999}, {2, 997}, {128, 745}}},
        {Estimator::mdev, {{1, 999}, {2, 996}, {128, 618}}},
        {Estimator::hdev, {{1, 998}, {2, 498}, {64, 13}, {128, 5}}},
        {Estimator::ohdev, {{1, 998}, {2, 995}, {128, 617}}},
        {Estimator::totdev, {{1, 999}, {256, 999}}},
        {Estimator::mtotdev, {{1, 999}, {2, 996}, {256, 234}, {332, 6}}},
        {Estimator::htotdev, {{1, 998}, {2, 995}, {256, 233}}},
        {Estimator::mtie, {{1, 1000}, {3, 998}, {511, 490}}},
        {Estimator::tierms, {{1, 1000}, {71, 930}, {247, 754}}}};
    for (const auto& [estimator, list] : counted) {
        for (const auto& [m, terms] : list) EXPECT_EQ(at(estimator, phase, m).terms, terms) << allan::name(estimator);
    }
}

}  // namespace
}  // namespace allan_references_test
