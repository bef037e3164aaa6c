// What the readout of blocks makes of the phase: against the scalar path near a turn, and against what its electronics
// are said to do.
#include "engine/readout/lane_readout.hpp"

#include <algorithm>
#include <bit>
#include <cstdio>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/propagate/rotation.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/turn_path.hpp"

namespace ringlock::test {
namespace {

using simd::lanes;

constexpr double quarter_rad = 0.5 * units::pi;

/// One turn of one gyro.
struct Turn {
    gyro::Setup setup;
    double before_ratio = 1.0;  ///< amplitudes over the device's
    double after_ratio = 1.0;
    double rate_off_deg_h = 0.0;  ///< of both half cycles from the device's
    double phase_rad = 0.0;       ///< psi at the dither's turn

    gyro::Device device() const { return gyro::Device(setup); }
    gyro::HalfCycle half(int sign, double ratio) const {
        const gyro::Device d = device();
        gyro::HalfCycle half = d.half_cycle(sign, ratio * d.dither_amplitude_rad);
        half.rate_rad_s += d.phase_per_arcsec * rate_off_deg_h;
        return half;
    }
    TurnPath path(int direction) const {
        return TurnPath(half(-direction, before_ratio), half(direction, after_ratio), device().coupling, phase_rad);
    }
};

/// What is read of one turn of up to 16 gyros.
struct Read {
    readout::LaneReadings readings;
    readout::LaneAngles angles;

    double phase_rad(std::size_t lane) const { return units::two_pi * readings.phase_fringes[0][lane]; }
    double lockin_rad(std::size_t lane) const { return units::two_pi * angles.lockin_fringes[0][lane]; }
    double accel(std::size_t lane, int side) const {
        return (side < 0 ? readings.accel_before_rad_s2 : readings.accel_after_rad_s2)[0][lane];
    }
};

/// Drive and turns of the propagator with a single row, turn number `number`.
struct Row {
    gyro::LaneDrive drive;
    gyro::LaneTurns turns;

