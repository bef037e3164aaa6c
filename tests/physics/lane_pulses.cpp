// Times of the quarter-fringe pulses near a turn, and accelerations from them: tables and readout of blocks against the
// scalar path.
#include <algorithm>
#include <cstdio>
#include <vector>

#include "engine/readout/lane_readout.hpp"
#include "tests/physics/readout_support.hpp"

namespace ringlock::test {
namespace lane_pulses_test {
namespace {

using simd::lanes;

/// Distance [rad] from the extremum to the first comparator's quarter fringe.
double first_distance_rad(int direction, double psi_rad) {
    const double upright = direction * psi_rad / quarter_rad;
    return (std::floor(upright) + 1.0 - upright) * quarter_rad;
}

/// Worst difference [s] of times to pulses, from the extremum on: tables of the device's own against the path.
double worst_pulse_s(double threshold_deg_h, double rate_deg_h, double amplitude_off, double rate_off_deg_h,
                     Beyond beyond, double asymmetry, std::uint64_t seed) {
    Uniform uniform(seed);
    double worst = 0.0;
    for (int i = 0; i < 120; ++i) {
        Turn turn = random_turn(uniform, rate_deg_h, beyond);
        turn.setup.dither_asymmetry_ratio = asymmetry;
        turn.setup.lockin_threshold_deg_h = threshold_deg_h;
        turn.before_ratio = 1.0 + amplitude_off;
        turn.after_ratio = 1.0 + amplitude_off;
        turn.rate_off_deg_h = rate_off_deg_h;
        const int direction = i % 2 == 0 ? 1 : -1;
        readout::PulseTables tables;
        tables.make(0, turn.device(), 2);
        const TurnPath path = turn.path(direction);
        const double psi = path.zero_rate_phase_rad();
        const double d1 = first_distance_rad(direction, psi);
        const double floor = std::floor(direction * psi / quarter_rad);
        const auto quarter = static_cast<std::size_t>(floor - 4.0 * std::floor(0.25 * floor));
        for (const int side : {-1, 1}) {
            const auto times = path.crossing_times_s(side, {d1, d1 + quarter_rad});
            const gyro::HalfCycle half = turn.half(side * direction, side < 0 ? turn.before_ratio : turn.after_ratio);
            const double a = half.end_acceleration_rad_s2(side > 0 ? 0 : 1);
            for (const std::size_t pulse : {0U, 1U}) {
                const double d = d1 + static_cast<double>(pulse) * quarter_rad;
                const auto& table = tables.times[direction > 0 ? 0 : 1][side < 0 ? 0 : 1][pulse];
                const double w = half.angular_frequency_rad_s();
                const double factor = readout::PulseTables::sinusoid_factor(d * w * w / a) +
                                      readout::PulseTables::at(table, 0, quarter, d1);
                const double t = std::sqrt(2.0 * d / a) * factor;
                worst = std::max(worst, std::abs(t - std::abs(times[pulse] - path.zero_rate_time_s())));
            }
        }
    }
    std::printf("threshold %4.0f, rate %6.0f deg/h, amplitudes off by %g, rate by %g deg/h, asymmetry %g: %.2g s\n",
                threshold_deg_h, rate_deg_h, amplitude_off, rate_off_deg_h, asymmetry, worst);
    return worst;
}

// A tick of the fastest clock that anyone would use is 1e-9 s; a tenth of that is nothing to any reading. A second
// harmonic of half the coupling bends the path by sin 2 x, for which ten terms are fewer.
TEST(PulseTables, AreRightForTheDevicesOwnDrive) {
    for (const double threshold_deg_h : {30.0, 300.0, 600.0, 1000.0, 2000.0}) {
        for (const Beyond beyond : {Beyond::nothing, Beyond::harmonic_and_asymmetry, Beyond::second_coupling}) {
            EXPECT_LT(worst_pulse_s(threshold_deg_h, 100.0, 0.0, 0.0, beyond, 0.0, 502),
                      beyond == Beyond::second_coupling ? 5e-10 : 1e-11);
        }
    }
}

TEST(PulseTables, WithAnAsymmetryAreOffByItsShareOfTheTimeBetweenTheTurns) {
    const gyro::Device device(paper_device());
    const double a = device.half_cycle(1.0, device.dither_amplitude_rad).end_acceleration_rad_s2();
    for (const double asymmetry : {0.001, 0.01, 0.05}) {
        const double share = std::pow((1.0 + asymmetry) / (1.0 - asymmetry), 2) - 1.0;
        for (const double rate_deg_h : {0.0, 5000.0}) {
            const double between_s = (device.phase_per_arcsec * rate_deg_h + device.coupling.b_rad_s) / a;
            const double worst = worst_pulse_s(300.0, rate_deg_h, 0.0, 0.0, Beyond::nothing, asymmetry, 503);
            EXPECT_LT(worst, 1.1 * share * between_s);
            EXPECT_GT(worst, 0.5 * share * between_s);  // the statement is worth making
        }
    }
}

TEST(PulseTables, HoldAtFastInputs) {
    for (const double rate_deg_h : {0.0, 5000.0, 50000.0}) {
        EXPECT_LT(worst_pulse_s(300.0, rate_deg_h, 0.0, 0.0, Beyond::nothing, 0.0, 503), 1e-11);
    }
}

TEST(PulseTables, CostLittleWhereTheDriveIsNotTheDevicesOwn) {
    // Amplitudes 1e-3 from the device's are twice what injected noise does. Only the lock-in's part of R, some
    // b/sqrt(a) of it, moves with the amplitude other than as sqrt(a): b/sqrt(a) t 1e-3/2, with t = 4e-5 s.
    for (const double threshold_deg_h : {30.0, 300.0, 2000.0}) {
        const double scale = threshold_deg_h / 300.0 * 3770.0 / std::sqrt(3.867e9);
        EXPECT_LT(worst_pulse_s(threshold_deg_h, 15.0, 1e-3, 0.0, Beyond::nothing, 0.0, 504), 0.5e-3 * scale * 4e-5);
        // A rate moves the standstill by its phase rate over the acceleration, and with it the drive's acceleration
        // at the extremum, of which it is w times the offset squared: nothing to first order but the drive's curvature.
        EXPECT_LT(worst_pulse_s(threshold_deg_h, 15.0, 0.0, 100.0, Beyond::nothing, 0.0, 505), 1e-10);
    }
}

/// Acceleration as the electronics find it: two pulses and the distances that they believe in.
double acceleration_of(double near_rad, double far_rad, double interval_s) {
    if (!(interval_s > 0.0)) return 0.0;
    const double root = (std::sqrt(2.0 * far_rad) - std::sqrt(2.0 * std::max(near_rad, 0.0))) / interval_s;
    return root * root;
}

/// Worst relative difference of accelerations from pulses: the readout's against the formula on the path's crossings.
double worst_acceleration(double rate_deg_h, double asymmetry, double threshold_deg_h, Beyond beyond,
                          std::uint64_t seed) {
    Uniform uniform(seed);
    double worst = 0.0;
    for (int block = 0; block < 20; ++block) {
        std::vector<Turn> turns;
        for (std::size_t i = 0; i < lanes; ++i) {
            turns.push_back(random_turn(uniform, rate_deg_h, beyond));
            turns.back().before_ratio = turns.back().after_ratio = 1.0;
            turns.back().setup.dither_asymmetry_ratio = asymmetry;
            turns.back().setup.lockin_threshold_deg_h = threshold_deg_h;
        }
        const int direction = block % 2 == 0 ? 1 : -1;
        const Read got = read(turns, block, perfect_instrument);
        for (std::size_t i = 0; i < lanes; ++i) {
            const TurnPath path = turns[i].path(direction);
            const double d = first_distance_rad(direction, path.zero_rate_phase_rad());
            for (const int side : {-1, 1}) {
                const auto times = path.crossing_times_s(side, {d, d + quarter_rad});
                const double a = acceleration_of(d, d + quarter_rad, std::abs(times[1] - times[0]));
                worst = std::max(worst, std::abs(got.accel(i, side) / a - 1.0));
            }
        }
    }
    std::printf("%5.0f deg/h, asymmetry %5.3f, threshold %4.0f: acceleration from pulses off by %.2g\n", rate_deg_h,
                asymmetry, threshold_deg_h, worst);
    return worst;
}

TEST(LongLaneReadout, AccelerationsAreThoseOfThePathsPulses) {
    // Twice the error of the times over an interval of 12 us at least.
    for (const double threshold_deg_h : {30.0, 2000.0}) {
        for (const double rate_deg_h : {100.0, 5000.0}) {
            EXPECT_LT(worst_acceleration(rate_deg_h, 0.0, threshold_deg_h, Beyond::nothing, 506), 2e-6);
            EXPECT_LT(worst_acceleration(rate_deg_h, 0.0, threshold_deg_h, Beyond::harmonic_and_asymmetry, 506), 2e-6);
            EXPECT_LT(worst_acceleration(rate_deg_h, 0.0, threshold_deg_h, Beyond::second_coupling, 506), 5e-5);
        }
    }
    // An asymmetry costs little while the turns of phase and dither are close: of the studies' 0.001, 5e-5 at rest.
    EXPECT_LT(worst_acceleration(0.0, 0.001, 300.0, Beyond::nothing, 506), 1e-4);
    EXPECT_LT(worst_acceleration(100.0, 0.001, 300.0, Beyond::nothing, 506), 5e-4);
    EXPECT_LT(worst_acceleration(5000.0, 0.001, 300.0, Beyond::nothing, 506), 5e-3);
}

TEST(LaneReadout, AccelerationsKnowWholeTicksOnly) {
    Uniform uniform(507);
    constexpr double clock_hz = 1e7;
    readout::Electronics electronics = perfect_instrument;
    electronics.clock_hz = clock_hz;
    int compared = 0;
    int moved = 0;
    for (const std::int64_t number : {0LL, 1LL, 123456LL, 7654321LL}) {
        std::vector<Turn> turns;
        for (std::size_t i = 0; i < lanes; ++i) {
            turns.push_back(random_turn(uniform, uniform(-100.0, 100.0), Beyond::nothing));
            turns.back().setup.dither_asymmetry_ratio = 0.0;
            turns.back().before_ratio = turns.back().after_ratio = 1.0;
        }
        const int direction = number % 2 == 0 ? 1 : -1;
        const Read got = read(turns, number, electronics);
        for (std::size_t i = 0; i < lanes; ++i) {
            const TurnPath path = turns[i].path(direction);
            const gyro::Device device = turns[i].device();
            const long double turn_s =
                static_cast<long double>(number / 2) * (device.positive_duration_s + device.negative_duration_s) +
                (number % 2 != 0 ? device.positive_duration_s : 0.0);
            const double d = first_distance_rad(direction, path.zero_rate_phase_rad());
            for (const int side : {-1, 1}) {
                const auto times = path.crossing_times_s(side, {d, d + quarter_rad});
                long double ticks[2];
                bool close = false;  // to the edge of a tick, where 1e-10 s decide, or the digits of the time of day
                for (const std::size_t k : {0U, 1U}) {
                    const long double t = (turn_s + times[k]) * static_cast<long double>(clock_hz);
                    ticks[k] = std::floor(t);
                    const long double inside = t - ticks[k];
                    close = close || inside < 2e-3L || inside > 1.0L - 2e-3L;
                }
                if (close) continue;
                ++compared;
                const auto whole = static_cast<double>(ticks[1] - ticks[0]);
                const double a = acceleration_of(d, d + quarter_rad, std::abs(whole) / clock_hz);
                EXPECT_NEAR(got.accel(i, side) / a, 1.0, 1e-8);
                const double smooth = acceleration_of(d, d + quarter_rad, std::abs(times[1] - times[0]));
                moved += std::abs(a / smooth - 1.0) > 1e-3 ? 1 : 0;
            }
        }
    }
    EXPECT_GT(compared, 110);  // of 128; four edges in a thousand each
    EXPECT_GT(moved, 60);      // the ticks matter
}

}  // namespace
}  // namespace lane_pulses_test
}  // namespace ringlock::test
