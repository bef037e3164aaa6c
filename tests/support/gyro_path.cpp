#include "tests/support/gyro_path.hpp"

#include <algorithm>
#include <cmath>

#include "engine/gyro/fast_motion.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "tests/support/direct.hpp"
#include "tests/support/turn_map.hpp"

namespace ringlock::test {

namespace {

std::unique_ptr<Propagator> make_propagator(const gyro::Device& device, double tolerance_rad) {
    const double a = device.dither_amplitude_rad;
    const double b = device.coupling.b_rad_s;
    bool fast = b > 0.0;
    for (const double sign : {1.0, -1.0}) {
        const gyro::HalfCycle half = device.half_cycle(sign, a);
        fast = fast && gyro::has_fast_middle(half.upright(0), b) && gyro::has_fast_middle(half.upright(1), b);
    }
    if (!fast) return std::make_unique<DirectIntegrator>(device.coupling, tolerance_rad);
    const propagate::HalfCycleRanges ranges{{a, a}, {device.input_rate_rad_s, device.input_rate_rad_s}, {b, b}};
    return std::make_unique<TurnMap>(device, ranges, tolerance_rad);
}

/// Half cycles that run backwards in time as they run forwards: psi(t) -> pi - psi(T - t), less twice the coupling
/// phase (docs/dev/turn-map.md).
bool reversible(const gyro::Device& device) {
    return device.harmonic_ratio == 0.0 && device.coupling.turn_asymmetry == 0.0 && device.coupling.second_ratio == 0.0;
}

}  // namespace

GyroPath::GyroPath(const gyro::Device& device, double tolerance_rad)
    : device_(device), tolerance_rad_(tolerance_rad), propagator_(make_propagator(device, tolerance_rad)) {
    restart(device.initial_phase_rad);
}

void GyroPath::restart(double initial_phase_rad) { turns_.assign(1, Phase(initial_phase_rad)); }

double GyroPath::turn_time_s(std::int64_t turn) const {
    return static_cast<double>(turn / 2) * device_.period_s() + (turn % 2 != 0 ? device_.positive_duration_s : 0.0);
}

Phase GyroPath::at_turn(std::int64_t turn) {
    while (static_cast<std::int64_t>(turns_.size()) <= turn) {
        const gyro::HalfCycle half = half_cycle_after(static_cast<std::int64_t>(turns_.size()) - 1);
        Phase next = turns_.back();
        const double lockin = propagator_->lockin_gain_rad(next.remainder_rad, half);
        next.add(half.plain_phase_total_rad());
        next.add(lockin);
        turns_.push_back(next);
    }
    return turns_[static_cast<std::size_t>(turn)];
}

std::vector<Phase> GyroPath::at(std::span<const double> times_s) {
    std::vector<propagate::Stretch> stretches;
    std::vector<Phase> phases;
    std::vector<bool> backwards;
    for (const double time : times_s) {
        const auto cycle = static_cast<std::int64_t>(std::floor(time / device_.period_s()));
        const double in_cycle = time - static_cast<double>(cycle) * device_.period_s();
        const bool falling = in_cycle >= device_.positive_duration_s;
        const std::int64_t turn = 2 * cycle + (falling ? 1 : 0);
        const gyro::HalfCycle half = half_cycle_after(turn);
        const double since = std::clamp(in_cycle - (falling ? device_.positive_duration_s : 0.0), 0.0, half.duration_s);
        const bool back = reversible(device_) && since > 0.5 * half.duration_s;
        const Phase from = at_turn(back ? turn + 1 : turn);
        const double start =
            back ? units::pi - from.remainder_rad - 2.0 * device_.coupling.phase_rad : from.remainder_rad;
        stretches.push_back({half, device_.coupling, start / units::two_pi, back ? half.duration_s - since : since});
        phases.push_back(from);
        backwards.push_back(back);
    }
    std::vector<propagate::StretchResult> results(stretches.size());
    propagate::integrate(stretches, tolerance_rad_, results);
    for (std::size_t i = 0; i < stretches.size(); ++i) {
        const double sign = backwards[i] ? -1.0 : 1.0;
        phases[i].add(sign * stretches[i].half.plain_phase_rad(stretches[i].end_s));
        phases[i].add(sign * results[i].lockin_rad);
    }
    return phases;
}

std::vector<std::int64_t> GyroPath::quarter_counts(double first_s, double interval_s, std::size_t intervals) {
    std::vector<double> times(intervals + 1);
    for (std::size_t i = 0; i < times.size(); ++i) times[i] = first_s + static_cast<double>(i) * interval_s;
    const std::vector<Phase> phases = at(times);
    std::vector<std::int64_t> counts(intervals);
    for (std::size_t i = 0; i < intervals; ++i) counts[i] = phases[i + 1].quarters() - phases[i].quarters();
    return counts;
}

}  // namespace ringlock::test
