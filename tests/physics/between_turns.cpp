// The phase between turns, from the turn map, against the equation integrated from the turn before.
#include "engine/propagate/between_turns.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include "engine/dither/lane_dither.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "engine/propagate/lane_propagator.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/devices.hpp"

namespace ringlock::test {
namespace between_turns_test {
namespace {

random::LaneIdentities identities(std::uint64_t seed) {
    random::LaneIdentities who;
    who.seed = seed;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = lane;
    return who;
}

/// Instants of half cycles of gyros that a block went through, and what the two methods say of each.
struct Comparison {
    double worst_rad = 0.0;
    double us_each = 0.0;  ///< for the look at it; nothing depends on it
    std::size_t instants = 0;
};

struct Injected {
    double noise_rad = 3.0;
    bool by_drive = false;
};

Comparison compare(const std::vector<gyro::Device>& devices, const Injected& injected, std::size_t turns,
                   std::uint64_t seed) {
    dither::LaneDither dither =
        injected.by_drive ? dither::LaneDither(devices, gyro::DriveNoise{}, injected.noise_rad, identities(seed))
                          : dither::LaneDither(devices, injected.noise_rad, identities(seed));
    gyro::LaneDrive drive;
    dither.next(turns, {}, {}, drive);
    propagate::AmplitudeRoom room{9.0 * injected.noise_rad, injected.by_drive ? 2.0 * injected.noise_rad : 0.0};
    const auto propagator = propagate::make_turn_map(devices, room, 1e-11);
    gyro::LaneTurns passed;
    passed.middles = true;
    propagator->step(drive, passed);

    Uniform uniform(seed);
    std::vector<propagate::Stretch> stretches;
    std::vector<double> lockin_rad;
    Comparison result;
    const auto begun = std::chrono::steady_clock::now();
    for (std::size_t i = 0; i + 1 < turns; ++i) {
        for (std::size_t lane = 0; lane < devices.size(); ++lane) {
            const propagate::PassedHalfCycle half{gyro::half_cycle_of(devices[lane], drive, i + 1, lane),
                                                  gyro::coupling_of(devices[lane], drive, i + 1, lane),
                                                  drive.plain_fringes[i][lane],
                                                  passed.lockin_fringes[i][lane],
                                                  passed.lockin_fringes[i + 1][lane],
                                                  passed.lockin_middle_fringes[i][lane]};
            const double at_s = uniform(0.0, half.half.duration_s);
            const double gained = propagate::lockin_between_turns_fringes(half, at_s) - half.lockin_start_fringes;
            lockin_rad.push_back(units::two_pi * gained);
            stretches.push_back({half.half, half.coupling, half.plain_start_fringes + half.lockin_start_fringes, at_s});
        }
    }
    result.instants = stretches.size();
    result.us_each = std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begun).count() /
                     static_cast<double>(result.instants);
    std::vector<propagate::StretchResult> integrated(stretches.size());
    propagate::integrate(stretches, 1e-12, integrated);
    for (std::size_t i = 0; i < stretches.size(); ++i) {
        result.worst_rad = std::max(result.worst_rad, std::abs(lockin_rad[i] - integrated[i].lockin_rad));
    }
    return result;
}

std::vector<gyro::Device> lot_of(const gyro::Setup& kind, std::uint64_t seed) {
    Uniform uniform(seed);
    std::vector<gyro::Device> devices;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        gyro::Setup setup = kind;
        setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
        setup.input_rate_deg_h = uniform(-1e4, 1e4);
        setup.coupling_phase_rad = uniform(-3.0, 3.0);
        setup.initial_phase_rad = uniform(-3.0, 3.0);
        devices.emplace_back(setup);
    }
    return devices;
}

void expect_right(const char* name, const Comparison& found, double tolerance_rad = 1e-8) {
    std::printf("%-28s %6zu instants, %.2g rad, %.1f us each\n", name, found.instants, found.worst_rad, found.us_each);
    EXPECT_GT(found.instants, 0U);
    EXPECT_LT(found.worst_rad, tolerance_rad) << name;
}

void compare_devices(std::size_t turns) {
    for (const NamedDevice& named : named_devices) {
        const auto devices = lot_of(setup_of(named), 501);
        expect_right(named.name, compare(devices, {3.0, false}, turns, 502), 1e-9);
        expect_right(named.name, compare(devices, {3.0, true}, turns, 503), 1e-9);
    }
}

TEST(BetweenTurns, PhaseIsThatOfTheEquation) { compare_devices(12); }

TEST(LongBetweenTurns, TenThousandInstantsOfEveryDevice) { compare_devices(626); }

TEST(BetweenTurns, TenFringesAreIntegratedFromTheNearerTurn) {
    for (const double kick_rad : {0.1, 1.0}) {
        const auto devices = lot_of(setup_of_size(10.0, kick_rad), 504);
        expect_right("ten fringes", compare(devices, {0.3, false}, 40, 505));
    }
}

TEST(BetweenTurns, HarmonicsOfDitherAndCouplingCount) {
    gyro::Setup setup = setup_of(named_devices[1]);
    setup.dither_harmonic_ratio = 0.01;
    setup.dither_harmonic_phase_rad = 0.7;
    setup.lockin_turn_asymmetry = 0.2;
    expect_right("harmonic of the dither", compare(lot_of(setup, 506), {1.0, false}, 40, 507));
    setup.lockin_second_ratio = 0.3;
    setup.lockin_second_phase_rad = 1.1;
    expect_right("harmonic of the coupling", compare(lot_of(setup, 508), {1.0, false}, 40, 509));
    gyro::Setup paper = paper_device();
    paper.lockin_threshold_deg_h *= 5.0;
    expect_right("threshold of 1500 deg/h", compare(lot_of(paper, 510), {3.0, false}, 12, 511));
}

}  // namespace
}  // namespace between_turns_test
}  // namespace ringlock::test
