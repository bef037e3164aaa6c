#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/readout/lane_readout.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/turn_path.hpp"

/// Single turns, and what the readout of blocks makes of them.
namespace ringlock::test {

inline constexpr double quarter_rad = 0.5 * units::pi;

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
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
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

inline Read read(const std::vector<Turn>& which, std::int64_t number, const readout::Electronics& electronics,
                 const readout::ElectronicNoise& noise = {}, readout::Wanted wanted = readout::Wanted::accelerations) {
    std::vector<gyro::Device> devices;
    std::vector<gyro::Ellipse> ellipses;
    for (const Turn& turn : which) {
        devices.push_back(turn.device());
        ellipses.push_back(turn.setup.ellipse);
    }
    const readout::LaneReadout readout(devices, ellipses, electronics, wanted);
    const Row row(which, number);
    Read result;
    readout.read(row.drive, row.turns, noise, 1, result.readings, result.angles);
    return result;
}

inline constexpr readout::Electronics perfect_instrument{false, true, 0.0, 0.0};

enum class Beyond { nothing, harmonic_and_asymmetry, second_coupling };

inline Turn random_turn(Uniform& uniform, double rate_deg_h, Beyond beyond) {
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

}  // namespace ringlock::test
