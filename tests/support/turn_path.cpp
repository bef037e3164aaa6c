#include "tests/support/turn_path.hpp"

#include <cmath>

#include "engine/core/error.hpp"
#include "engine/gyro/motion.hpp"

namespace ringlock::test {

namespace {

// The extremum is a microsecond away unless the input is fast, the pulses tens of them; 1e-10 rad there is 1e-15 s.
using NearSeries = gyro::PhaseSeries<10>;
using FarSeries = gyro::PhaseSeries<20>;
using PulseSeries = gyro::PhaseSeries<18>;
constexpr double extremum_tolerance_rad = 1e-14;
constexpr double pulse_tolerance_rad = 1e-10;
constexpr int most_steps = 2000;

/// Root of `value` with slope `slope` between 0 and `end`, where `value` changes sign: Newton, kept inside by
/// bisection.
template <class Value, class Slope>
double root(Value value, Slope slope, double guess, double end) {
    double low = 0.0;
    double high = end;
    const bool rising = value(high) > 0.0;
    double h = guess;
    for (int i = 0; i < 60; ++i) {
        const double v = value(h);
        if (v == 0.0) return h;
        ((v > 0.0) == rising ? high : low) = h;
        double next = h - v / slope(h);
        if (!((next - low) * (next - high) < 0.0)) next = 0.5 * (low + high);
        if (std::abs(next - h) <= 1e-12 * std::abs(end)) return next;
        h = next;
    }
    return h;
}

}  // namespace

TurnPath::TurnPath(const gyro::HalfCycle& before, const gyro::HalfCycle& after, const gyro::Coupling& coupling,
                   double phase_rad)
    : before_(before),
      after_(after),
      coupling_(coupling),
      scale_s_(std::sqrt(1.0 / after.end_acceleration_rad_s2())),
      zero_phase_rad_(phase_rad) {
    // A minimum (the half cycle after it is positive) whose phase still falls at the dither's turn lies after it.
    const double theta = phase_rad + coupling_.phase_rad;
    const double rate =
        after_.drive_rate_rad_s(0.0) +
        coupling_.b_rad_s * (1.0 + coupling_.turn_asymmetry * after_.sign) *
            (std::sin(theta) + coupling_.second_ratio * std::sin(2.0 * theta + coupling_.second_from_first_rad()));
    if (rate == 0.0) return;
    const int side = rate * after_.sign < 0.0 ? 1 : -1;
    // Fringes between the dither's turn and the phase's: a fast input needs long steps.
    const double distance_rad = 0.5 * rate * rate / after_.end_acceleration_rad_s2();
    const bool found =
        distance_rad < 1.0 ? walk_to_zero_rate<NearSeries>(rate, side) : walk_to_zero_rate<FarSeries>(rate, side);
    if (!found) {
        throw RunError(
            "readout: the phase does not reverse near a turn of the dither; the input rate is too high for it");
    }
}

template <class Series>
bool TurnPath::walk_to_zero_rate(double rate_rad_s, int side) {
    for (int step = 0; step < most_steps; ++step) {
        const Place here = place(zero_time_s_, side);
        if (here.limit_s <= 0.0) return false;
        const Series series(*here.half, coupling_, here.t_s, zero_phase_rad_, scale_s_);
        const double h = side * std::min(series.step_s(extremum_tolerance_rad), here.limit_s);
        if (series.rate_rad_s(h) * rate_rad_s > 0.0) {
            zero_phase_rad_ = series.phase_rad(h);
            zero_time_s_ += h;
            continue;
        }
        const double at = root([&](double x) { return series.rate_rad_s(x); },
                               [&](double x) { return series.acceleration_rad_s2(x); }, 0.0, h);
        zero_phase_rad_ = series.phase_rad(at);
        zero_time_s_ += at;
        return true;
    }
    return false;
}

TurnPath::Place TurnPath::place(double time_s, int side) const {
    const bool in_after = time_s > 0.0 || (time_s == 0.0 && side > 0);
    const gyro::HalfCycle& half = in_after ? after_ : before_;
    const double t = in_after ? time_s : before_.duration_s + time_s;
    double limit = 0.0;
    if (in_after) {
        limit = side > 0 ? 0.5 * half.duration_s - t : t;
    } else {
        limit = side > 0 ? -time_s : t - 0.5 * half.duration_s;
    }
    return {&half, t, limit};
}

double TurnPath::plain_gain_rad() const {
    if (zero_time_s_ >= 0.0) return after_.plain_phase_rad(zero_time_s_);
    // Backwards in time from the end of `before`: its rates change their signs.
    const gyro::HalfCycle mirrored{-before_.sign,       before_.amplitude_rad,  before_.duration_s,
                                   -before_.rate_rad_s, before_.harmonic_ratio, -before_.harmonic_phase_rad};
    return mirrored.plain_phase_rad(-zero_time_s_);
}

double TurnPath::acceleration_rad_s2(int side) const {
    const gyro::HalfCycle& half = side > 0 ? after_ : before_;
    const double w = half.angular_frequency_rad_s();
    const double wt = w * zero_time_s_;
    // The half cycle before ends here, half a turn of w t later.
    const double first = (side > 0 ? half.sign : -half.sign) * std::cos(wt);
    return half.amplitude_rad * w * w *
           std::abs(first + 2.0 * half.harmonic_ratio * std::cos(2.0 * wt + half.harmonic_phase_rad));
}

std::array<double, 2> TurnPath::crossing_times_s(int side, const std::array<double, 2>& distance_rad) const {
    const std::vector<double> times = crossing_times_s(side, std::span<const double>(distance_rad));
    return {times[0], times[1]};
}

std::vector<double> TurnPath::crossing_times_s(int side, std::span<const double> distance_rad) const {
    // The phase moves away from the extremum in the direction of `after` on both sides.
    const double sign = after_.sign;
    std::vector<double> times(distance_rad.size());
    std::size_t found = 0;
    double time = zero_time_s_;
    double phase = zero_phase_rad_;
    for (int step = 0; step < most_steps; ++step) {
        const Place here = place(time, side);
        if (here.limit_s <= 0.0) break;
        const PulseSeries series(*here.half, coupling_, here.t_s, phase, scale_s_);
        const double h = side * std::min(series.step_s(pulse_tolerance_rad), here.limit_s);
        const double gone = sign * (phase - zero_phase_rad_);
        const double reached = gone + sign * series.gain_rad(h);
        while (found < times.size() && reached >= distance_rad[found]) {
            const double wanted = distance_rad[found] - gone;
            times[found] = time + root([&](double x) { return sign * series.gain_rad(x) - wanted; },
                                       [&](double x) { return sign * series.rate_rad_s(x); },
                                       h * std::sqrt(wanted / (reached - gone)), h);
            ++found;
        }
        if (found == times.size()) return times;
        phase = series.phase_rad(h);
        // Land on the dither's turn exactly: the half cycle changes there.
        time = std::abs(h) == here.limit_s && (time > 0.0) != (side > 0) && time != 0.0 ? 0.0 : time + h;
    }
    throw RunError(
        "readout: fewer quarter-fringe pulses than asked for between a turn and the middle of its half cycle");
}

}  // namespace ringlock::test
