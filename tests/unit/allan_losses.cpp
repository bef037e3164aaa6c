#include "tests/unit/allan_losses.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <numbers>

#include "analysis/noise/fit.hpp"
#include "analysis/noise/losses/conditional.hpp"
#include "analysis/noise/losses/cosine_pair.hpp"
#include "analysis/noise/losses/fit.hpp"
#include "analysis/noise/losses/gross.hpp"
#include "analysis/noise/losses/present_information.hpp"
#include "analysis/noise/losses/settle.hpp"
#include "engine/core/error.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_losses_test {

using namespace ringlock;
using allan::Kind;
using noise::Gap;
using noise::LossyRates;
using noise::NoiseFit;
using noise::Pair;

namespace {

constexpr double arw_unit = 1.0 / 60.0;  // arcsec/sqrt(s) to deg/sqrt(h)

/// The rows are the orthonormal cosines.
Eigen::MatrixXd cosines(Eigen::Index n) {
    Eigen::MatrixXd out(n, n);
    for (Eigen::Index j = 0; j < n; ++j) {
        for (Eigen::Index t = 0; t < n; ++t) {
            const double angle = std::numbers::pi * static_cast<double>(j) * (static_cast<double>(t) + 0.5);
            out(j, t) =
                std::sqrt((j == 0 ? 1.0 : 2.0) / static_cast<double>(n)) * std::cos(angle / static_cast<double>(n));
        }
    }
    return out;
}

std::vector<double> lossy(const test::Truth& truth, std::size_t n, const test::Losses& losses, Kind kind,
                          std::uint64_t seed) {
    std::vector<double> data = test::simulate_angle(truth, n, 1.0, seed);
    if (kind != Kind::phase) data = test::rates_of_angle(data);
    test::lose(losses, seed, data);
    return data;
}

NoiseFit fit(const std::vector<double>& data, Kind kind) {
    return noise::fit_noise(allan::phase_of(data, kind, 1.0), 1.0);
}

std::vector<double> random_rates(std::size_t n, std::uint64_t seed) {
    random::NormalStream normal({seed, 0}, random::Purpose::noise_injection);
    std::vector<double> out(n);
    for (double& r : out) r = normal();
    return out;
}

/// White angle noise q, white rate 1 and a random walk of variance k: coefficients 1 to n - 1 without the end errors.
std::vector<double> three_terms(std::size_t n, double q, double k) {
    std::vector<double> out;
    for (std::size_t j = 1; j < n; ++j) {
        const noise::Shapes shape = noise::shapes(0.5 * static_cast<double>(j) / static_cast<double>(n));
        out.push_back(q * shape[noise::quantisation] + 1.0 + k * shape[noise::rate_random_walk]);
    }
    return out;
}

/// Dense covariance of rates with those coefficients; their mean unknown, that is of a variance beyond all others.
Eigen::MatrixXd dense_covariance(const std::vector<double>& variance, double q) {
    const auto n = static_cast<Eigen::Index>(variance.size() + 1);
    Eigen::MatrixXd c = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index j = 1; j < n; ++j) c(j, j) = variance[static_cast<std::size_t>(j - 1)];
    for (Eigen::Index parity = 0; parity < 2; ++parity) {
        Eigen::VectorXd u = Eigen::VectorXd::Zero(n);
        for (Eigen::Index j = parity == 0 ? 2 : 1; j < n; j += 2) {
            u[j] = 2.0 / std::sqrt(static_cast<double>(n)) *
                   std::cos(0.5 * std::numbers::pi * static_cast<double>(j) / static_cast<double>(n));
        }
        c += q * u * u.transpose();
    }
    c(0, 0) = 1e7;
    const Eigen::MatrixXd basis = cosines(n);
    return basis.transpose() * c * basis;
}

}  // namespace

