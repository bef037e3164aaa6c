#include "engine/propagate/between_turns.hpp"

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/gyro/fast_motion.hpp"
#include "engine/gyro/motion.hpp"
#include "engine/propagate/fast_frame.hpp"

namespace ringlock::propagate {

namespace {

/// Phase from the zero-rate point on from which the motion counts as fast. With ten terms of n!/phase^n the frame is
/// exact to 1e-12 rad there.
constexpr double fast_from_rad = 60.0;
constexpr double least_beat = 10.0;  ///< drive over coupling in fast motion
constexpr double frame_tolerance_rad = 1e-11;
constexpr double step_tolerance_rad = 1e-12;

/// The half cycle as its nearer turn sees it.
struct Side {
    int end;  ///< 0: the first turn is the nearer one
    gyro::HalfCycle upright;
    double since_turn_s;
    double zero_s;  ///< the zero-rate point, from the turn

    Side(const gyro::HalfCycle& half, double t_s)
        : end(t_s <= 0.5 * half.duration_s ? 0 : 1),
          upright(half.upright(end)),
          since_turn_s(end == 0 ? t_s : half.duration_s - t_s),
          zero_s(gyro::zero_rate_s(upright)) {}

    bool fast(const gyro::Coupling& coupling) const {
        if (since_turn_s <= zero_s) return false;
        const double rate = upright.drive_rate_rad_s(since_turn_s);
        if (rate < least_beat * gyro::strength_with_harmonics_rad_s(coupling)) return false;
        return upright.plain_phase_rad(since_turn_s) - upright.plain_phase_rad(zero_s) >= fast_from_rad;
    }
};

/// Phase that the lock-in adds from the nearer turn to `t_s`, by Taylor series [rad]; backward in time from the second.
double integrated_rad(const gyro::HalfCycle& half, const gyro::Coupling& coupling, int end, double psi_rad,
                      double t_s) {
    constexpr std::size_t order = 24;
    const double start_s = end == 0 ? 0.0 : half.duration_s;
    const double start_rad = half.plain_phase_rad(start_s);
    const double acceleration = gyro::greatest_acceleration_rad_s2(half);
    double at_s = start_s;
    double lockin_rad = 0.0;
    while (at_s != t_s) {
        const double plain_rad = half.plain_phase_rad(at_s);
        const double psi = std::remainder(psi_rad + (plain_rad - start_rad) + lockin_rad, units::two_pi);
        const double rate = std::abs(half.drive_rate_rad_s(at_s)) + coupling.b_rad_s;
        const gyro::PhaseSeries<order> series(half, coupling, at_s, psi, 1.0 / std::max(rate, std::sqrt(acceleration)));
        const double step_s = series.step_s(step_tolerance_rad);
        const double next_s = end == 0 ? std::min(at_s + step_s, t_s) : std::max(at_s - step_s, t_s);
        lockin_rad += series.gain_rad(next_s - at_s) - (half.plain_phase_rad(next_s) - plain_rad);
        at_s = next_s;
    }
    return lockin_rad;
}

/// Phase by which the frame gains on drive and input from the middle to the instant of `side` [rad]. The rate is
/// proportional to one over the time from the zero-rate point, and nodes are equidistant in the logarithm of that time.
double rotated_rad(const gyro::HalfCycle& half, const gyro::Coupling& coupling, const Side& side) {
    constexpr std::size_t nodes = 8;
    using Gauss = boost::math::quadrature::gauss<double, nodes>;
    const double from_zero_s = side.since_turn_s - side.zero_s;
    const double stretch = std::log((0.5 * half.duration_s - side.zero_s) / from_zero_s);
    if (!(stretch > 0.0)) return 0.0;
    double sum = 0.0;
    for (std::size_t node = 0; node < nodes; ++node) {
        const double u = 0.5 + 0.5 * (node % 2 == 0 ? 1.0 : -1.0) * Gauss::abscissa()[node / 2];
        const double since_zero_s = from_zero_s * std::exp(stretch * u);
        const double since_turn_s = side.zero_s + since_zero_s;
        const double at_s = side.end == 0 ? since_turn_s : half.duration_s - since_turn_s;
        const FastFrame frame(half, coupling, at_s, frame_tolerance_rad);
        sum += 0.5 * Gauss::weights()[node / 2] * since_zero_s * stretch * frame.rate_beyond_drive_rad_s();
    }
    return side.end == 0 ? -sum : sum;
}

}  // namespace

double lockin_between_turns_fringes(const PassedHalfCycle& passed, double t_s) {
    const gyro::HalfCycle& half = passed.half;
    if (passed.coupling.b_rad_s == 0.0) return passed.lockin_start_fringes;
    const Side side(half, t_s);
    if (std::isnan(passed.lockin_middle_fringes) || !side.fast(passed.coupling)) {
        const double lockin = side.end == 0 ? passed.lockin_start_fringes : passed.lockin_end_fringes;
        const double turned_rad = side.end == 0 ? 0.0 : half.plain_phase_total_rad();
        const double psi = units::two_pi * (passed.plain_start_fringes + lockin) + turned_rad;
        return lockin + integrated_rad(half, passed.coupling, side.end, psi, t_s) / units::two_pi;
    }
    // The turn map counts half of the half cycle's plain phase up to the middle. Where the halves are unlike, the
    // lock-in's phase in the middle contains the difference.
    const double unlike_rad = half.plain_phase_rad(0.5 * half.duration_s) - 0.5 * half.plain_phase_total_rad();
    const double in_frame_rad =
        units::two_pi * passed.lockin_middle_fringes - unlike_rad + rotated_rad(half, passed.coupling, side);
    const double phi = std::remainder(units::two_pi * passed.plain_start_fringes + half.plain_phase_rad(t_s) +
                                          in_frame_rad + passed.coupling.phase_rad,
                                      units::two_pi);
    const FastFrame frame(half, passed.coupling, t_s, frame_tolerance_rad);
    return (in_frame_rad + (frame.theta_rad(phi) - phi)) / units::two_pi;
}

}  // namespace ringlock::propagate