    Row(const std::vector<Turn>& which, std::int64_t number) {
        drive.first_turn = number;
        drive.resize(1);
        turns.resize(1);
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const Turn& turn = which[std::min(lane, which.size() - 1)];
            const gyro::Device device = turn.device();
            const int direction = drive.direction(0);
            const gyro::HalfCycle half[2] = {turn.half(-direction, turn.before_ratio),
                                             turn.half(direction, turn.after_ratio)};
            for (const std::size_t i : {0U, 1U}) {
                drive.amplitude_rad[i][lane] = half[i].amplitude_rad;
                drive.rate_rad_s[i][lane] = half[i].rate_rad_s;
                drive.b_rad_s[i][lane] = device.coupling.b_rad_s;
            }
            drive.plain_fringes[0][lane] = turn.phase_rad / units::two_pi;
            turns.sine[0][lane] = std::sin(turn.phase_rad + device.coupling.phase_rad);
            turns.cosine[0][lane] = std::cos(turn.phase_rad + device.coupling.phase_rad);
        }
    }
};

Read read(const std::vector<Turn>& which, std::int64_t number, const readout::Electronics& electronics,
          const std::vector<simd::Lanes>& noise = {}) {
    std::vector<gyro::Device> devices;
    std::vector<gyro::Ellipse> ellipses;
    for (const Turn& turn : which) {
        devices.push_back(turn.device());
        ellipses.push_back(turn.setup.ellipse);
    }
    const readout::LaneReadout readout(devices, ellipses, electronics, true);
    const Row row(which, number);
    Read result;
    readout.read(row.drive, row.turns, noise, 1, result.readings, result.angles);
    return result;
}

constexpr readout::Electronics ideal{true, true, 0.0, 0.0};
constexpr readout::Electronics perfect_instrument{false, true, 0.0, 0.0};

enum class Beyond { nothing, harmonic_and_asymmetry, second_coupling };

Turn random_turn(Uniform& uniform, double rate_deg_h, Beyond beyond) {
    Turn turn;
    turn.setup = paper_device();
    turn.setup.input_rate_deg_h = rate_deg_h;
    turn.setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
    turn.setup.coupling_phase_rad = uniform(-3.0, 3.0);
    if (beyond == Beyond::harmonic_and_asymmetry) {
        turn.setup.dither_harmonic_ratio = uniform(-0.05, 0.05);
        turn.setup.dither_harmonic_phase_rad = uniform(-3.1, 3.1);
        turn.setup.lockin_turn_asymmetry = uniform(-0.3, 0.3);
    }
    if (beyond == Beyond::second_coupling) {
        turn.setup.lockin_second_ratio = uniform(-0.5, 0.5);
        turn.setup.lockin_second_phase_rad = uniform(-3.1, 3.1);
    }
    turn.before_ratio = uniform(0.97, 1.03);
    turn.after_ratio = uniform(0.97, 1.03);
    turn.phase_rad = uniform(-3.1, 3.1);
    return turn;
}

struct Worst {
    double phase_rad = 0.0;
    double lockin_rad = 0.0;
    double accel_ratio = 0.0;
};

Worst worst_against_path(double rate_deg_h, Beyond beyond, double threshold_deg_h, std::uint64_t seed) {
    Uniform uniform(seed);
    Worst worst;
    for (int block = 0; block < 20; ++block) {
        std::vector<Turn> turns;
        for (std::size_t i = 0; i < lanes; ++i) {
            turns.push_back(random_turn(uniform, (i % 2 == 0 ? 1.0 : -1.0) * rate_deg_h, beyond));
            turns.back().setup.lockin_threshold_deg_h = threshold_deg_h;
        }
        const int direction = block % 2 == 0 ? 1 : -1;
        const Read got = read(turns, block, ideal);
        for (std::size_t i = 0; i < lanes; ++i) {
            const TurnPath path = turns[i].path(direction);
            const double moved = path.zero_rate_phase_rad() - turns[i].phase_rad;
            worst.phase_rad = std::max(worst.phase_rad, std::abs(got.phase_rad(i) - path.zero_rate_phase_rad()));
            worst.lockin_rad =
                std::max(worst.lockin_rad, std::abs(got.lockin_rad(i) - (moved - path.plain_gain_rad())));
            for (const int side : {-1, 1}) {
                worst.accel_ratio =
                    std::max(worst.accel_ratio, std::abs(got.accel(i, side) / path.acceleration_rad_s2(side) - 1.0));
            }
        }
    }
    std::printf("%8.0f deg/h, threshold %4.0f: phase %.2g, lock-in's share %.2g rad, acceleration %.2g\n", rate_deg_h,
                threshold_deg_h, worst.phase_rad, worst.lockin_rad, worst.accel_ratio);
    return worst;
}

/// The series' last terms are in proportion to b; their derivatives are those of sin x, or of sin 2 x with a second
/// harmonic of the coupling, ten times in what they leave. At the highest threshold two Newton steps leave more than
/// the series in the lock-in's share, which is not stationary at the zero-rate point.
double path_tolerance_rad(Beyond beyond, double threshold_deg_h) {
    const double strength = std::max(threshold_deg_h, 30.0) / 300.0;
    const double first = 1e-10 * std::max(strength, 0.1) * (strength > 1.0 ? 10.0 : 1.0);
    return beyond == Beyond::second_coupling ? 15.0 * first : first;
}

void expect_agreement(Beyond beyond) {
    for (const double threshold_deg_h : {30.0, 300.0, 2000.0}) {
        for (const double rate_deg_h : {0.0, 100.0, 5000.0, 50000.0}) {
            const Worst worst = worst_against_path(rate_deg_h, beyond, threshold_deg_h, 501);
            const double tolerance_rad = path_tolerance_rad(beyond, threshold_deg_h);
            EXPECT_LT(worst.phase_rad, tolerance_rad);
            EXPECT_LT(worst.lockin_rad, tolerance_rad);
            EXPECT_LT(worst.accel_ratio, 1e-9);
        }
    }
}

TEST(LaneReadout, FindsTheZeroRatePoint) { expect_agreement(Beyond::nothing); }

TEST(LaneReadout, FindsItWithADithersHarmonicAndUnlikeTurns) { expect_agreement(Beyond::harmonic_and_asymmetry); }

TEST(LaneReadout, FindsItWithASecondHarmonicOfTheCoupling) { expect_agreement(Beyond::second_coupling); }

TEST(LaneReadout, RefusesATurnWithoutReversal) {
    std::vector<Turn> turns(3);
    for (Turn& turn : turns) turn.setup = paper_device();
    EXPECT_NO_THROW(read(turns, 0, ideal));
    // Twice the dither's peak rate, in one lane only.
    turns[1].setup.input_rate_deg_h = -2.0 * 109.1 * 3600.0;
    for (const std::int64_t number : {0, 1}) EXPECT_THROW(read(turns, number, ideal), RunError);
}

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
        tables.make(0, turn.device());
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
                const double t = std::sqrt(2.0 * d / a) * readout::PulseTables::at(table, 0, quarter, d1);
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

TEST(LaneReadout, AccelerationsAreThoseOfThePathsPulses) {
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

TEST(LaneReadout, CountAndNoisyQuadratureAreJoinedSafelyAtQuarterBoundaries) {
    // Close to a boundary noise puts the quadrature into the neighbouring quarter; the phase must not jump.
    constexpr double rms = 0.01;
    readout::Electronics electronics = perfect_instrument;
    electronics.detector_noise_relative = rms;
    for (const int number : {0, 1}) {
        for (const int count : {-9, -5, -4, -2, -1, 0, 1, 2, 3, 4, 7, 1003}) {
            for (const double within : {1e-9, 1e-4, 0.7, 1.5707, quarter_rad - 1e-9}) {
                const std::vector<double> noises{-0.5, -0.02, -1e-6, 0.0, 1e-6, 0.02, 0.5};
                const double psi = quarter_rad * count + within;
                std::vector<Turn> turns(noises.size());
                std::vector<simd::Lanes> deviates(2);
                for (std::size_t i = 0; i < noises.size(); ++i) {
                    turns[i].setup = paper_device();
                    turns[i].setup.lockin_threshold_deg_h = 0.0;
                    turns[i].phase_rad = psi;
                    deviates[0][i] = (std::sin(psi + noises[i]) - std::sin(psi)) / rms;
                    deviates[1][i] = (std::cos(psi + noises[i]) - std::cos(psi)) / rms;
                }
                const Read got = read(turns, number, electronics, deviates);
                for (std::size_t i = 0; i < noises.size(); ++i) {
                    EXPECT_NEAR(got.phase_rad(i), psi + noises[i], 1e-12 * (1.0 + std::abs(psi)))
                        << count << " " << within << " " << noises[i];
                }
            }
        }
    }
}

// ---- Whole runs.

scenario::Scenario quiet() {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.ensemble.seed = 508;
    scenario.readout.detector_noise_relative = 0.0;
    scenario.readout.clock_hz = 0.0;
    scenario.noise_injection.turn_phase_rms_rad = 3.0;
    return scenario;
}

/// Rows of one arm of a run, kept whole: [turn][gyro].
struct Record {
    std::vector<simd::Lanes> sine, cosine, phase_fringes, phase_whole, angle_fringes, before, after;
    std::vector<simd::Lanes> lockin_rad;
    std::vector<gyro::Setup> setups;
};

Record go(const scenario::Scenario& scenario, const std::string& arm, std::size_t turns, std::int64_t first = 0,
          std::size_t gyros = lanes, const std::vector<std::size_t>& pieces = {128},
          const std::vector<gyro::Setup>& setups = {}) {
    const std::vector<scenario::Arm> arms{scenario::parse_arm(arm)};
    auto block = setups.empty() ? ensemble::GyroBlock(scenario, arms, first, gyros)
                                : ensemble::GyroBlock(scenario, arms, first, setups);
    Record run;
    run.setups = block.setups();
    std::size_t done = 0;
    for (std::size_t piece = 0; done < turns; ++piece) {
        const std::size_t count = std::min(pieces[piece % pieces.size()], turns - done);
        block.advance(count);
        const auto& r = block.readings(0);
        const auto& a = block.angles(0);
        const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
        append(run.sine, r.sine);
        append(run.cosine, r.cosine);
        append(run.phase_fringes, r.phase_fringes);
        append(run.phase_whole, r.phase_whole);
        append(run.angle_fringes, a.angle_fringes);
        append(run.before, r.accel_before_rad_s2);
        append(run.after, r.accel_after_rad_s2);
        for (std::size_t i = 0; i < count; ++i) {
            run.lockin_rad.emplace_back();
            for (std::size_t g = 0; g < gyros; ++g) run.lockin_rad.back()[g] = block.lockin_error_rad(0, i, g);
        }
        done += count;
    }
    return run;
}

TEST(LaneElectronics, NoiseHasItsSizeAndIsIndependent) {
    auto scenario = quiet();
    constexpr std::size_t turns = 4096;
    const Record clean = go(scenario, "noise_injected+compensated", turns);
    scenario.readout.detector_noise_relative = 0.01;
    const Record noisy = go(scenario, "noise_injected+compensated", turns);
    double ss = 0.0, cc = 0.0, sc = 0.0, s_next = 0.0, c_next = 0.0, s_gyro = 0.0, mean = 0.0;
    const auto sine = [&](std::size_t i, std::size_t g) { return (noisy.sine[i][g] - clean.sine[i][g]) / 0.01; };
    const auto cosine = [&](std::size_t i, std::size_t g) { return (noisy.cosine[i][g] - clean.cosine[i][g]) / 0.01; };
    const double n = static_cast<double>(turns) * lanes;
    for (std::size_t i = 0; i < turns; ++i) {
        for (std::size_t g = 0; g < lanes; ++g) {
            ss += sine(i, g) * sine(i, g) / n;
            cc += cosine(i, g) * cosine(i, g) / n;
            sc += sine(i, g) * cosine(i, g) / n;
            mean += (sine(i, g) + cosine(i, g)) / n;
            s_gyro += sine(i, g) * sine(i, (g + 1) % lanes) / n;
            if (i > 0) s_next += sine(i, g) * sine(i - 1, g) / n;
            if (i > 0) c_next += cosine(i, g) * sine(i - 1, g) / n;
        }
    }
    // Four standard errors each.
    EXPECT_NEAR(std::sqrt(ss), 1.0, 4.0 / std::sqrt(2.0 * n));
    EXPECT_NEAR(std::sqrt(cc), 1.0, 4.0 / std::sqrt(2.0 * n));
    EXPECT_NEAR(mean, 0.0, 4.0 * std::sqrt(2.0 / n));
    for (const double correlation : {sc, s_gyro, s_next, c_next}) EXPECT_NEAR(correlation, 0.0, 4.0 / std::sqrt(n));
}

TEST(LaneElectronics, ReadAnEllipse) {
    auto scenario = quiet();
    scenario.ensemble.initial_phase_spread_rad = 6.0;
    std::vector<gyro::Setup> setups;
    Uniform uniform(509);
    for (std::size_t g = 0; g < lanes; ++g) {
        setups.push_back(paper_device());
        setups.back().coupling_phase_rad = uniform(-3.0, 3.0);
        setups.back().ellipse = {uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.2, 0.2)};
    }
    const Record read = go(scenario, "noise_injected+compensated", 300, 0, lanes, {128}, setups);
    scenario.readout.model = scenario::ReadoutModel::ideal;
    const Record truth = go(scenario, "noise_injected+compensated", 300, 0, lanes, {128}, setups);
    for (std::size_t i = 0; i < truth.sine.size(); ++i) {
        for (std::size_t g = 0; g < lanes; ++g) {
            const gyro::Ellipse& e = setups[g].ellipse;
            const double psi = units::two_pi * truth.phase_fringes[i][g];
            // Rounding of a few fringes times 2 pi.
            EXPECT_NEAR(truth.sine[i][g], std::sin(psi), 1e-13);
            EXPECT_NEAR(truth.cosine[i][g], std::cos(psi), 1e-13);
            EXPECT_NEAR(read.sine[i][g], (1.0 + e.gain) * std::sin(psi) + e.offset_sin, 2e-13);
            EXPECT_NEAR(read.cosine[i][g], std::cos(psi + e.orthogonality_rad) + e.offset_cos, 2e-13);
            // The phase read is the quadrature's.
            const double error = units::two_pi * (read.phase_fringes[i][g] - truth.phase_fringes[i][g]);
            const double quadrature = std::atan2(read.sine[i][g], read.cosine[i][g]);
            EXPECT_NEAR(std::remainder(psi + error - quadrature, units::two_pi), 0.0, 2e-13);
            EXPECT_LT(std::abs(error), 0.5);
        }
    }
}

TEST(LaneElectronics, QuarterFringeCounterHasTheQuantisationOfItsStep) {
    // Q = (K/4)/sqrt(12) where phases are uniform, as injected noise of 3 rad makes them.
    auto scenario = quiet();
    const Record fine = go(scenario, "noise_injected", 4000);
    scenario.readout.angle_output = scenario::AngleOutput::quarter_fringe;
    const Record coarse = go(scenario, "noise_injected", 4000);
    double sum = 0.0;
    double n = 0.0;
    for (std::size_t i = 0; i < 4000; i += 2) {
        for (std::size_t g = 0; g < lanes; ++g) {
            const double error = coarse.angle_fringes[i][g] - fine.angle_fringes[i][g];
            EXPECT_LE(std::abs(error), 0.125 + 1e-12);
            // The middle of a quarter fringe of the phase.
            const double quarters = 4.0 * (fine.phase_fringes[i][g] + error) - 0.5;
            EXPECT_NEAR(quarters, std::nearbyint(quarters), 1e-12);
            sum += error * error;
            n += 1.0;
        }
    }
    const double q_arcsec = std::sqrt(sum / n) * 0.5;
    // The square of a uniform deviate has a relative standard deviation of sqrt(4/5), its root half of that: 4 standard
    // errors of independent turns.
    EXPECT_NEAR(q_arcsec / (0.125 / std::sqrt(12.0)), 1.0, 4.0 * 0.5 * std::sqrt(0.8 / n));
}

TEST(LaneElectronics, TheUnwrappedPhaseIsTrueOverALongRun) {
    // Plain bookkeeping of one gyro: phases at the dither's turns from half cycles solved one by one, those at the
    // zero-rate points from the path.
    constexpr std::int64_t turns = 20001;
    for (const double rate_deg_h : {-20.0, 3000.0}) {
        auto scenario = quiet();
        scenario.readout.detector_noise_relative = 0.01;
        gyro::Setup setup = paper_device();
        setup.input_rate_deg_h = rate_deg_h;
        setup.initial_phase_rad = 1.1;
        setup.dither_asymmetry_ratio = 0.003;
        const Record run = go(scenario, "noise_injected+compensated", turns, 3, 1, {128}, {setup});
        const gyro::Device device(setup);
        const random::Identity who{scenario.ensemble.seed, 3};
        const auto deviate = [&](std::int64_t turn) {
            return 3.0 * random::normal(who, random::Purpose::noise_injection, static_cast<std::uint64_t>(turn));
        };
        // Table errors of 1e-10 rad a turn; the map keeps no memory of old ones under injected noise.
        Phase lockin;
        double worst_phase = 0.0;
        double squares = 0.0;
        double noise = deviate(0);
        gyro::HalfCycle before = device.half_cycle(-1.0, device.dither_amplitude_rad - 0.5 * noise);
        Phase plain(device.initial_phase_rad + noise);
        for (std::int64_t turn = 0; turn < turns; ++turn) {
            const auto i = static_cast<std::size_t>(turn);
            const double sign = turn % 2 == 0 ? 1.0 : -1.0;
            const double next = deviate(turn + 1);
            const gyro::HalfCycle after =
                device.half_cycle(sign, device.dither_amplitude_rad + 0.5 * sign * (next - noise));
            Phase psi = plain;
            psi.fringes += lockin.fringes;
            psi.add(lockin.remainder_rad);
            const TurnPath path(before, after, device.coupling, psi.remainder_rad);
            const double whole = run.phase_whole[i][0] - static_cast<double>(psi.fringes);
            const double error = units::two_pi * (whole + run.phase_fringes[i][0]) - path.zero_rate_phase_rad();
            worst_phase = std::max(worst_phase, std::abs(error));
            squares += error * error;
            lockin.add(propagate::exact_half_cycle(after, device.coupling).gain_rad(psi.remainder_rad));
            plain.add(after.plain_phase_total_rad());
            noise = next;
            before = after;
        }
        std::printf("%.0f deg/h: rotation %.0f, lock-in %.2f fringes; worst of %d phases off by %.3g rad\n", rate_deg_h,
                    rate_deg_h / 0.5 * turns * 0.5 * device.period_s(), lockin.value_rad() / units::two_pi,
                    static_cast<int>(turns), worst_phase);
        // Two detectors of the same noise: the phase has it, too. One in 2e4 deviates is beyond 4; none beyond 6.
        EXPECT_LT(worst_phase, 6.0 * 0.01);
        EXPECT_NEAR(std::sqrt(squares / turns), 0.01, 4.0 * 0.01 / std::sqrt(2.0 * turns));
    }
}

TEST(LaneElectronics, IdealOnesReproduceThePhase) {
    auto scenario = quiet();
    const Record instrument = go(scenario, "noise_injected+compensated", 1000);
    scenario.readout.model = scenario::ReadoutModel::ideal;
    scenario.readout.detector_noise_relative = 0.3;  // not for them
    const Record run = go(scenario, "noise_injected+compensated", 1000);
    for (std::size_t i = 0; i < run.sine.size(); ++i) {
        for (std::size_t g = 0; g < lanes; ++g) {
            const double psi = units::two_pi * run.phase_fringes[i][g];
            EXPECT_NEAR(std::remainder(psi - std::atan2(run.sine[i][g], run.cosine[i][g]), units::two_pi), 0.0, 1e-13);
            // So does an instrument without noise and ellipse.
            EXPECT_NEAR(instrument.phase_fringes[i][g], run.phase_fringes[i][g], 1e-14);
        }
    }
}

std::uint64_t bits(double x) { return std::bit_cast<std::uint64_t>(x); }

TEST(LaneElectronics, ATurnsReadingDoesNotDependOnWhichOthersAreRead) {
    auto scenario = quiet();
    scenario.readout.detector_noise_relative = 0.01;
    const Record all = go(scenario, "noise_injected+compensated", 600);
    const Record minima = go(scenario, "noise_injected", 600);
    for (std::size_t i = 0; i < 600; i += 2) {
        for (std::size_t g = 0; g < lanes; ++g) {
            ASSERT_EQ(bits(minima.sine[i][g]), bits(all.sine[i][g])) << i;
            ASSERT_EQ(bits(minima.cosine[i][g]), bits(all.cosine[i][g])) << i;
            ASSERT_EQ(bits(minima.phase_fringes[i][g]), bits(all.phase_fringes[i][g])) << i;
            ASSERT_EQ(bits(minima.angle_fringes[i][g]), bits(all.angle_fringes[i][g])) << i;
        }
    }
}

TEST(LaneElectronics, LanesAndPiecesDoNotMatter) {
    auto scenario = quiet();
    scenario.readout.detector_noise_relative = 0.01;
    scenario.readout.clock_hz = 1e8;
    const Record whole = go(scenario, "noise_injected+compensated", 600);
    const Record alone = go(scenario, "noise_injected+compensated", 600, 5, 1);
    const Record pieces = go(scenario, "noise_injected+compensated", 600, 0, lanes, {2, 100, 6, 34});
    for (std::size_t i = 0; i < 600; ++i) {
        ASSERT_EQ(bits(alone.sine[i][0]), bits(whole.sine[i][5])) << i;
        ASSERT_EQ(bits(alone.phase_fringes[i][0]), bits(whole.phase_fringes[i][5])) << i;
        ASSERT_EQ(bits(alone.before[i][0]), bits(whole.before[i][5])) << i;
        ASSERT_EQ(bits(alone.after[i][0]), bits(whole.after[i][5])) << i;
        for (std::size_t g = 0; g < lanes; ++g) {
            ASSERT_EQ(bits(pieces.sine[i][g]), bits(whole.sine[i][g])) << i;
            // Whole fringes are put apart at the beginning of a piece: rounded there.
            const double phase = (pieces.phase_whole[i][g] - whole.phase_whole[i][g]) + pieces.phase_fringes[i][g];
            ASSERT_NEAR(phase, whole.phase_fringes[i][g], 1e-14) << i;
        }
    }
}

}  // namespace
}  // namespace ringlock::test