TEST(AllanLosses, PairsOfSeriesGoThroughTheCosineTransformAndBack) {
    for (const std::size_t n : {30u, 35u}) {
        const std::vector<double> a = random_rates(n, 1);
        const std::vector<double> b = random_rates(n, 2);
        Pair z(n);
        for (std::size_t i = 0; i < n; ++i) z[i] = {a[i], b[i]};
        noise::CosinePair basis(n);
        basis.to_coefficients(z);
        const Eigen::MatrixXd dense = cosines(static_cast<Eigen::Index>(n));
        const Eigen::VectorXd za = dense * Eigen::Map<const Eigen::VectorXd>(a.data(), dense.cols());
        const Eigen::VectorXd zb = dense * Eigen::Map<const Eigen::VectorXd>(b.data(), dense.cols());
        for (std::size_t j = 0; j < n; ++j) {
            EXPECT_NEAR(z[j].real(), za[static_cast<Eigen::Index>(j)], 1e-12);
            EXPECT_NEAR(z[j].imag(), zb[static_cast<Eigen::Index>(j)], 1e-12);
        }
        basis.to_series(z);
        for (std::size_t i = 0; i < n; ++i) {
            EXPECT_NEAR(z[i].real(), a[i], 1e-12);
            EXPECT_NEAR(z[i].imag(), b[i], 1e-12);
        }
    }
}

// The conditional mean of Gaussian rates, by the inverse of the dense covariance of what is known.
TEST(AllanLosses, MissingRatesHaveTheConditionalMeanOfTheDenseCovariance) {
    const std::size_t n = 60;
    const double q = 0.7;
    const std::vector<double> variance = three_terms(n, q, 0.05);
    const Eigen::MatrixXd covariance = dense_covariance(variance, q);
    const Eigen::MatrixXd basis = cosines(static_cast<Eigen::Index>(n));
    for (const bool mean_known : {false, true}) {
        const std::vector<Gap> gaps = {
            {3, 4 + (mean_known ? 1u : 0u), mean_known}, {20, 33, mean_known}, {50, 53, mean_known}};
        const std::vector<double> rate = random_rates(n, 5);
        std::vector<Eigen::RowVectorXd> known;
        for (std::size_t i = 0, g = 0; i < n; ++i) {
            Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(static_cast<Eigen::Index>(n));
            if (g < gaps.size() && i == gaps[g].begin) {
                const Gap& gap = gaps[g++];
                row.segment(static_cast<Eigen::Index>(gap.begin), static_cast<Eigen::Index>(gap.size())).setOnes();
                i = gap.end - 1;
                if (!gap.mean_known) continue;
            } else {
                row[static_cast<Eigen::Index>(i)] = 1.0;
            }
            known.push_back(row);
        }
        Eigen::MatrixXd seen(static_cast<Eigen::Index>(known.size()), static_cast<Eigen::Index>(n));
        for (std::size_t k = 0; k < known.size(); ++k) seen.row(static_cast<Eigen::Index>(k)) = known[k];
        const Eigen::VectorXd r = Eigen::Map<const Eigen::VectorXd>(rate.data(), seen.cols());
        const Eigen::VectorXd expected =
            covariance * seen.transpose() * (seen * covariance * seen.transpose()).ldlt().solve(seen * r);
        Pair z(n);
        const Eigen::VectorXd coefficients = basis * r;
        for (std::size_t j = 0; j < n; ++j) z[j] = coefficients[static_cast<Eigen::Index>(j)];
        noise::Conditional conditional(n, gaps);
        const noise::CoefficientNoise noise(variance, q);
        for (int again = 0; again < 4; ++again) conditional.complete(noise, z);  // to more digits than a fit wants
        noise::CosinePair back(n);
        back.to_series(z);
        for (std::size_t i = 0; i < n; ++i) {
            EXPECT_NEAR(z[i].real(), expected[static_cast<Eigen::Index>(i)], 1e-3) << i << ' ' << mean_known;
        }
    }
}

