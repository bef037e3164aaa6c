// The vectorised integrator against the scalar series, against the turn map, and against itself in other lanes.
#include "engine/propagate/direct_lanes.hpp"

#include <vector>

#include "engine/propagate/turn_kernel.hpp"
#include "engine/simd/target.hpp"
#include "tests/physics/noisy_block.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/series_integrator.hpp"

namespace ringlock::test {
namespace direct_lanes_test {
namespace {

using propagate::Stretch;
using propagate::StretchResult;

/// Half cycles with everything that the equation knows: harmonics of dither and coupling, unequal turns, input rates.
std::vector<Stretch> assorted(int count, std::uint64_t seed) {
    Uniform uniform(seed);
    std::vector<Stretch> stretches;
    for (int i = 0; i < count; ++i) {
        gyro::Setup setup = paper_device();
        setup.lockin_threshold_deg_h = uniform(50.0, 600.0);
        setup.dither_peak_rate_deg_s = uniform(10.0, 120.0);  // some lanes take many more steps than others
        setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
        setup.input_rate_deg_h = uniform(-20000.0, 20000.0);
        setup.coupling_phase_rad = uniform(-3.0, 3.0);
        if (i % 2 == 0) {
            setup.lockin_second_ratio = uniform(-0.3, 0.3);
            setup.lockin_second_phase_rad = uniform(-3.0, 3.0);
        }
        if (i % 3 == 0) setup.lockin_turn_asymmetry = uniform(-0.2, 0.2);
        if (i % 5 == 0) {
            setup.dither_harmonic_ratio = uniform(-0.05, 0.05);
            setup.dither_harmonic_phase_rad = uniform(-3.0, 3.0);
        }
        const gyro::Device device(setup);
        const auto half = device.half_cycle(i % 4 < 2 ? 1.0 : -1.0, device.dither_amplitude_rad * uniform(0.95, 1.05));
        stretches.push_back({half, device.coupling, uniform(-0.5, 0.5), half.duration_s});
    }
    return stretches;
}

std::vector<StretchResult> run(const std::vector<Stretch>& stretches, double tolerance_rad = 1e-11) {
    std::vector<StretchResult> results(stretches.size());
    propagate::integrate(stretches, tolerance_rad, results);
    return results;
}

void expect_same_bits(const StretchResult& a, const StretchResult& b) {
    EXPECT_EQ(a.lockin_rad, b.lockin_rad);
    EXPECT_EQ(a.cosine, b.cosine);
    EXPECT_EQ(a.sine, b.sine);
    EXPECT_EQ(a.steps, b.steps);
}

TEST(DirectLanes, AgreeWithTheScalarSeries) {
    const auto stretches = assorted(30, 31);
    const auto results = run(stretches, 1e-12);
    for (std::size_t i = 0; i < stretches.size(); ++i) {
        SeriesIntegrator scalar(stretches[i].coupling, 1e-12);
        // The scalar one sums its steps' phases, some 4000 of up to 2 rad: their rounding is what remains.
        EXPECT_NEAR(results[i].lockin_rad,
                    scalar.lockin_gain_rad(stretches[i].start_fringes * units::two_pi, stretches[i].half), 5e-10);
        const double theta = stretches[i].start_fringes * units::two_pi + stretches[i].coupling.phase_rad;
        EXPECT_NEAR(results[i].cosine, std::cos(theta), 1e-14);
        EXPECT_NEAR(results[i].sine, std::sin(theta), 1e-14);
    }
}

TEST(DirectLanes, KeepTheToleranceWithEveryKindOfCoupling) {
    const auto stretches = assorted(16, 32);
    const auto exact = run(stretches, 1e-14);
    for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10, 1e-12}) {
        const auto coarse = run(stretches, tolerance);
        for (std::size_t i = 0; i < stretches.size(); ++i) {
            EXPECT_NEAR(coarse[i].lockin_rad, exact[i].lockin_rad, tolerance) << i << " at " << tolerance;
            EXPECT_LT(coarse[i].steps, exact[i].steps);
        }
    }
}

TEST(DirectLanes, StopWhereAskedTo) {
    // Two coupled halves of a half cycle by hand: the flow reversed in time, psi(t) -> pi - psi(T - t) without coupling
    // phase, leads from the end back to the middle.
    const gyro::Device device(paper_device());
    const auto half = device.half_cycle(1.0, device.dither_amplitude_rad);
    const double middle = 0.5 * half.duration_s;
    const auto whole = run({{half, device.coupling, 0.1, half.duration_s}, {half, device.coupling, 0.1, middle}});
    const double end = units::two_pi * 0.1 + half.plain_phase_total_rad() + whole[0].lockin_rad;
    const auto back = run({{half, device.coupling, (units::pi - end) / units::two_pi, middle}});
    EXPECT_NEAR(whole[1].lockin_rad + back[0].lockin_rad, whole[0].lockin_rad, 1e-10);
}

TEST(DirectLanes, AResultDependsNeitherOnLaneNorOnLaneMates) {
    const auto stretches = assorted(16, 33);
    const auto together = run(stretches);
    for (std::size_t i = 0; i < stretches.size(); ++i) expect_same_bits(run({stretches[i]})[0], together[i]);
    const std::vector<Stretch> reversed(stretches.rbegin(), stretches.rend());
    const auto other_way = run(reversed);
    for (std::size_t i = 0; i < stretches.size(); ++i) expect_same_bits(other_way[15 - i], together[i]);
}

TEST(DirectLanes, AResultDoesNotDependOnTheInstructionSet) {
    const auto stretches = assorted(5, 34);
    const auto best = run(stretches);
    for (const std::string& target : simd::available_targets()) {
        simd::use_target(target);
        const auto other = run(stretches);
        for (std::size_t i = 0; i < stretches.size(); ++i) expect_same_bits(other[i], best[i]);
    }
    simd::use_best_target();
}

TEST(DirectLanes, GoThroughTheTurnsOfADriveAsTheTurnMapDoes) {
    const auto devices =
        unequal_devices(5, [](gyro::Setup& setup, double x) { setup.dither_asymmetry_ratio = 0.01 * x; });
    auto dither = noisy_dither(devices);
    propagate::DirectLanes direct(devices, 1e-12);
    propagate::TurnTables tables(1e-11);
    propagate::TurnState state;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const gyro::Device& device = devices[std::min(lane, devices.size() - 1)];
        tables.make(lane, device, noisy_ranges(device));
        state.coupling_phase_fringes[lane] = device.coupling.phase_rad / units::two_pi;
    }
    gyro::LaneDrive drive;
    gyro::LaneTurns by_integration;
    gyro::LaneTurns by_map;
    for (const std::size_t turns : {3U, 1U, 6U}) {  // whatever the pieces
        dither.next(turns, {}, {}, drive);
        direct.step(drive, &by_integration);
        propagate::step_turns(tables, drive, devices.size(), state, &by_map);
        for (std::size_t i = 0; i < turns; ++i) {
            for (std::size_t lane = 0; lane < devices.size(); ++lane) {
                // Ten half cycles, each with an error of 1e-10 rad at most.
                EXPECT_NEAR(by_integration.cosine[i][lane], by_map.cosine[i][lane], 1e-9);
                EXPECT_NEAR(by_integration.sine[i][lane], by_map.sine[i][lane], 1e-9);
                EXPECT_NEAR(by_integration.lockin_whole[lane] + by_integration.lockin_fringes[i][lane],
                            by_map.lockin_whole[lane] + by_map.lockin_fringes[i][lane], 1e-9);
            }
        }
    }
}

}  // namespace
}  // namespace direct_lanes_test
}  // namespace ringlock::test
