#include "engine/propagate/turn_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/core/error.hpp"
#include "engine/propagate/circle_map.hpp"
#include "engine/propagate/constant_rate.hpp"

namespace ringlock::propagate {

namespace {

constexpr std::size_t most_nodes = 40;

/// The half cycle seen with its sign turned to +1: psi -> -psi maps the equation onto itself with g -> -g.
gyro::HalfCycle upright(const gyro::HalfCycle& half) {
    return {1.0, half.amplitude_rad, half.duration_s, half.sign * half.rate_rad_s};
}

std::array<double, 3> as_array(const HalfTurn& turn) { return {turn.shift_rad, turn.z.real(), turn.z.imag()}; }

}  // namespace

HalfTurnTable::HalfTurnTable(const gyro::HalfCycle& half, double b_rad_s, double lowest_rad, double highest_rad,
                             double tolerance_rad)
    : lowest_rad_(lowest_rad), highest_rad_(highest_rad) {
    if (lowest_rad == highest_rad) {
        fit(half, b_rad_s, 1);
        return;
    }
    for (std::size_t nodes = 3; nodes <= most_nodes; ++nodes) {
        fit(half, b_rad_s, nodes);
        measured_error_rad_ = 0.0;
        gyro::HalfCycle probe = half;
        for (std::size_t i = 0; i <= 4; ++i) {  // between the nodes: extrema of the node polynomial and the ends
            const double x = -std::cos(units::pi * static_cast<double>(i) / 4.0 * 0.998 + 0.003);
            probe.amplitude_rad = 0.5 * ((highest_rad_ + lowest_rad_) + x * (highest_rad_ - lowest_rad_));
            const auto exact = as_array(exact_half_turn(probe, b_rad_s));
            const auto table = as_array(at(probe.amplitude_rad));
            // A half turn's phase depends on shift directly and on z through 2 arg(1 + z ...).
            measured_error_rad_ = std::max({measured_error_rad_, std::abs(exact[0] - table[0]),
                                            2.0 * std::hypot(exact[1] - table[1], exact[2] - table[2])});
        }
        if (2.0 * measured_error_rad_ <= tolerance_rad) return;  // two half turns to a turn
    }
    throw RunError(
        fmt::format("turn map: {} nodes over amplitudes {:.6g} to {:.6g} rad leave an error of {:.3g} rad, above "
                    "{:.3g}; raise propagation.turn_map_tolerance_rad or narrow the spread of amplitudes",
                    most_nodes, lowest_rad_, highest_rad_, measured_error_rad_, tolerance_rad));
}

void HalfTurnTable::fit(const gyro::HalfCycle& half, double b_rad_s, std::size_t nodes) {
    coefficients_.assign(nodes, {0.0, 0.0, 0.0});
    gyro::HalfCycle node = half;
    for (std::size_t i = 0; i < nodes; ++i) {
        const double angle = units::pi * (static_cast<double>(i) + 0.5) / static_cast<double>(nodes);
        node.amplitude_rad = 0.5 * ((highest_rad_ + lowest_rad_) + std::cos(angle) * (highest_rad_ - lowest_rad_));
        const auto value = as_array(exact_half_turn(node, b_rad_s));
        for (std::size_t n = 0; n < nodes; ++n) {
            const double weight =
                (n == 0 ? 1.0 : 2.0) / static_cast<double>(nodes) * std::cos(static_cast<double>(n) * angle);
            for (std::size_t c = 0; c < 3; ++c) coefficients_[n][c] += weight * value[c];
        }
    }
}

HalfTurn HalfTurnTable::at(double amplitude_rad) const {
    const double width = highest_rad_ - lowest_rad_;
    const double x = width > 0.0 ? (2.0 * amplitude_rad - highest_rad_ - lowest_rad_) / width : 0.0;
    std::array<double, 3> value{};
    for (std::size_t c = 0; c < 3; ++c) {  // Clenshaw
        double last = 0.0;
        double before = 0.0;
        for (std::size_t n = coefficients_.size() - 1; n > 0; --n) {
            const double next = coefficients_[n][c] + 2.0 * x * last - before;
            before = last;
            last = next;
        }
        value[c] = coefficients_[0][c] + x * last - before;
    }
    return {value[0], {value[1], value[2]}};
}

TurnMap::TurnMap(gyro::Coupling coupling, const gyro::HalfCycle& positive, const gyro::HalfCycle& negative, Range range,
                 double tolerance_rad)
    : coupling_(coupling),
      positive_{positive.duration_s, positive.rate_rad_s,
                HalfTurnTable(upright(positive), coupling.b_rad_s, range.lowest_rad, range.highest_rad, tolerance_rad)},
      negative_{
          negative.duration_s, negative.rate_rad_s,
          HalfTurnTable(upright(negative), coupling.b_rad_s, range.lowest_rad, range.highest_rad, tolerance_rad)} {}

double TurnMap::lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half, double mid_step_rad) {
    if (half.amplitude_rad == 0.0) return without_dither_rad(phase_rad, half, mid_step_rad);
    const Side& side = half.sign > 0 ? positive_ : negative_;
    HalfTurn turn;
    if (half.rate_rad_s == side.rate_rad_s && half.duration_s == side.duration_s &&
        side.table.covers(half.amplitude_rad)) {
        turn = side.table.at(half.amplitude_rad);
    } else {
        turn = exact_half_turn(upright(half), coupling_.b_rad_s);
        ++outside_;
    }
    // Turn to middle: phi = x + P/2 + shift + 2 arg(1 + z exp(-i x)); middle to turn is the same map reversed in time,
    // psi -> pi - psi: with u = phi + P/2 + shift the last phase is u - 2 arg(1 + z exp(i u)).
    const double x = half.sign * (phase_rad + coupling_.phase_rad);
    double gain = turn.shift_rad + twice_arg(turn.z, -x);
    if (mid_step_rad != 0.0) gain += step_in_frame_rad(half, x + gain, half.sign * mid_step_rad);
    gain += turn.shift_rad;
    const double u = x + half.sign * (half.plain_phase_total_rad() + mid_step_rad) + gain;
    return half.sign * (gain - twice_arg(turn.z, u));
}