TEST(AllanLosses, AMissingRateLosesItselfAndAMissingAngleTwoRatesButNotTheirSum) {
    const double gone = std::numeric_limits<double>::quiet_NaN();
    const std::vector<double> rate = {gone, 1.0, 2.0, gone, 4.0, gone, gone, 8.0, 9.0};
    const LossyRates a = noise::lossy_rates(allan::phase_of(rate, Kind::rate, 0.5), 0.5);
    ASSERT_EQ(a.rate.size(), 8u);
    ASSERT_EQ(a.gaps.size(), 2u);
    EXPECT_EQ(a.gaps[0].begin, 2u);
    EXPECT_EQ(a.gaps[0].end, 3u);
    EXPECT_EQ(a.gaps[1].begin, 4u);
    EXPECT_EQ(a.gaps[1].end, 6u);
    EXPECT_EQ(a.unknowns(), 3u);
    EXPECT_NEAR(a.rate[2] - a.rate[0], 2.0, 1e-12);  // halfway from 2 to 4, above 1
    const std::vector<double> angle = {0.0, 1.0, 3.0, gone, gone, 6.0, 7.0};
    const LossyRates b = noise::lossy_rates(allan::phase_of(angle, Kind::phase, 0.5), 0.5);
    ASSERT_EQ(b.gaps.size(), 1u);
    EXPECT_EQ(b.gaps[0].begin, 2u);
    EXPECT_EQ(b.gaps[0].end, 5u);
    EXPECT_EQ(b.unknowns(), 2u);
    for (std::size_t i = 2; i < 5; ++i) EXPECT_NEAR(b.rate[i] - b.rate[0], 0.0, 1e-12);  // a third of 3 each
    EXPECT_EQ(b.first(4).gaps[0].end, 4u);
    EXPECT_EQ(b.first(4).unknowns(), 2u);
}

TEST(AllanLosses, ARecordWithoutGapsIsFittedAsEver) {
    const std::vector<double> angle = test::simulate_angle({.q = 0.2, .n = 0.3, .k = 0.01}, 1500, 1.0, 3);
    const allan::Phase phase = allan::phase_of(angle, Kind::phase, 1.0);
    const NoiseFit whole = noise::fit_noise(phase.x, 1.0);
    const NoiseFit mine = noise::fit_noise(phase, 1.0);
    EXPECT_EQ(*whole.arw_deg_rt_h.value, *mine.arw_deg_rt_h.value);
    EXPECT_EQ(*whole.arw_deg_rt_h.lo, *mine.arw_deg_rt_h.lo);
    EXPECT_EQ(*whole.rrw_deg_h_rt_h.hi, *mine.rrw_deg_h_rt_h.hi);
}

// Independent samples: m of them know their standard deviation to 1/sqrt(2 m), wherever they are.
TEST(AllanLosses, HalfOfAWhiteRecordKnowsTheRandomWalkAsWellAsARecordOfHalfTheLength) {
    const int records = 10;
    const std::size_t n = 600;
    for (const std::size_t length : {1u, 30u}) {
        double chi2 = 0.0;
        for (int k = 0; k < records; ++k) {
            const NoiseFit f = fit(lossy({.n = 0.3}, n, {0.5, length}, Kind::rate, 40 + k), Kind::rate);
            ASSERT_TRUE(f.arw_deg_rt_h.resolved);
            const double expected = 0.3 * arw_unit / std::sqrt(static_cast<double>(n));  // 2 m = n
            EXPECT_NEAR(0.5 * (*f.arw_deg_rt_h.hi - *f.arw_deg_rt_h.lo) / *f.arw_deg_rt_h.value * 0.3 * arw_unit,
                        expected, 0.1 * expected)
                << k;
            chi2 += std::pow((*f.arw_deg_rt_h.value - 0.3 * arw_unit) / expected, 2);
            EXPECT_NEAR(static_cast<double>(f.samples), 0.5 * static_cast<double>(n), 2.0);
        }
        EXPECT_LT(chi2, records + 3.0 * std::sqrt(2.0 * records));
        EXPECT_GT(chi2, records - 3.0 * std::sqrt(2.0 * records));
    }
}

// Of white rates the angle at every second instant is a record of its own, and nothing else is known.
TEST(AllanLosses, EverySecondAngleGivesTheRandomWalkOfTheRecordOfThese) {
    const std::vector<double> angle = test::simulate_angle({.n = 0.3}, 1000, 1.0, 9);
    std::vector<double> holes = angle;
    std::vector<double> thin;
    for (std::size_t i = 0; i < angle.size(); ++i) {
        if (i % 2 == 0) {
            thin.push_back(angle[i]);
        } else {
            holes[i] = std::numeric_limits<double>::quiet_NaN();
        }
    }
    const NoiseFit a = fit(holes, Kind::phase);
    const NoiseFit b = noise::fit_noise(thin, 2.0);
    const double error = 0.5 * (*b.arw_deg_rt_h.hi - *b.arw_deg_rt_h.lo);
    EXPECT_NEAR(*a.arw_deg_rt_h.value, *b.arw_deg_rt_h.value, 0.1 * error);
    EXPECT_NEAR(*a.arw_deg_rt_h.hi - *a.arw_deg_rt_h.lo, 2.0 * error, 0.2 * error);
}

