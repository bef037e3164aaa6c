#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "engine/dither/lane_dither.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "engine/propagate/lane_propagator.hpp"
#include "tests/physics/noisy_block.hpp"
#include "tests/physics/readout_support.hpp"
#include "tests/support/drive.hpp"
#include "tests/support/odeint.hpp"

// A phase of the coupling that jumps from half cycle to half cycle: psi goes on, psi + phase jumps.
namespace ringlock::test {
namespace coupling_phase_test {
namespace {

constexpr std::size_t half_cycles = 10;

/// By what the phase of each gyro's coupling moves over each half cycle.
std::vector<simd::Lanes> random_phases_rad(std::uint64_t seed) {
    Uniform uniform(seed);
    std::vector<simd::Lanes> phases(half_cycles);
    for (simd::Lanes& row : phases) {
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) row[lane] = uniform(-3.0, 3.0);
    }
    return phases;
}

/// What the lock-in has added at each turn [fringes], [turn][gyro], and the turns' sines and cosines.
struct Motion {
    std::vector<simd::Lanes> lockin_fringes;
    std::vector<simd::Lanes> sine, cosine;
};

/// The motion under these phases, by the propagator, in pieces of these lengths.
Motion go_through(propagate::LanePropagator& propagator, const std::vector<gyro::Device>& devices,
                  const std::vector<simd::Lanes>& phases_rad, std::span<const std::size_t> pieces) {
    auto dither = noisy_dither(devices);
    gyro::LaneDrive drive;
    gyro::LaneTurns turns;
    Motion motion;
    std::size_t begun = 0;
    for (const std::size_t piece : pieces) {
        dither.next(piece, {}, {}, drive, std::span(phases_rad).subspan(begun, piece));
        propagator.step(drive, turns);
        begun += piece;
        for (std::size_t i = 0; i < piece; ++i) {
            simd::Lanes lockin;
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                lockin[lane] = turns.lockin_whole[lane] + turns.lockin_fringes[i][lane];
            }
            motion.lockin_fringes.push_back(lockin);
        }
        motion.sine.insert(motion.sine.end(), turns.sine.begin(), turns.sine.end());
        motion.cosine.insert(motion.cosine.end(), turns.cosine.begin(), turns.cosine.end());
    }
    return motion;
}

/// The same motion by odeint, half cycle by half cycle, each with the coupling at its phase.
Motion by_odeint(const std::vector<gyro::Device>& devices, const std::vector<simd::Lanes>& phases_rad) {
    auto dither = noisy_dither(devices);
    gyro::LaneDrive drive;
    dither.next(half_cycles, {}, {}, drive);
    Motion motion;
    motion.lockin_fringes.resize(half_cycles);
    motion.sine.resize(half_cycles);
    motion.cosine.resize(half_cycles);
    for (std::size_t lane = 0; lane < devices.size(); ++lane) {
        const gyro::Device& device = devices[lane];
        double lockin_rad = 0.0;
        double before_rad = device.coupling.phase_rad;
        for (std::size_t i = 0; i < half_cycles; ++i) {
            const double psi = units::two_pi * drive.plain_fringes[i][lane] + lockin_rad;
            motion.lockin_fringes[i][lane] = lockin_rad / units::two_pi;
            motion.sine[i][lane] = std::sin(psi + before_rad);
            motion.cosine[i][lane] = std::cos(psi + before_rad);
            gyro::HalfCycle half = device.half_cycle(drive.direction(i), drive.amplitude_rad[i + 1][lane]);
            half.rate_rad_s = drive.rate_rad_s[i + 1][lane];
            gyro::Coupling coupling = device.coupling;
            before_rad = device.coupling.phase_rad + phases_rad[i][lane];
            coupling.phase_rad = before_rad;
            coupling.second_phase_rad += 2.0 * phases_rad[i][lane];
            Odeint odeint(coupling, 1e-14, 0.1);
            lockin_rad += odeint.lockin_gain_rad(std::remainder(psi, units::two_pi), half);
        }
    }
    return motion;
}

void expect_alike(const Motion& one, const Motion& other, std::size_t gyros, double tolerance_rad) {
    ASSERT_EQ(one.lockin_fringes.size(), other.lockin_fringes.size());
    for (std::size_t i = 0; i < one.lockin_fringes.size(); ++i) {
        for (std::size_t lane = 0; lane < gyros; ++lane) {
            EXPECT_NEAR(one.lockin_fringes[i][lane], other.lockin_fringes[i][lane], tolerance_rad / units::two_pi)
                << "turn " << i << " gyro " << lane;
            EXPECT_NEAR(one.sine[i][lane], other.sine[i][lane], tolerance_rad) << "turn " << i << " gyro " << lane;
            EXPECT_NEAR(one.cosine[i][lane], other.cosine[i][lane], tolerance_rad) << "turn " << i << " gyro " << lane;
        }
    }
}

/// Both propagators against odeint: ten half cycles, each right to 1e-10 rad at most, and kicks of 0.15 rad, which make
/// no error much larger.
void expect_both_right(const std::vector<gyro::Device>& devices) {
    const auto phases_rad = random_phases_rad(61);
    const Motion expected = by_odeint(devices, phases_rad);
    const std::array<std::size_t, 1> whole = {half_cycles};
    propagate::DirectPropagator direct(devices, 1e-12);
    expect_alike(go_through(direct, devices, phases_rad, whole), expected, devices.size(), 1e-9);
    const auto map = propagate::make_turn_map(devices, {Drive::amplitude_margin_rad(block_noise_rad)}, 1e-10);
    expect_alike(go_through(*map, devices, phases_rad, whole), expected, devices.size(), 4e-9);
}

TEST(CouplingPhase, JumpsInBothPropagatorsAsInTheEquation) {
    expect_both_right(
        unequal_devices(5, [](gyro::Setup& setup, double x) { setup.dither_asymmetry_ratio = 0.01 * x; }));
}

TEST(CouplingPhase, TakesTheSecondHarmonicOfTheCouplingAlong) {
    expect_both_right(unequal_devices(3, [](gyro::Setup& setup, double x) {
        setup.lockin_second_ratio = 0.05 * x;
        setup.lockin_second_phase_rad = 0.3 * x;
    }));
}

TEST(CouplingPhase, JumpsAlikeInAnyPieces) {
    const auto phases_rad = random_phases_rad(62);
    for (const double second_ratio : {0.0, 0.05}) {
        const auto devices =
            unequal_devices(3, [&](gyro::Setup& setup, double x) { setup.lockin_second_ratio = second_ratio * x; });
        const std::array<std::size_t, 1> whole = {half_cycles};
        const std::array<std::size_t, 4> parts = {1, 3, 4, 2};
        const auto one = propagate::make_turn_map(devices, {Drive::amplitude_margin_rad(block_noise_rad)}, 1e-10);
        const auto other = propagate::make_turn_map(devices, {Drive::amplitude_margin_rad(block_noise_rad)}, 1e-10);
        expect_alike(go_through(*one, devices, phases_rad, whole), go_through(*other, devices, phases_rad, parts),
                     devices.size(), 1e-12);
    }
}

/// A single turn under coupling phases of the half cycles before and after it, by a readout of the devices as they are.
Read read_moved(const std::vector<Turn>& which, std::int64_t number, double before_rad, double after_rad,
                const readout::Electronics& electronics, readout::Wanted wanted) {
    std::vector<gyro::Device> devices;
    std::vector<gyro::Ellipse> ellipses;
    Row row(which, number);
    row.drive.phases_vary = true;
    row.drive.coupling_phase_fringes.resize(2);
    for (const Turn& turn : which) {
        devices.push_back(turn.device());
        ellipses.push_back(turn.setup.ellipse);
    }
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const Turn& turn = which[std::min(lane, which.size() - 1)];
        const double own_rad = turn.device().coupling.phase_rad;
        row.drive.coupling_phase_fringes[0][lane] = (own_rad + before_rad) / units::two_pi;
        row.drive.coupling_phase_fringes[1][lane] = (own_rad + after_rad) / units::two_pi;
        row.turns.sine[0][lane] = std::sin(turn.phase_rad + own_rad + before_rad);
        row.turns.cosine[0][lane] = std::cos(turn.phase_rad + own_rad + before_rad);
    }
    const readout::LaneReadout readout(devices, ellipses, electronics, wanted, true);
    Read result;
    readout.read(row.drive, row.turns, {}, 1, result.readings, result.angles);
    return result;
}

