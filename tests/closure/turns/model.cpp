// What the closed loop's fit is made of: exact kicks, the whitening filter, phases joined from count and quadrature.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <random>
#include <string>

#include "analysis/closure/decide/rows.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/closure/turns/model/kicks.hpp"
#include "analysis/closure/turns/model/noise_shape.hpp"
#include "analysis/closure/turns/model/whitening.hpp"
#include "analysis/closure/turns/screen/miscounts.hpp"
#include "engine/core/units.hpp"
#include "engine/gyro/device.hpp"
#include "engine/gyro/theory.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "tests/closure/generator/generator.hpp"

namespace ringlock::test::closure {
namespace turns_model_test {
namespace {

using namespace ringlock::closure;

TEST(TurnKicks, AreTheSineToFirstOrder) {
    gyro::Setup setup;
    setup.dither_frequency_hz = 124.68;
    setup.dither_peak_rate_deg_s = 109.1;
    setup.input_rate_deg_h = 15.0;
    const TurnKicks kicks(setup);
    const double kappa = gyro::turn_kick_rad(setup);
    for (const int direction : {1, -1}) {
        for (double psi = 0.0; psi < units::two_pi; psi += 0.3) {
            const TurnKicks::Kick kick = kicks.at(direction, psi);
            const double first = kappa * std::sin(psi + 0.25 * direction * units::pi);
            EXPECT_NEAR(kick.before_rad + kick.after_rad, first, 0.05 * kappa * kappa * kappa);
            constexpr double h = 1e-5;
            const double ahead = kicks.at(direction, psi + h).after_rad;
            const double behind = kicks.at(direction, psi - h).after_rad;
            EXPECT_NEAR(kick.after_slope, (ahead - behind) / (2.0 * h), 1e-8);
        }
    }
}

/// The device of Gao and Deng, with what changes its kicks. A dither with a second harmonic whose half cycles differ in
/// length has jumps of its rate at the turns, between which there is no zero-rate point: not both.
gyro::Setup kicked(const std::string& with) {
    gyro::Setup setup;
    setup.dither_frequency_hz = 124.68;
    setup.dither_peak_rate_deg_s = 109.1;
    setup.input_rate_deg_h = 40.0;
    if (with == "nothing") return setup;
    setup.coupling_phase_rad = 0.3;
    setup.lockin_turn_asymmetry = 0.1;
    if (with == "an asymmetric dither") {
        setup.dither_asymmetry_ratio = 0.01;
    } else {
        setup.dither_harmonic_ratio = 0.01;
        setup.dither_harmonic_phase_rad = 1.0;
    }
    return setup;
}
const std::vector<std::string> kinds{"nothing", "an asymmetric dither", "a dither with a second harmonic"};

/// Phase that the lock-in adds from a turn of the dither to the next, by the equation of motion through every fringe.
double integrated_rad(const gyro::Device& device, int direction, double psi_rad) {
    const propagate::Stretch stretch{device.half_cycle(direction, device.dither_amplitude_rad), device.coupling,
                                     psi_rad / units::two_pi,
                                     direction > 0 ? device.positive_duration_s : device.negative_duration_s};
    propagate::StretchResult result;
    propagate::integrate({&stretch, 1}, 1e-11, {&result, 1});
    return result.lockin_rad;
}

/// Phase at the zero-rate point less that at the dither's turn, by Runge and Kutta's steps of fourth order. There are
/// two half cycles about a turn; the phase stands still in the one that its rate at the turn leads to.
double gained_rad(const gyro::Device& device, int direction, double psi_rad) {
    gyro::HalfCycle half = device.half_cycle(direction, device.dither_amplitude_rad);
    const gyro::Coupling& coupling = device.coupling;
    const auto rate = [&](double time_s, double psi) {
        const double b = coupling.b_rad_s * (1.0 + coupling.turn_asymmetry * half.sign *
                                                       std::cos(half.angular_frequency_rad_s() * time_s));
        return half.drive_rate_rad_s(time_s) +
               b * (std::sin(psi + coupling.phase_rad) +
                    coupling.second_ratio * std::sin(2.0 * psi + coupling.second_phase_rad));
    };
    double time_s = 0.0;
    if (direction * rate(0.0, psi_rad) > 0.0) {
        half = device.half_cycle(-direction, device.dither_amplitude_rad);
        time_s = half.duration_s;
    }
    double psi = psi_rad;
    // Newton's steps in time, each in small ones of the equation; the last are short.
    constexpr int small = 200;
    for (int i = 0; i < 6; ++i) {
        const double h = 1e-9;
        const double now = rate(time_s, psi);
        const double t = -now * h / (rate(time_s + h, psi + h * now) - now) / small;
        for (int j = 0; j < small; ++j) {
            const double k1 = rate(time_s, psi);
            const double k2 = rate(time_s + 0.5 * t, psi + 0.5 * t * k1);
            const double k3 = rate(time_s + 0.5 * t, psi + 0.5 * t * k2);
            const double k4 = rate(time_s + t, psi + t * k3);
            psi += t * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0;
            time_s += t;
        }
    }
    return psi - psi_rad;
}

TEST(TurnKicks, AddUpToTheEquationOfMotion) {
    for (const double second : {0.0, 0.3}) {
        for (const std::string& with : kinds) {
            gyro::Setup setup = kicked(with);
            setup.lockin_second_ratio = second;
            setup.lockin_second_phase_rad = 0.5;
            const gyro::Device device(setup);
            const TurnKicks kicks(setup);
            double worst_rad = 0.0;
            for (const int direction : {1, -1}) {
                for (double psi = 0.0; psi < units::two_pi; psi += 0.3) {
                    // From turn to turn: less the ways from the dither's turns to the zero-rate points.
                    const double lockin = integrated_rad(device, direction, psi);
                    const gyro::HalfCycle half = device.half_cycle(direction, device.dither_amplitude_rad);
                    const double next = std::remainder(psi + half.plain_phase_total_rad() + lockin, units::two_pi);
                    const double start_gain = gained_rad(device, direction, psi);
                    const double end_gain = gained_rad(device, -direction, next);
                    const double kick = kicks.at(direction, psi + start_gain).after_rad + start_gain +
                                        kicks.at(-direction, next + end_gain).before_rad - end_gain;
                    worst_rad = std::max(worst_rad, std::abs(kick - lockin));
                }
            }
            std::printf("second harmonic %g, with %s: largest error of a half cycle %.2g rad\n", second, with.c_str(),
                        worst_rad);
            // Rounding of two thousand fringes.
            EXPECT_LT(worst_rad, 1e-10);
        }
    }
}

TEST(TurnKicks, AreInterpolatedBetweenRates) {
    for (const std::string& with : kinds) {
        for (const double reach_deg_h : {0.0, 5.0, 100.0, 300.0, 1000.0, 5000.0, 50000.0}) {
            // Its kink wanders with the rate.
            if (with == "an asymmetric dither" && reach_deg_h > 5000.0) continue;
            gyro::Setup setup = kicked(with);
            const KicksOverRange kicks(setup, {40.0 - reach_deg_h, 40.0 + reach_deg_h});
            double worst_rad = 0.0;
            for (const double share : {-0.95, -0.5, 0.1, 0.35, 0.8}) {
                setup.input_rate_deg_h = 40.0 + share * reach_deg_h;
                const TurnKicks exact(setup);
                for (const int direction : {1, -1}) {
                    for (double psi = 0.0; psi < units::two_pi; psi += 0.1) {
                        const TurnKicks::Kick one = exact.at(direction, psi);
                        const TurnKicks::Kick other = kicks.at(direction, std::polar(1.0, psi), setup.input_rate_deg_h);
                        worst_rad = std::max({worst_rad, std::abs(one.before_rad - other.before_rad),
                                              std::abs(one.after_rad - other.after_rad)});
                    }
                }
            }
            std::printf("rates within %g deg/h, with %s: largest error of half a kick %.2g rad\n", reach_deg_h,
                        with.c_str(), worst_rad);
            EXPECT_LT(worst_rad, 1e-8) << reach_deg_h;
        }
    }
}

TEST(TurnKicks, AreInterpolatedBetweenThresholds) {
    for (const std::string& with : kinds) {
        for (const double reach : {0.0, 1e-3, 0.01, 0.04, 0.2}) {
            const gyro::Setup nominal = kicked(with);
            const KicksOverRange kicks(nominal, {0.0, 80.0}, {1.05 - reach, 1.05 + reach});
            double worst_rad = 0.0;
            for (const double share : {-0.95, -0.5, 0.1, 0.8}) {
                const double factor = 1.05 + share * reach;
                gyro::Setup setup = nominal;
                setup.lockin_threshold_deg_h *= factor;
                setup.input_rate_deg_h = 25.0;
                const TurnKicks exact(setup);
                for (const int direction : {1, -1}) {
                    for (double psi = 0.0; psi < units::two_pi; psi += 0.1) {
                        const TurnKicks::Kick one = exact.at(direction, psi);
                        const TurnKicks::Kick other =
                            kicks.at(direction, std::polar(1.0, psi), setup.input_rate_deg_h, factor);
                        worst_rad = std::max({worst_rad, std::abs(one.before_rad - other.before_rad),
                                              std::abs(one.after_rad - other.after_rad)});
                    }
                }
            }
            std::printf("thresholds within %g, with %s: largest error of half a kick %.2g rad\n", reach, with.c_str(),
                        worst_rad);
            EXPECT_LT(worst_rad, 5e-8) << reach;
        }
    }
}

TEST(LongTurnModel, FollowsAnotherSimulatorsGyro) {
    Truth truth;
    truth.turns = 1500;
    truth.input_rate_deg_h = 40.0;
    std::vector<Truth> truths(3, truth);
    truths[1].lockin_second_harmonic = {0.03, 0.7};
    truths[2].lockin_turn_asymmetry = 0.05;
    const auto records = generate(truths);
    for (std::size_t k = 0; k < records.size(); ++k) {
        const JoinedPhase joined = join(*records[k].turns, {}, false);
        const TurnSeries series = prepare(records[k], joined);
        const TurnModel model(series, joined.phase_rad);
        TurnParameters p;
        p.threshold_deg_h = truth.lockin_threshold_deg_h;
        if (k == 1) {
            p.effects.push_back({effects::find("lockin_second_harmonic"), {{"ratio", 0.03}, {"phase_rad", 0.7}}});
        }
        if (k == 2) p.effects.push_back({effects::find("lockin_turn_asymmetry"), {{"ratio", 0.05}}});
        const auto prediction = model.predict(p);
        // But for offset, amplitude and a rate.
        Eigen::MatrixXd x(series.size(), 3);
        Eigen::VectorXd y(series.size());
        for (std::size_t i = 0; i < series.size(); ++i) {
            const auto row = static_cast<Eigen::Index>(i);
            x.row(row) << 1.0, prediction.frame.sign[i], series.time_s[i];
            y(row) = joined.phase_rad[i] - prediction.phase_rad[i];
        }
        const Eigen::VectorXd c = x.colPivHouseholderQr().solve(y);
        std::printf("case %zu: largest difference %.2g rad, rate %.2g rad/s\n", k, (y - x * c).cwiseAbs().maxCoeff(),
                    c(2));
        // Times of turns know the coupling's first harmonic only; and between the turns the two simulators let an
        // asymmetric threshold change in ways of their own.
        EXPECT_LT((y - x * c).cwiseAbs().maxCoeff(), k == 0 ? 2e-6 : 5e-5) << k;
        EXPECT_LT(std::abs(c(2)), k == 0 ? 1e-5 : 1e-4) << "rad/s: " << k;
    }
}

/// Covariance of the phases that TurnNoise describes, from its definition.
Eigen::MatrixXd covariance(const TurnFrame& frame, const TurnNoise& noise) {
    const auto n = static_cast<Eigen::Index>(frame.sign.size());
    // Sources: w_i, v_i, steps of m, white rates.
    Eigen::MatrixXd sources = Eigen::MatrixXd::Zero(n, 4 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
        sources(i, i) = std::sqrt(noise.injected_rad2);
        const double v = std::sqrt(noise.readout_rad2);
        sources(i, n + i) = (1.0 - frame.before_slope[static_cast<std::size_t>(i)]) * v;
        for (Eigen::Index j = 0; j < i; ++j) {
            sources(i, n + j) = -frame.kick_slope[static_cast<std::size_t>(j)] * v;
            sources(i, 2 * n + j) = frame.sign[static_cast<std::size_t>(i)] * std::sqrt(noise.wander_rad2);
            sources(i, 3 * n + j) = std::sqrt(noise.white_rad2_per_s * frame.interval_s);
        }
    }
    Eigen::MatrixXd c = sources * sources.transpose();
    const double dt = frame.interval_s;
    for (Eigen::Index i = 0; i < n; ++i) {
        for (Eigen::Index j = 0; j < n; ++j) {
            const double s = dt * static_cast<double>(std::min(i, j));
            const double t = dt * static_cast<double>(std::max(i, j));
            c(i, j) += noise.walk_rad2_per_s3 * s * s * (3.0 * t - s) / 6.0;
            for (const PhaseRateTerm& term : noise.rates) {
                // Covariance of two integrals of an Ornstein-Uhlenbeck rate from 0 on.
                const double T = term.time_s;
                c(i, j) += term.variance_rad2_s2 * T * T *
                           (2.0 * s / T - 1.0 + std::exp(-s / T) + std::exp(-t / T) - std::exp(-(t - s) / T));
            }
        }
    }
    return c;
}

/// A few turns, each noise of the filter's at work.
struct NoisyTurns {
    static constexpr std::size_t n = 40;
    NoisyTurns() : series(n) {
        std::mt19937_64 random(3);
        std::normal_distribution<double> normal;
        frame.interval_s = 0.004;
        for (std::size_t i = 0; i < n; ++i) {
            frame.sign.push_back(i % 2 == 0 ? -1.0 : 1.0);
            frame.before_slope.push_back(0.07 * normal(random));
            frame.kick_slope.push_back(0.15 * normal(random));
        }
        noise.injected_rad2 = 0.3;
        noise.readout_rad2 = 0.2;
        noise.wander_rad2 = 0.05;
        noise.white_rad2_per_s = 3.0;
        noise.walk_rad2_per_s3 = 900.0;
        noise.rates = {{0.01, 80.0}, {0.5, 20.0}};
        for (double& value : series) value = normal(random);
    }
    TurnFrame frame;
    TurnNoise noise;
    std::vector<double> series;
};

TEST(Whitening, TellsTheReadingsErrorsByAllPhases) {
    constexpr auto n = static_cast<Eigen::Index>(NoisyTurns::n);
    const NoisyTurns turns;
    const double readout_rad2 = turns.noise.readout_rad2;
    Eigen::MatrixXd shared = Eigen::MatrixXd::Zero(n, n);  // covariance of errors (rows) and phases
    for (Eigen::Index j = 0; j < n; ++j) {
        shared(j, j) = readout_rad2 * (1.0 - turns.frame.before_slope[static_cast<std::size_t>(j)]);
        for (Eigen::Index i = j + 1; i < n; ++i) {
            shared(j, i) = -readout_rad2 * turns.frame.kick_slope[static_cast<std::size_t>(j)];
        }
    }
    const Eigen::LLT<Eigen::MatrixXd> cholesky(covariance(turns.frame, turns.noise));
    const Eigen::VectorXd mean = shared * cholesky.solve(Eigen::Map<const Eigen::VectorXd>(turns.series.data(), n));
    const Eigen::VectorXd told = (shared * cholesky.solve(shared.transpose())).diagonal();
    const auto errors = Whitening(turns.frame, turns.noise).reading_errors(turns.series);
    for (Eigen::Index i = 0; i < n; ++i) {
        EXPECT_NEAR(errors.mean_rad[static_cast<std::size_t>(i)], mean(i), 1e-9) << i;
        EXPECT_NEAR(errors.variance_rad2[static_cast<std::size_t>(i)], readout_rad2 - told(i), 1e-9) << i;
    }
}

TEST(Whitening, IsTheCholeskyFactorOfTheCovariance) {
    constexpr std::size_t n = NoisyTurns::n;
    const auto [frame, noise, series] = NoisyTurns();
    const Whitening whitening(frame, noise);
    const Eigen::LLT<Eigen::MatrixXd> cholesky(covariance(frame, noise));
    const Eigen::VectorXd expected =
        cholesky.matrixL().solve(Eigen::Map<const Eigen::VectorXd>(series.data(), static_cast<Eigen::Index>(n)));
    const auto white = whitening.apply(series);
    const Eigen::MatrixXd factor = cholesky.matrixL();
    for (std::size_t i = 0; i < n; ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        EXPECT_NEAR(whitening.sd_rad()[i], factor(row, row), 1e-9);
        EXPECT_NEAR(white[i], expected(row), 1e-8);
    }
    // The density of phases, of which innovations are a function: its determinant is beside that of the filter.
    double minus_log = 0.5 * expected.squaredNorm();
    for (std::size_t i = 0; i < n; ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        minus_log += std::log(factor(row, row)) - std::log(1.0 - frame.before_slope[i]);
    }
    const std::vector<std::uint8_t> all(n, 1);
    EXPECT_NEAR(Whitening::minus_log_likelihood(frame, noise, series, all), minus_log, 1e-8);
}

TEST(JoinedPhase, CountAndQuadratureMayDifferByAQuarterAtItsEdge) {
    record::Turns turns;
    std::mt19937_64 random(5);
    std::normal_distribution<double> normal(0.0, 0.01);
    std::vector<double> truth;
    for (int i = 0; i < 4000; ++i) {
        const double psi = 0.37 * i * (i % 2 == 0 ? 1.0 : -1.0) + (i % 2 == 0 ? 0.0 : 5000.0);
        truth.push_back(psi);
        turns.time_s.push_back(0.004 * i);
        turns.direction.push_back(i % 2 == 0 ? 1 : -1);
        turns.sine.push_back(2.0 * (std::sin(psi) + normal(random)));
        turns.cosine.push_back(2.0 * (std::cos(psi) + normal(random)));
        // The counter has noise of its own, and another zero.
        const double quarter = std::floor((psi + normal(random)) / (0.5 * units::pi));
        turns.quarter_count.push_back(static_cast<std::int64_t>(quarter) + 7);
    }
    turns.accel_before_rad_s2.assign(truth.size(), 0.0);
    turns.accel_after_rad_s2.assign(truth.size(), 0.0);
    const JoinedPhase joined = join(turns, {}, false);
    EXPECT_TRUE(joined.miscounted.empty());
    EXPECT_NEAR(joined.readout_sd_rad, 0.01, 0.0005);
    for (std::size_t i = 0; i < truth.size(); ++i) {
        const double off = joined.phase_rad[i] - truth[i] - (joined.phase_rad[0] - truth[0]);
        EXPECT_NEAR(off, 0.0, 0.1) << i;
    }
    // Three quarters lost, one after the other.
    for (std::size_t i = 1000; i < truth.size(); ++i) {
        turns.quarter_count[i] -= i < 2000 ? 1 : i < 3000 ? 2 : 3;
    }
    const JoinedPhase lost = join(turns, {}, true);
    EXPECT_EQ(lost.miscounted.size(), 3U);
    for (std::size_t i = 0; i < truth.size(); ++i) {
        const double off = lost.phase_rad[i] - truth[i] - (lost.phase_rad[0] - truth[0]);
        EXPECT_NEAR(off, 0.0, 0.1) << i;
    }
}

TEST(MissedCounts, AreNotLostWhereTheNextTurnTakesThemBack) {
    constexpr std::size_t n = 20000;
    const Rows all(n, 1);
    for (const double p : {0.003, 0.2}) {
        for (const double edge : {0.0, 0.05}) {
            record::Turns turns;
            std::mt19937_64 random(7);
            std::normal_distribution<double> normal;
            std::uniform_real_distribution<double> uniform;
            std::vector<double> phase_rad;
            std::int64_t missed = 0;
            std::int64_t events = 0;
            for (std::size_t i = 0; i < n; ++i) {
                const int direction = i % 2 == 0 ? 1 : -1;
                const double psi = 2000.0 * uniform(random) - 1000.0 * direction;
                if (uniform(random) < p) {
                    missed += direction;
                    ++events;
                }
                const double counted = std::floor(psi / (0.5 * units::pi) + edge * normal(random));
                turns.time_s.push_back(0.004 * static_cast<double>(i));
                turns.direction.push_back(static_cast<std::int8_t>(direction));
                turns.sine.push_back(std::sin(psi) + 0.005 * normal(random));
                turns.cosine.push_back(std::cos(psi) + 0.005 * normal(random));
                turns.quarter_count.push_back(static_cast<std::int64_t>(counted) + missed);
                phase_rad.push_back(psi);
            }
            const JoinedPhase again = join(turns, {}, true);
            for (std::size_t i = 0; i < n; ++i) {
                const double off = again.phase_rad[i] - phase_rad[i] - (again.phase_rad[0] - phase_rad[0]);
                ASSERT_NEAR(off, 0.0, 0.1) << "p " << p << ", edge " << edge << ", turn " << i;
            }
            const JoinedPhase joined = join(turns, {}, false);
            const auto share = share_of_missed_counts(turns, joined, all);
            const double truth = static_cast<double>(events) / static_cast<double>(n);
            const double of_trials = std::sqrt(truth * (1.0 - truth) / static_cast<double>(n));
            EXPECT_NEAR(share.probability_per_turn, truth, 2.0 * of_trials) << "p " << p << ", edge " << edge;
            EXPECT_GT(share.sd, 0.9 * of_trials) << "p " << p << ", edge " << edge;
            EXPECT_LT(share.sd, 1.5 * of_trials) << "p " << p << ", edge " << edge;
        }
    }
}

TEST(HeldOutRows, AreATenthInFourBlocks) {
    for (const std::size_t size : {1600U, 16000U, 184718U}) {
        const auto chooses = training_rows(size);
        ASSERT_EQ(chooses.size(), size);
        std::size_t reported = 0;
        std::size_t blocks = 0;
        for (std::size_t i = 0; i < size; ++i) {
            reported += chooses[i] ? 0 : 1;
            blocks += i > 0 && chooses[i - 1] && !chooses[i] ? 1 : 0;
        }
        EXPECT_NEAR(static_cast<double>(reported), 0.1 * static_cast<double>(size), 4.0);
        EXPECT_EQ(blocks, 4U);
        EXPECT_TRUE(chooses.front() && chooses.back());
    }
}

TEST(Chance, KnowsItsTables) {
    EXPECT_NEAR(chi2_tail(3.841459, 1), 0.05, 1e-7);
    EXPECT_NEAR(chi2_tail(18.30704, 10), 0.05, 1e-7);
    EXPECT_EQ(chi2_tail(-1.0, 3), 1.0);
    EXPECT_NEAR(of_several(1e-12, 1e6), 1e-6, 1e-11);
    EXPECT_NEAR(of_several(0.3, 2.0), 0.51, 1e-12);
    // A statistic that does not vary with the nuisance needs no correction.
    EXPECT_NEAR(davies_bound(9.0, {3.0, 3.0, 3.0}), chi2_tail(9.0, 1), 1e-15);
    EXPECT_GT(davies_bound(9.0, {-3.0, 3.0, -3.0}), 3.0 * chi2_tail(9.0, 1));
}

TEST(Chance, AmplitudesAreIntegratedOutWithTheirLikeliestVariance) {
    // x normal about an amplitude, that about zero with g times its variance: log of the ratio of densities is
    // x^2/2 g/(1 + g) - log(1 + g)/2, twice as much for two.
    for (const int amplitudes : {1, 2, 5}) {
        for (const double gain : {0.3, 3.0, 8.0, 200.0}) {
            double most = 0.0;
            for (double g = 0.0; g < 3.0 * gain; g += 1e-3) {
                most = std::max(most, gain * g / (1.0 + g) - 0.5 * amplitudes * std::log1p(g));
            }
            EXPECT_NEAR(gain - cost_of_amplitudes(gain, amplitudes), most, 1e-5) << amplitudes << " " << gain;
        }
    }
    EXPECT_EQ(cost_of_amplitudes(7.0, 0), 0.0);
}

TEST(NoiseShape, IsWhatTheJacobianLeavesOfEvenNoise) {
    std::mt19937_64 random(5);
    const double bound = 1.7;
    std::uniform_real_distribution<double> even(-bound, bound);
    std::vector<double> innovations(20000);
    for (double& v : innovations) v = even(random);
    const std::vector<int> direction{1, -1, 1, -1};
    const std::vector<double> predicted{0.3, -2.0, 7.0, 1.234};
    // Without lock-in in closed form, by the mean square bound^2 / 3.
    const auto plain = NoiseShape::of(innovations, TurnKicks(), direction, predicted);
    ASSERT_NE(plain, nullptr);
    for (std::size_t i = 0; i < predicted.size(); ++i) {
        for (int k = 1; k <= 4; ++k) {
            const double h = k * bound;
            const double with_noise = 3.0 * (std::sin(h) - h * std::cos(h)) / (h * h * bound);
            const std::complex<double> left =
                std::complex<double>(0.0, with_noise - std::sin(h) / bound) * std::polar(1.0, k * predicted[i]);
            EXPECT_LT(std::abs(plain->at(i)[static_cast<std::size_t>(k - 1)] - left), 0.02) << k;
        }
    }
    // With it, by chance.
    gyro::Setup setup;
    setup.lockin_threshold_deg_h = 1500.0;
    setup.dither_frequency_hz = 124.68;
    setup.dither_peak_rate_deg_s = 109.1;
    const TurnKicks kicks(setup);
    const auto locked = NoiseShape::of(innovations, kicks, direction, predicted);
    for (std::size_t i = 0; i < predicted.size(); ++i) {
        std::complex<double> left[2] = {};
        constexpr int draws = 200000;
        for (int draw = 0; draw < draws; ++draw) {
            const double v = even(random);
            const double psi = kicks.phase_after(direction[i], predicted[i] + v);
            const auto kick = kicks.at(direction[i], psi);
            EXPECT_NEAR(psi, predicted[i] + v + kick.before_rad, 1e-12);
            for (int k = 1; k <= 2; ++k) {
                left[k - 1] += std::polar(1.0, k * psi) *
                               std::complex<double>(3.0 * v / (bound * bound), -k / (1.0 - kick.before_slope)) /
                               static_cast<double>(draws);
            }
        }
        for (std::size_t k = 0; k < 2; ++k) {
            EXPECT_LT(std::abs(locked->at(i)[k] - left[k]), 0.02);
            EXPECT_GT(std::abs(locked->at(i)[k] - plain->at(i)[k]), 0.02);  // which the lock-in changes
        }
    }
}

TEST(NoiseShape, IsNoneOfNormalNoise) {
    std::mt19937_64 random(6);
    std::normal_distribution<double> normal;
    std::vector<double> innovations(20000);
    for (double& v : innovations) v = normal(random);
    EXPECT_EQ(NoiseShape::of(innovations, TurnKicks(), {}, {}), nullptr);
}

}  // namespace
}  // namespace turns_model_test
}  // namespace ringlock::test::closure
