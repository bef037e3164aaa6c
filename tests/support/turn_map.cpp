#include "tests/support/turn_map.hpp"

#include "engine/propagate/direct_lanes.hpp"
#include "engine/propagate/phase_kernel.hpp"
#include "engine/propagate/turn_kernel.hpp"
#include "tests/support/constant_rate.hpp"

namespace ringlock::test {

TurnMap::TurnMap(const gyro::Device& device, const propagate::HalfCycleRanges& ranges, double tolerance_rad)
    : device_(device), tolerance_rad_(tolerance_rad), tables_(tolerance_rad), phase_tables_(tolerance_rad) {
    if (!(ranges.amplitude_rad.highest > 0.0)) return;
    if (is_moebius()) {
        tables_.make(0, device, ranges);
    } else {
        phase_tables_.make(0, device, ranges);
    }
}

double TurnMap::lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) {
    const double b = device_.coupling.b_rad_s;
    if (half.amplitude_rad == 0.0 && is_moebius()) {
        return constant_rate_gain_rad(phase_rad, half.rate_rad_s, half.duration_s, device_.coupling);
    }
    const propagate::HalfCycleRanges& ranges = is_moebius() ? tables_.ranges(0) : phase_tables_.ranges(0);
    const bool inside = ranges.amplitude_rad.covers(half.amplitude_rad) && ranges.rate_rad_s.covers(half.rate_rad_s);
    propagate::TurnTables alone(tolerance_rad_);
    if (!inside && !is_moebius()) {  // a table for one half cycle would take longer
        ++outside_;
        const propagate::Stretch stretch{half, device_.coupling, phase_rad / units::two_pi, half.duration_s};
        propagate::StretchResult result;
        propagate::integrate({&stretch, 1}, tolerance_rad_, {&result, 1});
        return result.lockin_rad;
    }
    if (!inside) {
        alone.make(0, device_, {{half.amplitude_rad, half.amplitude_rad}, {half.rate_rad_s, half.rate_rad_s}, {b, b}});
        ++outside_;
    }
    gyro::LaneDrive drive;
    drive.first_turn = half.sign > 0 ? 0 : 1;
    drive.resize(2);
    const double start = phase_rad / units::two_pi;
    const double plain = half.plain_phase_total_rad() / units::two_pi;
    drive.plain_fringes[0][0] = start;
    drive.plain_fringes[1][0] = start + (plain - std::nearbyint(plain));
    // The half cycle that begins at the second turn is of no account, but must be one that the tables know.
    for (const std::size_t i : {1U, 2U}) {
        drive.amplitude_rad[i][0] = half.amplitude_rad;
        drive.rate_rad_s[i][0] = half.rate_rad_s;
        drive.b_rad_s[i][0] = b;
    }
    const double coupling_phase = device_.coupling.phase_rad / units::two_pi;
    gyro::LaneTurns turns;
    if (is_moebius()) {
        propagate::TurnState state;
        state.coupling_phase_fringes[0] = coupling_phase;
        propagate::step_turns(inside ? tables_ : alone, drive, 1, state, &turns);
    } else {
        propagate::PhaseState state;
        state.coupling_phase_fringes[0] = coupling_phase;
        propagate::step_phases(phase_tables_, drive, 1, state, &turns);
    }
    return turns.lockin_fringes[1][0] * units::two_pi;
}

}  // namespace ringlock::test
