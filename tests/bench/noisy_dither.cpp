#include "tests/bench/noisy_dither.hpp"

#include <algorithm>
#include <cmath>

#include "engine/core/phase.hpp"
#include "tests/support/direct.hpp"
#include "tests/support/drive.hpp"

namespace ringlock::bench {

double go_through(test::Propagator& propagator, const gyro::Device& device, int turns) {
    test::Drive drive(device, turn_phase_rms_rad, {1, 0});
    Phase input(device.initial_phase_rad);
    double lockin_rad = 0.0;
    for (int turn = 0; turn < turns; ++turn) {
        const gyro::HalfCycle half = drive.after();
        Phase phase = input;
        phase.add(drive.turn_phase_rad() + lockin_rad);
        lockin_rad += propagator.lockin_gain_rad(phase.remainder_rad, half);
        input.add(half.rate_rad_s * half.duration_s);
        drive.advance();
    }
    return lockin_rad;
}

std::vector<SolvedHalfCycle> solved_half_cycles(const gyro::Device& device) {
    test::DirectIntegrator direct(device.coupling, 1e-13);
    test::Drive drive(device, turn_phase_rms_rad, {2, 0});
    std::vector<SolvedHalfCycle> solved;
    for (int turn = 0; turn < 40; ++turn) {
        const double phase_rad = -3.0 + 0.15 * turn;
        solved.push_back({drive.after(), phase_rad, direct.lockin_gain_rad(phase_rad, drive.after())});
        drive.advance();
    }
    return solved;
}

double worst_error_rad(test::Propagator& propagator, const std::vector<SolvedHalfCycle>& solved, double give_up_rad) {
    double worst = 0.0;
    for (const SolvedHalfCycle& one : solved) {
        worst = std::max(worst, std::abs(propagator.lockin_gain_rad(one.phase_rad, one.half) - one.gain_rad));
        if (worst > give_up_rad) break;
    }
    return worst;
}

}  // namespace ringlock::bench