// tr(C^-1 dC_k C^-1 dC_l)/2 of the rows that are there, by dense matrices.
TEST(AllanLosses, InformationIsThatOfTheDenseCovarianceOfWhatIsThere) {
    const std::size_t n = 240;
    const double q = 1.5;
    const std::vector<double> variance = three_terms(n, q, 0.02);
    std::vector<double> data = random_rates(n, 3);
    test::lose({0.4, 2}, 3, data);
    const LossyRates rates = noise::lossy_rates(allan::phase_of(data, Kind::rate, 1.0), 1.0);
    const noise::Spectrum spectrum = noise::cosine_spectrum(rates.rate);
    ASSERT_EQ(spectrum.samples, n);
    noise::Maximum model;
    model.theta[noise::quantisation] = q;
    model.theta[noise::angle_random_walk] = 1.0;
    model.theta[noise::rate_random_walk] = 0.02;
    const noise::LostInformation mine =
        noise::present_information(spectrum, model, noise::CoefficientNoise(variance, q), rates.gaps, 40);

    const Eigen::MatrixXd seen = test::seen_rates(data, Kind::rate);
    const Eigen::MatrixXd inverse = (seen * dense_covariance(variance, q) * seen.transpose()).inverse();
    const std::array<noise::Term, 3> terms = {noise::quantisation, noise::angle_random_walk, noise::rate_random_walk};
    Eigen::Matrix3d present;
    Eigen::Matrix3d complete;
    std::vector<Eigen::MatrixXd> there;
    std::vector<Eigen::MatrixXd> all;
    const Eigen::MatrixXd whole = dense_covariance(variance, q).inverse();
    for (const noise::Term term : terms) {
        std::vector<double> shape;
        for (std::size_t j = 1; j < n; ++j) shape.push_back(noise::shapes(spectrum.x(j))[term]);
        Eigen::MatrixXd d = dense_covariance(shape, term == noise::quantisation ? 1.0 : 0.0);
        d.array() -= 1e7 / static_cast<double>(n);  // the mean has no derivative
        there.push_back(inverse * seen * d * seen.transpose());
        all.push_back(whole * d);
    }
    for (Eigen::Index a = 0; a < 3; ++a) {
        for (Eigen::Index b = 0; b < 3; ++b) {
            const auto i = static_cast<std::size_t>(a);
            const auto k = static_cast<std::size_t>(b);
            present(a, b) = 0.5 * there[i].cwiseProduct(there[k].transpose()).sum();
            complete(a, b) = 0.5 * all[i].cwiseProduct(all[k].transpose()).sum();
        }
    }
    const Eigen::Matrix3d variance_there = present.inverse();
    const Eigen::Matrix3d variance_whole = complete.inverse();
    const std::array<std::size_t, 3> which = {terms[0], terms[1], terms[2]};
    for (std::size_t i = 0; i < 3; ++i) {
        const auto at = static_cast<Eigen::Index>(i);
        // 80 draws of 240 samples: some per cent
        const double expected = variance_there(at, at) / variance_whole(at, at);
        EXPECT_NEAR(mine.inflation(which, which[i]), expected, 0.1 * expected) << i;
    }
    EXPECT_GT(mine.ramp_inflation, 1.0);
    EXPECT_LT(mine.ramp_inflation, 1.5);
}

TEST(AllanLosses, AngleNoiseAndDriftsAreFoundBetweenGaps) {
    const test::Truth truth{.q = 0.5, .n = 0.3, .k = 0.02};
    for (const Kind kind : {Kind::rate, Kind::phase}) {
        const NoiseFit f = fit(lossy(truth, 6000, {0.12, 1}, kind, 11), kind);
        ASSERT_TRUE(f.described) << f.reason;
        for (const auto& [c, expected] :
             {std::pair{f.quantization_arcsec, truth.q}, std::pair{f.arw_deg_rt_h, truth.n * arw_unit},
              std::pair{f.rrw_deg_h_rt_h, 60.0 * truth.k}}) {
            ASSERT_TRUE(c.resolved);
            EXPECT_NEAR(*c.value, expected, 3.0 * 0.5 * (*c.hi - *c.lo));
        }
        EXPECT_FALSE(f.bias_instability_deg_h.resolved);
    }
}

