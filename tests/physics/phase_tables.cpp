// Tabulated half turns of couplings with a second harmonic against the integrated equation of motion, and against the
// Moebius maps where there is no second harmonic.
#include "engine/propagate/phase_tables.hpp"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "engine/propagate/phase_kernel.hpp"
#include "engine/propagate/turn_kernel.hpp"
#include "engine/simd/target.hpp"
#include "tests/physics/noisy_block.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace phase_tables_test {
namespace {

using propagate::HalfCycleRanges;
using propagate::PhaseState;
using propagate::PhaseTables;

gyro::Setup device_with(double ratio, double phase_rad) {
    gyro::Setup setup = paper_device();
    setup.lockin_second_ratio = ratio;
    setup.lockin_second_phase_rad = phase_rad;
    return setup;
}

/// A block of gyros of one device whose half cycles are drawn at random from the ranges, turns at random phases: the
/// worst difference of tables and integration [rad] over a half cycle.
double worst_difference(const gyro::Device& device, const HalfCycleRanges& wanted, double tolerance_rad,
                        std::uint64_t seed, double* measured = nullptr) {
    Uniform uniform(seed);
    PhaseTables tables(tolerance_rad);
    tables.make(0, device, wanted);
    if (measured != nullptr) *measured = tables.measured_error_rad(0);
    double worst = 0.0;
    for (int first = 0; first < 2; ++first) {
        std::vector<propagate::Stretch> stretches;
        std::vector<double> by_tables;
        for (int i = 0; i < 48; ++i) {
            const auto draw = [&](const propagate::Range& range) { return uniform(range.lowest, range.highest); };
            gyro::HalfCycle half = device.half_cycle(first == 0 ? 1.0 : -1.0, draw(wanted.amplitude_rad));
            half.rate_rad_s = draw(wanted.rate_rad_s);
            gyro::Coupling coupling = device.coupling;
            coupling.b_rad_s = draw(wanted.b_rad_s);
            const double start = uniform(-0.5, 0.5);
            stretches.push_back({half, coupling, start, half.duration_s});
            gyro::LaneDrive drive;
            drive.first_turn = first;
            drive.resize(2);
            drive.plain_fringes[0][0] = start;
            drive.plain_fringes[1][0] = start + half.plain_phase_total_rad() / units::two_pi;
            for (const std::size_t row : {1U, 2U}) {
                drive.amplitude_rad[row][0] = half.amplitude_rad;
                drive.rate_rad_s[row][0] = half.rate_rad_s;
                drive.b_rad_s[row][0] = coupling.b_rad_s;
            }
            PhaseState state;
            state.coupling_phase_fringes[0] = coupling.phase_rad / units::two_pi;
            gyro::LaneTurns turns;
            propagate::step_phases(tables, drive, 1, state, &turns);
            by_tables.push_back(turns.lockin_fringes[1][0] * units::two_pi);
        }
        std::vector<propagate::StretchResult> results(stretches.size());
        propagate::integrate(stretches, 1e-12, results);
        for (std::size_t i = 0; i < results.size(); ++i) {
            worst = std::max(worst, std::abs(results[i].lockin_rad - by_tables[i]));
        }
    }
    std::printf("%zu nodes, %zu harmonics: error %.1e rad a turn by the tables, %.1e a half cycle here\n",
                tables.nodes(), tables.harmonics(), tables.measured_error_rad(0), worst);
    return worst;
}

/// Amplitudes +-5 %, rates +-500 deg/h.
HalfCycleRanges wide(const gyro::Device& device) {
    const double a = device.dither_amplitude_rad;
    const double b = device.coupling.b_rad_s;
    const double rate = device.phase_per_arcsec * 500.0;
    return {{0.95 * a, 1.05 * a}, {-rate, rate}, {b, b}};
}

TEST(PhaseTables, AgreeWithTheIntegratedEquation) {
    std::uint64_t seed = 51;
    for (const double ratio : {0.0, 0.02, 0.1, -0.4}) {
        gyro::Setup setup = device_with(ratio, 0.7);
        setup.coupling_phase_rad = 0.4;
        const gyro::Device device(setup);
        EXPECT_LT(worst_difference(device, wide(device), 2e-10, seed++), 1e-9) << ratio;
    }
}

TEST(PhaseTables, KnowHarmonicsAndAsymmetriesOfDitherAndTurns) {
    gyro::Setup setup = device_with(0.1, -1.3);
    setup.dither_asymmetry_ratio = 0.03;
    setup.dither_harmonic_ratio = 0.02;
    setup.dither_harmonic_phase_rad = 0.6;
    setup.lockin_turn_asymmetry = 0.2;
    setup.input_rate_deg_h = 3000.0;
    const gyro::Device device(setup);
    HalfCycleRanges wanted = ranges(device, 50.0);
    wanted.b_rad_s = {0.9 * device.coupling.b_rad_s, 1.1 * device.coupling.b_rad_s};
    EXPECT_LT(worst_difference(device, wanted, 2e-10, 61), 1e-9);
}

TEST(PhaseTables, HoldStrongCoupling) {
    for (const double threshold_deg_h : {1000.0, 3000.0}) {
        gyro::Setup setup = device_with(0.1, 0.2);
        setup.lockin_threshold_deg_h = threshold_deg_h;
        const gyro::Device device(setup);
        EXPECT_LT(worst_difference(device, ranges(device, 20.0), 1e-8, 62), 2e-8);
    }
}

TEST(PhaseTables, HoldTheStatedTolerance) {
    const gyro::Device device(device_with(0.1, 0.2));
    for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
        double measured = 0.0;
        // What is measured is the error at some points; the worst of others may be a little larger.
        EXPECT_LT(worst_difference(device, wide(device), tolerance, 63, &measured), 2.0 * tolerance);
        EXPECT_LE(measured, tolerance);
        EXPECT_GT(measured, 0.0);
    }
}

