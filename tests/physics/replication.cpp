// What docs/replication.md says of the paper's equations and of its Table 1.
#include "tests/support/replication.hpp"

#include <algorithm>
#include <cmath>

#include "engine/gyro/theory.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/turn_path.hpp"

namespace ringlock::test {
namespace replication_test {
namespace {

using replication::CorrectionDensity;
using replication::Span;

/// Phase at a time by the direct integrator alone, forwards from time 0.
double integrated_lockin_rad(const gyro::Device& device, double time_s) {
    Phase phase(device.initial_phase_rad);
    double lockin = 0.0;
    for (int k = 0; time_s > 0.0; ++k) {
        const gyro::HalfCycle half = device.half_cycle(k % 2 == 0 ? 1.0 : -1.0, device.dither_amplitude_rad);
        const double end = std::min(time_s, half.duration_s);
        const propagate::Stretch stretch{half, device.coupling, phase.remainder_rad / units::two_pi, end};
        propagate::StretchResult result;
        propagate::integrate({&stretch, 1}, 1e-12, {&result, 1});
        phase.add(half.plain_phase_rad(end));
        phase.add(result.lockin_rad);
        lockin += result.lockin_rad;
        time_s -= half.duration_s;
    }
    return lockin;
}

double difference_rad(const Phase& a, const Phase& b) {
    return static_cast<double>(a.fringes - b.fringes) * units::two_pi + (a.remainder_rad - b.remainder_rad);
}

TEST(GyroPath, IsTheIntegratorsAtAnyTime) {
    Uniform uniform(8000);
    for (int i = 0; i < 12; ++i) {
        gyro::Setup setup = paper_device();
        setup.input_rate_deg_h = uniform(-1000.0, 1000.0);
        setup.initial_phase_rad = uniform(-3.0, 3.0);
        setup.coupling_phase_rad = uniform(-3.0, 3.0);
        setup.dither_asymmetry_ratio = uniform(-0.03, 0.03);
        if (i % 3 == 1) setup.dither_harmonic_ratio = 0.01;  // no path backwards in time
        if (i % 3 == 2) setup.lockin_turn_asymmetry = 0.1;
        const gyro::Device device(setup);
        GyroPath path(device, 1e-11);
        // Close to both turns, in the middle of either half cycle, two cycles on.
        const std::vector<double> times = {0.0,
                                           1e-5,
                                           0.3 * device.positive_duration_s,
                                           0.8 * device.positive_duration_s,
                                           device.positive_duration_s + 0.7 * device.negative_duration_s,
                                           device.period_s() - 2e-5,
                                           2.45 * device.period_s()};
        const std::vector<Phase> phases = path.at(times);
        for (std::size_t k = 0; k < times.size(); ++k) {
            Phase expected(device.initial_phase_rad);
            double left = times[k];
            for (int h = 0; left > 0.0; ++h) {
                const gyro::HalfCycle half = device.half_cycle(h % 2 == 0 ? 1.0 : -1.0, device.dither_amplitude_rad);
                expected.add(half.plain_phase_rad(std::min(left, half.duration_s)));
                left -= half.duration_s;
            }
            expected.add(integrated_lockin_rad(device, times[k]));
            // Five half cycles of either propagator; where motion is fast, a time is known to 1e-17 s times 5e6 rad/s.
            EXPECT_NEAR(difference_rad(phases[k], expected), 0.0, 3e-9) << i << ", time " << times[k];
        }
    }
}

TEST(GyroPath, CountsAreThoseOfThePlainPhaseWithoutLockIn) {
    gyro::Setup setup = paper_device();
    setup.lockin_threshold_deg_h = 0.0;
    setup.input_rate_deg_h = 100.0;
    setup.initial_phase_rad = 0.1;
    const gyro::Device device(setup);
    GyroPath path(device, 1e-11);
    const std::vector<std::int64_t> counts = path.quarter_counts(0.0, replication::reading_interval_s, 5);
    const double w = units::two_pi * setup.dither_frequency_hz;
    const auto counter = [&](double t) {
        const double psi = 0.1 + device.input_rate_rad_s * t + device.dither_amplitude_rad * (1.0 - std::cos(w * t));
        return static_cast<std::int64_t>(std::floor(psi / (0.5 * units::pi)));
    };
    for (int i = 0; i < 5; ++i) {
        const double t = i * replication::reading_interval_s;
        EXPECT_EQ(counts[static_cast<std::size_t>(i)], counter(t + replication::reading_interval_s) - counter(t)) << i;
    }
}

TEST(Phase, QuartersAreCountedDownwards) {
    EXPECT_EQ(Phase(0.0).quarters(), 0);
    EXPECT_EQ(Phase(-0.1).quarters(), -1);
    EXPECT_EQ(Phase(1.6).quarters(), 1);
    EXPECT_EQ(Phase(100.0).quarters(), 63);
    EXPECT_EQ(Phase(-100.0).quarters(), -64);
}

// (16), (17): half a turn has the coefficient 1/2, not 1, and the signs belong to minima and maxima. What is left is of
// third order, kappa^2/16 = 0.0014 of it.
TEST(Replication, HalfTurnsHaveHalfThePrintedCoefficients) {
    for (const bool minimum : {true, false}) {
        for (const bool after : {true, false}) {
            const replication::HalfTurnFit fit = replication::fit_half_turn(minimum, after, 32);
            EXPECT_NEAR(fit.sine, 0.5, 0.002) << minimum << after;
            EXPECT_NEAR(fit.cosine, minimum ? 0.5 : -0.5, 0.002) << minimum << after;
            // Second order: the delay of docs/physics.md is counted from the dither's turn, this from the phase's;
            // between them the lock-in adds -b^2 sin^2(psi)/a, in the mean -b^2/(2 a).
            const gyro::Device device(paper_device());
            const double b = device.coupling.b_rad_s;
            const double a = device.half_cycle(1.0, device.dither_amplitude_rad).end_acceleration_rad_s2();
            const double delay = gyro::half_turn_delay_rad(paper_device()) - 0.5 * b * b / a;
            EXPECT_NEAR(fit.constant_rad, minimum == after ? -delay : delay, 0.01 * delay);
            // Fourth order is kappa^2 = 2 % of that and more.
            const double second = replication::half_turn_second_harmonic_rad(paper_device());
            EXPECT_NEAR(fit.second_cosine_rad, minimum == after ? second : -second, 0.05 * std::abs(second));
            EXPECT_NEAR(fit.second_sine_rad, 0.0, 0.05 * std::abs(second));
        }
    }
}

// (9), (10): the average goes with the sine of the mean phase. The depth of modulation is shorter by a delay, 0.5 %
// here.
TEST(Replication, TheAverageOverACycleGoesWithTheSine) {
    const replication::AveragedCycle average = replication::averaged_cycle(16);
    EXPECT_NEAR(average.plain_sine, 1.0, 1e-9);
    EXPECT_NEAR(average.plain_cosine, 0.0, 1e-9);
    EXPECT_NEAR(average.exact_sine, 1.0, 0.01);
    EXPECT_LT(std::abs(average.exact_cosine), 0.02);
}

// (12), (13): theta is no small thing.
TEST(Replication, TheMeanPhaseAdvancesBetweenTheTurns) {
    for (const double rate : {100.0, 200.0, 400.0}) {
        const gyro::Setup setup = replication::paper_device(rate);
        GyroPath path(gyro::Device(setup), 1e-10);
        double error = 0.0;
        double with_theta = 0.0;
        double without_theta = 0.0;
        for (int i = 0; i < 16; ++i) {
            path.restart(units::two_pi * i / 16);
            const double psi = replication::extremum_phase_rad(path, 2);
            const double exact = replication::exact_cycle(path, Span::minimum_and_maximum).lockin_deg_h;
            const auto square = [&](const gyro::Setup& with) {
                const double formula = replication::first_order_correction_deg_h(with, Span::minimum_and_maximum, psi);
                return (exact - formula) * (exact - formula);
            };
            error += exact * exact;
            with_theta += square(setup);
            without_theta += square(replication::paper_device(0.0));
        }
        // The kick of the first turn moves the phase of the second by up to kappa, which first order leaves out.
        EXPECT_LT(std::sqrt(with_theta / error), 0.08) << rate;
        EXPECT_GT(std::sqrt(without_theta / error), 0.5) << rate;
    }
}

// (15): the last pulse before a turn and the first after it are the same threshold, so that the turn lies half-way, but
// for what the lock-in moves it, at most b/a. These two times leave psi'' open; the next pulse on a side gives it.
TEST(Replication, TheTurnLiesHalfWayBetweenItsPulses) {
    Uniform uniform(15);
    for (int i = 0; i < 20; ++i) {
        gyro::Setup setup = replication::paper_device(uniform(0.0, 400.0));
        setup.initial_phase_rad = uniform(-3.0, 3.0);
        const gyro::Device device(setup);
        const TurnPath turn(device.half_cycle(-1.0, device.dither_amplitude_rad),
                            device.half_cycle(1.0, device.dither_amplitude_rad), device.coupling,
                            setup.initial_phase_rad);
        const double quarter = 0.5 * units::pi;
        const double psi = turn.zero_rate_phase_rad();
        const double near = quarter * (std::floor(psi / quarter) + 1.0) - psi;
        const auto before = turn.crossing_times_s(-1, {near, near + quarter});
        const auto after = turn.crossing_times_s(+1, {near, near + quarter});
        const double a = turn.acceleration_rad_s2(+1);
        EXPECT_LT(std::abs(0.5 * (before[0] + after[0]) - turn.zero_rate_time_s()), device.coupling.b_rad_s / a);
        // b/a is 6 % of the 16 us that a turn lasts: so much the lock-in bends the path.
        const double roots = std::sqrt(2.0 * (near + quarter)) - std::sqrt(2.0 * near);
        EXPECT_NEAR(roots / (after[1] - after[0]) / std::sqrt(a), 1.0, 0.07);
    }
}

TEST(Replication, ReadingsOf8MillisecondsComeInTheirSteps) {
    const double step = 0.25 * 0.5 / replication::reading_interval_s;
    EXPECT_NEAR(step, replication::reading_step_deg_h, 1e-12);
    // 8 ms after a minimum the dither is still 20.4 us short of the next: (a/2) t^2 are left, 8.0 deg/h.
    const gyro::Setup setup = replication::paper_device(100.0);
    const gyro::Device device(setup);
    GyroPath path(device, 1e-10);
    const int gyros = 400;
    double from_minimum = 0.0;
    double from_maximum = 0.0;
    for (int i = 0; i < gyros; ++i) {
        path.restart(units::two_pi * (i + 0.5) / gyros);
        for (const int turn : {0, 1}) {
            const auto counts = path.quarter_counts(path.turn_time_s(turn), replication::reading_interval_s, 1);
            const double error = static_cast<double>(counts[0]) * step - 100.0;
            EXPECT_LT(std::abs(error), 8.01 + 3.02 + step);
            (turn == 0 ? from_minimum : from_maximum) += error / gyros;
        }
    }
    // Even phases leave the mean of the counts and of the lock-in's kicks, which is of third order.
    EXPECT_NEAR(from_minimum, 8.01, 0.25);
    EXPECT_NEAR(from_maximum, -8.01, 0.25);
}

TEST(Replication, OneCycleIsCorrectedByThreeDegPerHourAtMost) {
    const double kick = replication::turn_kick_deg_h(replication::paper_device(0.0));
    EXPECT_NEAR(2.0 * kick, 3.016, 5e-4);
    EXPECT_NEAR(4.0 * kick, 6.031, 5e-4);
    EXPECT_NEAR(2.0 * kick, gyro::band_envelope_deg_h(replication::paper_device(0.0)), 1e-9);
    double largest = 0.0;
    for (const Span span : replication::spans) {
        for (int i = 0; i < 200; ++i) {
            const double bound =
                replication::largest_correction_deg_h(replication::paper_device(100.0), span, units::pi * i / 200);
            EXPECT_LE(bound, 2.0 * kick * (1.0 + 1e-12));
            largest = std::max(largest, bound);
        }
    }
    EXPECT_NEAR(largest, 2.0 * kick, 0.001);
    // The formula with true phases and accelerations stays within it at all orders: its terms are sines.
    GyroPath path(gyro::Device(replication::paper_device(100.0)), 1e-10);
    for (int i = 0; i < 20; ++i) {
        path.restart(units::two_pi * i / 20);
        for (const Span span : replication::spans) {
            EXPECT_LE(std::abs(replication::exact_cycle(path, span).corrected_deg_h), 2.0 * kick * 1.0001);
        }
    }
    EXPECT_EQ(std::count_if(replication::applied_deg_h.begin(), replication::applied_deg_h.end(),
                            [&](double each) { return std::abs(each) > 2.0 * kick; }),
              3);
    EXPECT_EQ(std::count_if(replication::applied_deg_h.begin(), replication::applied_deg_h.end(),
                            [&](double each) { return std::abs(each) > 4.0 * kick; }),
              0);
}

TEST(Replication, PrintedCoefficientsTurnTheErrorOfACycleRound) {
    for (const double rate : {15.0, 100.0, 300.0}) {
        GyroPath path(gyro::Device(replication::paper_device(rate)), 1e-10);
        double error = 0.0;
        double printed = 0.0;
        double corrected = 0.0;
        for (int i = 0; i < 64; ++i) {
            path.restart(units::two_pi * i / 64);
            const replication::Cycle cycle = replication::exact_cycle(path, Span::minimum_to_minimum);
            error += std::pow(cycle.lockin_deg_h, 2);
            printed += std::pow(cycle.lockin_deg_h - 2.0 * cycle.corrected_deg_h, 2);
            corrected += std::pow(cycle.lockin_deg_h - cycle.corrected_deg_h, 2);
        }
        EXPECT_NEAR(std::sqrt(printed / error), 1.0, 0.005) << rate;
        // The second harmonic of the reading, 0.017 kappa^2 cos(2 psi) at either end, beside an error of some kappa.
        EXPECT_LT(std::sqrt(corrected / error), 0.01) << rate;
    }
}

TEST(Replication, DensitiesAreThoseOfRandomPhases) {
    Uniform uniform(2);
    constexpr int draws = 400000;
    for (const auto turns : {CorrectionDensity::Turns::two_whole, CorrectionDensity::Turns::half_whole_half}) {
        const CorrectionDensity density(turns);
        EXPECT_NEAR(density.beyond(0.0), 1.0, 1e-12);
        int beyond[3] = {};
        const double levels[3] = {0.5, 1.0, 1.6};
        for (int i = 0; i < draws; ++i) {
            const auto kick = [&] { return std::sin(uniform(-units::pi, units::pi)); };
            const double u =
                turns == CorrectionDensity::Turns::two_whole ? kick() + kick() : 0.5 * kick() + kick() + 0.5 * kick();
            for (int k = 0; k < 3; ++k) beyond[k] += std::abs(u) > levels[k] ? 1 : 0;
        }
        for (int k = 0; k < 3; ++k) {
            const double p = density.beyond(levels[k]);
            // Four standard errors.
            EXPECT_NEAR(beyond[k] / static_cast<double>(draws), p, 4.0 * std::sqrt(p * (1.0 - p) / draws)) << k;
        }
    }
}

TEST(Replication, ThePapersCorrectionsAskForAFactorBeyondOneAndAllowTwo) {
    const double kick = replication::turn_kick_deg_h(replication::paper_device(0.0));
    for (const auto turns : {CorrectionDensity::Turns::two_whole, CorrectionDensity::Turns::half_whole_half}) {
        const CorrectionDensity density(turns);
        EXPECT_FALSE(std::isfinite(replication::log_likelihood(density, replication::applied_deg_h, 1.0, kick)));
        EXPECT_TRUE(std::isfinite(replication::log_likelihood(density, replication::applied_deg_h, 2.0, kick)));
        // Small errors of the corrections change nothing for what is possible.
        EXPECT_NEAR(replication::log_likelihood(density, replication::applied_deg_h, 2.0, kick, 0.05),
                    replication::log_likelihood(density, replication::applied_deg_h, 2.0, kick), 0.1);
        const replication::FactorEstimate factor =
            replication::estimate_factor(density, replication::applied_deg_h, kick);
        EXPECT_NEAR(factor.smallest, 4.80 / (2.0 * kick), 1e-12);
        EXPECT_GT(factor.upper_95, 2.0);
        EXPECT_LT(factor.smallest, 2.0);
    }
}

// The limits of that: with the rates that the table most likely has, one noise-free cycle of the device as published
// cannot give the corrections with either coefficients.
TEST(Replication, AtThePublishedDeviceNeitherCoefficientsGiveTheCorrections) {
    const double rates[] = {100.0, 200.0, 300.0, 400.0};
    for (const Span span : replication::spans) {
        for (const double factor : {1.0, 2.0}) {
            bool all = true;
            for (std::size_t i = 0; i < 4; ++i) {
                const double bound =
                    factor * replication::largest_correction_deg_h(replication::paper_device(rates[i]), span);
                all = all && std::abs(replication::applied_deg_h[i + 2]) <= bound;
            }
            EXPECT_FALSE(all);
        }
    }
}

}  // namespace
}  // namespace replication_test
}  // namespace ringlock::test
