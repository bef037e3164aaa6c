// The turn map on gyros of few fringes: against the direct integrator.
#include "tests/support/devices.hpp"

#include <algorithm>
#include <cstdio>

#include "engine/dither/lane_dither.hpp"
#include "engine/propagate/turn_kernel.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/drive.hpp"

namespace ringlock::test {
namespace devices_test {
namespace {

struct Error {
    double worst_rad = 0.0;
    double told_rad = 0.0;
    std::size_t terms = 0;
};

/// Half cycles of one kind of gyro, sixteen at a time: rates within 10 000 deg/h, asymmetries within 5 %, amplitudes
/// within 5 % and eight standard deviations of the half swing with noise of `noise_rad` at the turns.
Error error_of_turns(const gyro::Setup& kind, double noise_rad, double rate_width_deg_h, int blocks,
                     std::uint64_t seed) {
    Uniform uniform(seed);
    Error error;
    for (int block = 0; block < blocks; ++block) {
        propagate::TurnTables tables(1e-10);
        propagate::TurnState state;
        gyro::LaneDrive drive;
        drive.first_turn = block % 2;
        drive.resize(2);
        std::vector<double> exact;
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            gyro::Setup setup = kind;
            setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
            setup.input_rate_deg_h = uniform(-1e4, 1e4);
            setup.coupling_phase_rad = uniform(-3.0, 3.0);
            const gyro::Device device(setup);
            const double a = device.dither_amplitude_rad;
            const double margin = 0.05 * a + Drive::amplitude_margin_rad(noise_rad);
            const double width = device.phase_per_arcsec * rate_width_deg_h;
            propagate::HalfCycleRanges ranges = test::ranges(device, margin);
            ranges.rate_rad_s = {device.input_rate_rad_s - width, device.input_rate_rad_s + width};
            tables.make(lane, device, ranges);
            error.told_rad = std::max(error.told_rad, tables.measured_error_rad(lane));
            gyro::HalfCycle half = device.half_cycle(drive.direction(0), uniform(a - margin, a + margin));
            half.rate_rad_s = uniform(ranges.rate_rad_s.lowest, ranges.rate_rad_s.highest);
            const double phase = uniform(-3.14, 3.14);
            exact.push_back(DirectIntegrator(device.coupling, 1e-12).lockin_gain_rad(phase, half));

            state.coupling_phase_fringes[lane] = device.coupling.phase_rad / units::two_pi;
            Phase next(phase);
            next.add(half.plain_phase_total_rad());
            drive.plain_fringes[0][lane] = phase / units::two_pi;
            drive.plain_fringes[1][lane] = next.remainder_rad / units::two_pi;
            for (const std::size_t i : {1U, 2U}) {
                drive.amplitude_rad[i][lane] = half.amplitude_rad;
                drive.rate_rad_s[i][lane] = half.rate_rad_s;
                drive.b_rad_s[i][lane] = device.coupling.b_rad_s;
            }
        }
        gyro::LaneTurns turns;
        propagate::step_turns(tables, drive, simd::lanes, state, &turns);
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const double gain = units::two_pi * (turns.lockin_whole[lane] + turns.lockin_fringes[1][lane]);
            error.worst_rad = std::max(error.worst_rad, std::abs(gain - exact[lane]));
        }
        error.terms = std::max(error.terms, tables.nodes());
    }
    return error;
}

TEST(Devices, TurnsAreThoseOfTheEquation) {
    for (const NamedDevice& named : named_devices) {
        const Error error = error_of_turns(setup_of(named), 3.0, 0.0, 4, 421);
        std::printf("%-15s %.2g rad; tables of up to %zu terms say %.2g\n", named.name, error.worst_rad, error.terms,
                    error.told_rad);
        EXPECT_LT(error.worst_rad, 1e-9) << named.name;
    }
}

TEST(Devices, TurnsOfTenFringesAreThoseOfTheEquation) {
    // Noise as large as leaves half of the swing.
    for (const double kick_rad : {0.1, 1.0}) {
        for (const double fringes : {10.0, 15.0, 26.0}) {
            const gyro::Setup setup = setup_of_size(fringes, kick_rad);
            const double noise = gyro::modulation_depth_rad(setup) * 0.45 * std::sqrt(2.0) / 8.0;
            const Error error = error_of_turns(setup, noise, 200.0, 1, 422);
            std::printf("%g fringes, kick %g rad, noise %.2f rad: %.2g rad; tables of up to %zu terms say %.2g\n",
                        fringes, kick_rad, noise, error.worst_rad, error.terms, error.told_rad);
            EXPECT_LT(error.worst_rad, 1e-9) << fringes << " fringes, kick " << kick_rad;
        }
    }
}

}  // namespace
}  // namespace devices_test
}  // namespace ringlock::test