TEST(PhaseTables, RefuseWhatTheyCannotHold) {
    gyro::Setup setup = device_with(0.1, 0.2);
    const gyro::Device device(setup);
    const double a = device.dither_amplitude_rad;
    const double b = device.coupling.b_rad_s;
    PhaseTables tables(1e-16);
    EXPECT_THROW(tables.make(0, device, {{0.99 * a, 1.01 * a}, {0.0, 0.0}, {b, b}}), RunError);
    setup.dither_peak_rate_deg_s = 0.1;  // 1.8 fringes a half cycle
    const gyro::Device slow(setup);
    PhaseTables others(1e-8);
    EXPECT_THROW(others.make(0, slow, ranges(slow, 0.0)), RunError);
    propagate::TurnTables moebius(1e-8);
    EXPECT_THROW(moebius.make(0, device, ranges(device, 0.0)), RunError);
}

/// Unequal gyros with second harmonics of the coupling of `ratio` times their number.
std::vector<gyro::Device> block(std::size_t gyros, double ratio) {
    return unequal_devices(gyros, [&](gyro::Setup& setup, double x) {
        setup.lockin_second_ratio = ratio * x;
        setup.lockin_second_phase_rad = 0.3 * x;
    });
}

void make(PhaseTables& tables, PhaseState& state, std::size_t lane, const gyro::Device& device) {
    tables.make(lane, device, noisy_ranges(device));
    state.coupling_phase_fringes[lane] = device.coupling.phase_rad / units::two_pi;
}

TEST(PhaseTables, GoThroughTheTurnsOfADriveInAnyPieces) {
    const auto devices = block(5, 0.05);
    auto dither = noisy_dither(devices);
    propagate::DirectLanes direct(devices, 1e-12);
    PhaseTables tables(2e-10);
    PhaseState state;
    for (std::size_t lane = 0; lane < devices.size(); ++lane) make(tables, state, lane, devices[lane]);
    gyro::LaneDrive drive;
    gyro::LaneTurns by_integration;
    gyro::LaneTurns by_tables;
    for (const std::size_t turns : {3U, 1U, 6U}) {
        dither.next(turns, {}, {}, drive);
        direct.step(drive, &by_integration);
        propagate::step_phases(tables, drive, devices.size(), state, &by_tables);
        for (std::size_t i = 0; i < turns; ++i) {
            for (std::size_t lane = 0; lane < devices.size(); ++lane) {
                // Ten half cycles.
                EXPECT_NEAR(by_integration.cosine[i][lane], by_tables.cosine[i][lane], 2e-9);
                EXPECT_NEAR(by_integration.sine[i][lane], by_tables.sine[i][lane], 2e-9);
                EXPECT_NEAR(by_integration.lockin_whole[lane] + by_integration.lockin_fringes[i][lane],
                            by_tables.lockin_whole[lane] + by_tables.lockin_fringes[i][lane], 1e-9);
            }
        }
    }
}