TEST(AllanLosses, ASinusoidAcrossGapsHasItsSize) {
    const test::Truth truth{.n = 0.3, .lines = {{.amplitude = 0.2, .frequency_hz = 0.123, .phase_rad = 1.0}}};
    const NoiseFit f = fit(lossy(truth, 2000, {0.3, 5}, Kind::rate, 12), Kind::rate);
    ASSERT_EQ(f.sinusoids.size(), 1u);
    const noise::Sinusoid& line = f.sinusoids[0];
    const double spread = 0.5 * (line.rate_amplitude_deg_h.hi - line.rate_amplitude_deg_h.lo);
    EXPECT_NEAR(line.rate_amplitude_deg_h.value, 0.2, 3.0 * spread);
    EXPECT_NEAR(spread, 0.3 * std::sqrt(2.0 / 1400.0), 0.1 * spread);  // of 1400 samples of white noise
    EXPECT_NEAR(line.frequency_hz.value, 0.123, 1.5 * (line.frequency_hz.hi - line.frequency_hz.lo));
}

TEST(AllanLosses, TheUnitAndTheMeanRateOfTheDataDoNotMatterAndTheAnswerIsAlwaysTheSame) {
    std::vector<double> data = lossy({.n = 0.3, .k = 0.02}, 500, {0.2, 3}, Kind::rate, 5);
    const NoiseFit a = fit(data, Kind::rate);
    const NoiseFit again = fit(data, Kind::rate);
    EXPECT_EQ(*a.arw_deg_rt_h.value, *again.arw_deg_rt_h.value);
    for (double& r : data) r = 8.0 * r + 1024.0;
    const NoiseFit b = fit(data, Kind::rate);
    const double error = 0.5 * (*a.arw_deg_rt_h.hi - *a.arw_deg_rt_h.lo);
    EXPECT_NEAR(*b.arw_deg_rt_h.value, 8.0 * *a.arw_deg_rt_h.value, 0.08 * error);
}

TEST(AllanLosses, RatesThatNoNoiseHasAreMadeMissing) {
    std::vector<double> data = lossy({.n = 0.3}, 400, {0.1, 1}, Kind::rate, 6);
    const LossyRates rates = noise::lossy_rates(allan::phase_of(data, Kind::rate, 1.0), 1.0);
    EXPECT_EQ(noise::without_gross(rates).gaps.size(), rates.gaps.size());
    LossyRates with = rates;
    std::size_t at = 200;
    while (std::isnan(data[at])) ++at;
    with.rate[at] += 10.0;
    const LossyRates without = noise::without_gross(with);
    EXPECT_GT(without.gaps.size(), rates.gaps.size());
    EXPECT_TRUE(std::any_of(without.gaps.begin(), without.gaps.end(), [&](const Gap& g) { return g.begin == at; }));
}

TEST(AllanLosses, RecordsThatCannotBeFittedSayWhy) {
    std::vector<double> few(60, std::numeric_limits<double>::quiet_NaN());
    for (std::size_t i = 0; i < few.size(); i += 3) few[i] = static_cast<double>(i % 7);
    const NoiseFit f = fit(few, Kind::rate);
    EXPECT_FALSE(f.described);
    EXPECT_EQ(f.reason, "20 increments: at least 32 are needed");
    std::vector<double> equal(200, 3.0);
    equal[50] = equal[51] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(fit(equal, Kind::rate).described);
    EXPECT_FALSE(fit(equal, Kind::rate).arw_deg_rt_h.resolved);
    LossyRates infinite{{1.0, 2.0, std::numeric_limits<double>::infinity()}, {}};
    EXPECT_THROW(noise::fit_and_complete(infinite, 1.0), InputError);
    EXPECT_THROW(noise::fit_and_complete({{1.0, 2.0}, {}}, 0.0), InputError);
}

}  // namespace allan_losses_test