std::vector<Turn> random_turns(Uniform& uniform, double rate_deg_h, Beyond beyond) {
    std::vector<Turn> turns;
    for (std::size_t i = 0; i < simd::lanes; ++i) turns.push_back(random_turn(uniform, rate_deg_h, beyond));
    return turns;
}

Turn moved(Turn turn, double phase_rad) {
    turn.setup.coupling_phase_rad += phase_rad;
    turn.setup.lockin_second_phase_rad += 2.0 * phase_rad;
    return turn;
}

constexpr readout::Electronics ideal{true, true, 0.0, 0.0};

// The zero-rate point lies in one of the half cycles, which alone rules there.
TEST(CouplingPhase, RulesTheZeroRatePointOfItsOwnHalfCycle) {
    Uniform uniform(63);
    int before = 0;
    int after = 0;
    for (const Beyond beyond : {Beyond::nothing, Beyond::harmonic_and_asymmetry, Beyond::second_coupling}) {
        for (int block = 0; block < 20; ++block) {
            const auto turns = random_turns(uniform, uniform(-500.0, 500.0), beyond);
            const double jump_rad = uniform(-3.0, 3.0);
            const int direction = block % 2 == 0 ? 1 : -1;
            const Read got = read_moved(turns, block, 0.0, jump_rad, ideal, readout::Wanted::accelerations);
            for (std::size_t i = 0; i < turns.size(); ++i) {
                const TurnPath path_after = moved(turns[i], jump_rad).path(direction);
                const TurnPath path_before = turns[i].path(direction);
                const bool is_after = path_after.zero_rate_time_s() > 0.0;
                // Where the jump itself reverses the rate the phase turns at the jump.
                double expected = turns[i].phase_rad;
                if (is_after) {
                    expected = path_after.zero_rate_phase_rad();
                } else if (path_before.zero_rate_time_s() < 0.0) {
                    expected = path_before.zero_rate_phase_rad();
                }
                (is_after ? after : before) += 1;
                EXPECT_NEAR(got.phase_rad(i), expected, 2e-9) << i;
                EXPECT_NEAR(got.readings.sine[0][i], std::sin(expected), 2e-9) << i;
                EXPECT_NEAR(got.readings.cosine[0][i], std::cos(expected), 2e-9) << i;
            }
        }
    }
    EXPECT_GT(std::min(before, after), 100);
}