TEST(PhaseTables, AgreeWithTheMoebiusMapWithoutSecondHarmonic) {
    const auto devices = block(3, 0.0);
    auto dither = noisy_dither(devices);
    PhaseTables tables(2e-10);
    PhaseState state;
    propagate::TurnTables moebius(1e-11);
    propagate::TurnState moebius_state;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const gyro::Device& device = devices[std::min(lane, devices.size() - 1)];
        if (lane < devices.size()) make(tables, state, lane, device);
        moebius.make(lane, device, noisy_ranges(device));
        moebius_state.coupling_phase_fringes[lane] = device.coupling.phase_rad / units::two_pi;
    }
    gyro::LaneDrive drive;
    gyro::LaneTurns by_tables;
    gyro::LaneTurns by_map;
    dither.next(300, {}, {}, drive);
    propagate::step_phases(tables, drive, devices.size(), state, &by_tables);
    propagate::step_turns(moebius, drive, devices.size(), moebius_state, &by_map);
    for (std::size_t lane = 0; lane < devices.size(); ++lane) {
        // Errors of 300 half cycles; under noise two trajectories draw together.
        EXPECT_NEAR(by_tables.lockin_fringes[299][lane], by_map.lockin_fringes[299][lane], 300 * 2e-10 / units::two_pi);
    }
}

/// Turns of the gyros `places[lane]` of a block of five.
class Rearranged {
   public:
    Rearranged() { noisy_dither(devices_).next(20, {}, {}, drive_); }

    void make_tables(const std::vector<std::size_t>& places, PhaseTables& tables, PhaseState& state) const {
        for (std::size_t lane = 0; lane < places.size(); ++lane) make(tables, state, lane, devices_[places[lane]]);
    }
    gyro::LaneTurns step(const std::vector<std::size_t>& places, const PhaseTables& tables,
                         const PhaseState& begin) const {
        PhaseState state = begin;
        gyro::LaneDrive moved = drive_;
        const auto move = [&](std::vector<simd::Lanes>& to, const std::vector<simd::Lanes>& from) {
            for (std::size_t i = 0; i < to.size(); ++i) {
                for (std::size_t lane = 0; lane < places.size(); ++lane) to[i][lane] = from[i][places[lane]];
            }
        };
        move(moved.plain_fringes, drive_.plain_fringes);
        move(moved.amplitude_rad, drive_.amplitude_rad);
        move(moved.rate_rad_s, drive_.rate_rad_s);
        move(moved.b_rad_s, drive_.b_rad_s);
        gyro::LaneTurns turns;
        propagate::step_phases(tables, moved, places.size(), state, &turns);
        return turns;
    }

   private:
    std::vector<gyro::Device> devices_ = block(5, 0.05);
    gyro::LaneDrive drive_;
};

TEST(PhaseTables, ALaneDependsNeitherOnItsPlaceNorOnItsMates) {
    const Rearranged block;
    const auto run = [&](const std::vector<std::size_t>& places) {
        PhaseTables tables(1e-8);
        PhaseState state;
        block.make_tables(places, tables, state);
        return block.step(places, tables, state);
    };
    const auto all = run({0, 1, 2, 3, 4});
    const auto others = run({4, 2});
    for (std::size_t i = 0; i < 20; ++i) {
        EXPECT_EQ(others.lockin_fringes[i][0], all.lockin_fringes[i][4]);
        EXPECT_EQ(others.cosine[i][1], all.cosine[i][2]);
    }
}

TEST(PhaseTables, TheInstructionSetMakesNoDifference) {
    const Rearranged block;
    const std::vector<std::size_t> places{0, 1, 2, 3, 4};
    PhaseTables tables(1e-8);
    PhaseState state;
    block.make_tables(places, tables, state);
    const auto best = block.step(places, tables, state);
    // Of the making one small table will do: the plain loops take a second for it.
    const gyro::Device device(device_with(0.1, 0.3));
    PhaseTables small(1e-6);
    small.make(0, device, ranges(device, 0.0));
    for (const std::string& target : simd::available_targets()) {
        simd::use_target(target);
        const auto other = block.step(places, tables, state);
        for (const std::size_t lane : places) {
            EXPECT_EQ(other.lockin_fringes[19][lane], best.lockin_fringes[19][lane]) << target;
            EXPECT_EQ(other.sine[19][lane], best.sine[19][lane]) << target;
        }
        PhaseTables same(1e-6);
        same.make(0, device, ranges(device, 0.0));
        EXPECT_EQ(same.measured_error_rad(0), small.measured_error_rad(0)) << target;
        ASSERT_EQ(same.harmonics(), small.harmonics());
        for (std::size_t k = 0; k < same.part(1.0, 1).size(); ++k) {
            EXPECT_EQ(same.part(1.0, 1)[k].coefficients[0][0], small.part(1.0, 1)[k].coefficients[0][0]) << target;
        }
    }
    simd::use_best_target();
}

}  // namespace
}  // namespace phase_tables_test
}  // namespace ringlock::test