double TurnMap::without_dither_rad(double phase_rad, const gyro::HalfCycle& half, double mid_step_rad) const {
    const double middle = 0.5 * half.duration_s;
    const double first = constant_rate_gain_rad(phase_rad, half.rate_rad_s, middle, coupling_);
    const double there = phase_rad + half.rate_rad_s * middle + first + mid_step_rad;
    return first + constant_rate_gain_rad(there, half.rate_rad_s, middle, coupling_);
}

double TurnMap::step_in_frame_rad(const gyro::HalfCycle& half, double gained_rad, double step_rad) const {
    // phi = psi + 2 arg(1 + i k exp(-i psi)) at the middle, k = (g - sqrt(g^2 - b^2))/b.
    const double b = coupling_.b_rad_s;
    const double g = half.amplitude_rad * half.angular_frequency_rad_s() + half.sign * half.rate_rad_s;
    const std::complex<double> ik(0.0, b / (g + std::sqrt(g * g - b * b)));
    const double phi = gained_rad + 0.5 * half.sign * half.plain_phase_total_rad();
    const double to_phase = twice_arg(-ik, -phi);
    const double psi = phi + to_phase + step_rad;
    return to_phase + twice_arg(ik, -psi);
}

double TurnMap::measured_error_rad() const {
    return std::max(positive_.table.measured_error_rad(), negative_.table.measured_error_rad());
}

std::size_t TurnMap::nodes() const { return std::max(positive_.table.nodes(), negative_.table.nodes()); }

}  // namespace ringlock::propagate