/// Largest differences between readings at a phase that is moved to and at one that the gyros have.
struct WorstReading {
    double acceleration_relative = 0.0;  ///< from the pulses
    double phase_rad = 0.0;
};

WorstReading worst_reading(Beyond beyond, double threshold_deg_h, readout::Wanted wanted) {
    Uniform uniform(64);
    WorstReading worst;
    for (int block = 0; block < 2; ++block) {
        auto turns = random_turns(uniform, 100.0, beyond);
        const double phase_rad = uniform(-3.0, 3.0);
        std::vector<Turn> own;
        for (Turn& turn : turns) {
            turn.setup.lockin_threshold_deg_h = threshold_deg_h;
            own.push_back(moved(turn, phase_rad));
        }
        const Read got = read_moved(turns, block, phase_rad, phase_rad, perfect_instrument, wanted);
        const Read expected = read(own, block, perfect_instrument, {}, wanted);
        for (std::size_t i = 0; i < turns.size(); ++i) {
            worst.phase_rad = std::max(worst.phase_rad, std::abs(got.phase_rad(i) - expected.phase_rad(i)));
            EXPECT_NEAR(got.lockin_rad(i), expected.lockin_rad(i), 1e-9);
            for (const int side : {-1, 1}) {
                const double off = std::abs(got.accel(i, side) / expected.accel(i, side) - 1.0);
                worst.acceleration_relative = std::max(worst.acceleration_relative, off);
            }
        }
    }
    std::printf("threshold %4.0f: accelerations from pulses off by %.2g, phase by %.2g rad\n", threshold_deg_h,
                worst.acceleration_relative, worst.phase_rad);
    return worst;
}

// Pulse tables at five phases leave the third power of b/sqrt(a), which is 0.06 at 300 deg/h, or with a second harmonic
// of the coupling the square, of what the lock-in does to the pulses. A latched readout samples at the zero-rate point;
// an instrument's instant is that of the pulses, and an error of it moves the phase in the second order.
TEST(CouplingPhase, MovesThePulses) {
    for (const auto wanted : {readout::Wanted::accelerations, readout::Wanted::pulses}) {
        const bool latched = wanted == readout::Wanted::accelerations;
        const WorstReading plain = worst_reading(Beyond::nothing, 300.0, wanted);
        EXPECT_LT(plain.acceleration_relative, 1e-4);
        EXPECT_LT(plain.phase_rad, latched ? 1e-9 : 1e-6);
        const WorstReading weak = worst_reading(Beyond::nothing, 30.0, wanted);
        EXPECT_LT(weak.acceleration_relative, 1e-6);
        EXPECT_LT(weak.phase_rad, latched ? 1e-9 : 1e-8);
        const WorstReading second = worst_reading(Beyond::second_coupling, 300.0, wanted);
        EXPECT_LT(second.acceleration_relative, 3e-3);
        EXPECT_LT(second.phase_rad, latched ? 1e-9 : 4e-6);
    }
}

}  // namespace
}  // namespace coupling_phase_test
}  // namespace ringlock::test
