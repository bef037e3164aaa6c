#include "tests/support/long_drive.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "engine/core/phase.hpp"
#include "engine/dither/lane_dither.hpp"
#include "engine/propagate/half_turn.hpp"
#include "engine/propagate/turn_kernel.hpp"
#include "tests/support/drive.hpp"

namespace ringlock::test {

namespace {

using propagate::HalfTurn;
using propagate::HalfTurnProblem;
using simd::lanes;

constexpr std::size_t piece_turns = 256;

/// 2 arg(1 + z exp(i angle)).
double bend_rad(std::complex<double> z, double angle_rad) {
    return 2.0 * std::arg(1.0 + z * std::polar(1.0, angle_rad));
}

/// One gyro by exact half cycles.
struct Exact {
    gyro::Device device;
    Phase lockin;

    /// From a turn to the next, whose plain phases are given; the half cycle's own two half turns.
    void step(double sign, double plain_fringes, double next_plain_fringes, const HalfTurn& first,
              const HalfTurn& second) {
        // docs/dev/turn-map.md, "A half cycle", upright: psi -> -psi where the half cycle is negative.
        const double e = device.coupling.phase_rad;
        const double psi = sign * (units::two_pi * plain_fringes + lockin.remainder_rad + e);
        const double to_middle = first.shift_rad + bend_rad(first.z, -psi);
        const double u =
            sign * (units::two_pi * next_plain_fringes + lockin.remainder_rad + e) + to_middle + second.shift_rad;
        lockin.add(sign * (to_middle + second.shift_rad - bend_rad(second.z, u)));
    }
};

/// Phase difference, whole fringes first: both may be thousands of fringes from where they began.
double difference_rad(double whole, double fringes, const Phase& exact) {
    return (whole - static_cast<double>(exact.fringes)) * units::two_pi +
           (units::two_pi * fringes - exact.remainder_rad);
}

void run_block(std::span<const gyro::Setup> setups, std::uint64_t first_gyro, const LongDrive& wanted,
               DriveDifference* differences) {
    const std::size_t gyros = setups.size();
    std::vector<gyro::Device> devices;
    std::vector<Exact> exact;
    propagate::TurnTables tables(wanted.table_tolerance_rad);
    propagate::TurnState state;
    random::LaneIdentities who;
    who.seed = wanted.seed;
    const double margin = Drive::amplitude_margin_rad(wanted.noise_rms_rad);
    bool symmetric = true;
    for (std::size_t lane = 0; lane < gyros; ++lane) {
        const gyro::Device device(setups[lane]);
        const double a = device.dither_amplitude_rad;
        const double b = device.coupling.b_rad_s;
        tables.make(lane, device,
                    {{a - margin, a + margin}, {device.input_rate_rad_s, device.input_rate_rad_s}, {b, b}});
        state.coupling_phase_fringes[lane] = device.coupling.phase_rad / units::two_pi;
        who.gyro[lane] = first_gyro + lane;
        symmetric = symmetric && device.harmonic_ratio == 0.0 && device.coupling.turn_asymmetry == 0.0;
        devices.push_back(device);
        exact.push_back({device, Phase()});
    }
    dither::LaneDither dither(devices, wanted.noise_rms_rad, who);
    gyro::LaneDrive drive;
    gyro::LaneTurns turns;
    std::vector<HalfTurnProblem> problems;
    std::vector<HalfTurn> halves;
    const std::size_t ends = symmetric ? 1 : 2;
    // The last half cycle ends at a turn of its own: one turn more, and the drive of the next piece's first turn is
    // needed to end this piece's last half cycle.
    std::vector<double> plain_before(gyros);
    std::vector<std::array<HalfTurn, 2>> under_way(gyros);
    for (std::int64_t done = 0; done <= wanted.turns;) {
        const auto count = static_cast<std::size_t>(std::min<std::int64_t>(piece_turns, wanted.turns + 1 - done));
        dither.next(count, {}, {}, drive);
        propagate::step_turns(tables, drive, gyros, state, &turns);
        problems.clear();
        for (std::size_t i = 0; i < count; ++i) {
            for (std::size_t lane = 0; lane < gyros; ++lane) {
                const gyro::HalfCycle half =
                    devices[lane].half_cycle(drive.direction(i), drive.amplitude_rad[i + 1][lane]);
                problems.push_back(propagate::beginning(half, devices[lane].coupling));
                if (!symmetric) problems.push_back(propagate::ending(half, devices[lane].coupling));
            }
        }
        halves.resize(problems.size());
        propagate::exact_half_turns(problems, halves);
        for (std::size_t i = 0; i < count; ++i) {
            for (std::size_t lane = 0; lane < gyros; ++lane) {
                const double plain = drive.plain_fringes[i][lane];
                if (done > 0 || i > 0) {
                    exact[lane].step(-drive.direction(i), plain_before[lane], plain, under_way[lane][0],
                                     under_way[lane][1]);
                }
                plain_before[lane] = plain;
                const HalfTurn* own = &halves[(i * gyros + lane) * ends];
                under_way[lane] = {own[0], own[ends - 1]};
                const double off =
                    difference_rad(turns.lockin_whole[lane], turns.lockin_fringes[i][lane], exact[lane].lockin);
                differences[lane].final_rad = off;
                differences[lane].largest_rad = std::max(differences[lane].largest_rad, std::abs(off));
            }
        }
        done += static_cast<std::int64_t>(count);
    }
}

}  // namespace

std::vector<DriveDifference> drive_differences(std::span<const gyro::Setup> setups, const LongDrive& wanted) {
    std::vector<DriveDifference> differences(setups.size());
    const std::size_t blocks = (setups.size() + lanes - 1) / lanes;
    tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t block) {
        const std::size_t first = block * lanes;
        run_block(setups.subspan(first, std::min(lanes, setups.size() - first)), first, wanted, &differences[first]);
    });
    return differences;
}

std::vector<gyro::Setup> long_drive_setups(std::size_t gyros, double rate_deg_h, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const auto uniform = [&](double low, double high) {
        return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
    };
    std::vector<gyro::Setup> setups;
    for (std::size_t i = 0; i < gyros; ++i) {
        gyro::Setup setup;
        setup.scale_factor_arcsec = 0.5;
        setup.lockin_threshold_deg_h = 300.0 * uniform(0.8, 1.2);
        setup.coupling_phase_rad = uniform(-3.0, 3.0);
        setup.dither_frequency_hz = 783.4 / units::two_pi;
        setup.dither_peak_rate_deg_s = 109.1 * uniform(0.99, 1.01);
        setup.dither_asymmetry_ratio = uniform(-0.005, 0.005);
        setup.input_rate_deg_h = rate_deg_h;
        setup.initial_phase_rad = uniform(-3.0, 3.0);
        setups.push_back(setup);
    }
    return setups;
}

}  // namespace ringlock::test
