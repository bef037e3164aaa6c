#include "engine/gyro/fast_motion.hpp"

#include <algorithm>
#include <cmath>

namespace ringlock::gyro {

namespace {

constexpr double full_adiabaticity = 300.0;
constexpr double least_adiabaticity = 100.0;
constexpr double relaxed = 0.9;      // from one that is tried to the next: 104.6 is the last
constexpr double least_beat = 4.0;   // g over b: the slow solution is a series in b/g, too
constexpr double latest_sine = 0.9;  // the slow solution must hold from here to the middle
/// Phase from the zero-rate point to the middle. The slow solution's n-th term is proportional to n!/phase^n: below
/// this phase, ten terms are more than the asymptotic series can use.
constexpr double least_phase_rad = 10.0;

double needed_rate_rad_s(const HalfCycle& half, double b_rad_s, double adiabaticity) {
    return std::max(std::sqrt(adiabaticity * greatest_acceleration_rad_s2(half)), least_beat * b_rad_s);
}

/// From where on the motion must be fast.
double latest_s(const HalfCycle& half) { return std::asin(latest_sine) / half.angular_frequency_rad_s(); }

bool is_fast_from_there(const HalfCycle& half, double needed_rad_s) {
    const double late = latest_s(half);
    for (int i = 0; i <= 8; ++i) {
        if (!(half.drive_rate_rad_s(late + 0.125 * i * (0.5 * half.duration_s - late)) >= needed_rad_s)) return false;
    }
    return true;
}

/// Time from which the motion is fast: g^2 >= adiabaticity * (greatest phase acceleration), up to the middle. NaN where
/// the motion is fast at no time. It need not be exact: any time at which the motion is fast will do.
double fast_from_s(const HalfCycle& half, double b_rad_s, double adiabaticity) {
    const double fast = needed_rate_rad_s(half, b_rad_s, adiabaticity);
    if (!is_fast_from_there(half, fast)) return std::nan("");
    if (half.drive_rate_rad_s(0.0) >= fast) return 0.0;
    double early = 0.0;
    double late = latest_s(half);
    for (int i = 0; i < 30; ++i) {
        const double middle = 0.5 * (early + late);
        (half.drive_rate_rad_s(middle) >= fast ? late : early) = middle;
    }
    return late;
}

}  // namespace

double zero_rate_s(const HalfCycle& half) {
    const double w = half.angular_frequency_rad_s();
    return -std::asin(std::clamp(half.drive_rate_rad_s(0.0) / (half.end_amplitude_rad(0) * w), -1.0, 1.0)) / w;
}

double greatest_acceleration_rad_s2(const HalfCycle& half) {
    const double w = half.angular_frequency_rad_s();
    // The rate of a change has the derivative change w (w cos(w t) (t/T - 1/2) + sin(w t)/T).
    const double changing = std::abs(half.amplitude_change_rad) * (0.5 + 1.0 / units::pi);
    return w * w * (half.amplitude_rad * (1.0 + 2.0 * std::abs(half.harmonic_ratio)) + changing);
}

double fast_motion_from_s(const HalfCycle& half, double b_rad_s) {
    if (!has_fast_middle(half, b_rad_s)) return std::nan("");
    for (double adiabaticity = full_adiabaticity; adiabaticity >= least_adiabaticity; adiabaticity *= relaxed) {
        const double t = fast_from_s(half, b_rad_s, adiabaticity);
        if (!std::isnan(t)) return t;
    }
    return 0.5 * half.duration_s;
}

bool has_fast_middle(const HalfCycle& half, double b_rad_s) {
    const double middle_s = 0.5 * half.duration_s;
    if (half.drive_rate_rad_s(middle_s) < least_beat * b_rad_s) return false;
    return half.plain_phase_rad(middle_s) - half.plain_phase_rad(zero_rate_s(half)) >= least_phase_rad;
}

double strength_with_harmonics_rad_s(const Coupling& coupling) {
    return 2.0 * coupling.b_rad_s * (1.0 + std::abs(coupling.second_ratio)) * (1.0 + std::abs(coupling.turn_asymmetry));
}

}  // namespace ringlock::gyro
