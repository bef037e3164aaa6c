#include "engine/readout/phase_bound.hpp"

#include <cmath>
#include <numbers>

#include "engine/gyro/theory.hpp"

namespace ringlock::readout {
namespace {

constexpr double quarter_fringe_rad = 0.5 * std::numbers::pi;

double squared(double value) { return value * value; }

}  // namespace

double phase_variance_bound_rad2(const Electronics& electronics, const BoundedTurn& turn, double first_distance_rad) {
    if (electronics.ideal) return 0.0;
    const double a = turn.acceleration_rad_s2;
    const double step =
        electronics.adc_bits > 0 ? 2.0 * Electronics::adc_range * std::ldexp(1.0, -electronics.adc_bits) : 0.0;
    const double sample = squared(electronics.detector_noise_relative) + squared(step) / 12.0;
    if (!(sample > 0.0)) return 0.0;
    if (!turn.pulses) return sample;
    const double tick_variance = electronics.clock_hz > 0.0 ? 1.0 / (12.0 * squared(electronics.clock_hz)) : 0.0;

    // Fisher's information of psi_0, -t_0 and the logarithm of psi'' after the turn.
    double information[3][3] = {};
    information[0][0] = 1.0 / sample;
    for (const bool after : {false, true}) {
        const double hysteresis = electronics.comparator_hysteresis_relative;
        for (std::size_t pulse = 0; pulse < kept_pulses; ++pulse) {
            const double nominal = first_distance_rad + static_cast<double>(pulse) * quarter_fringe_rad;
            if (nominal <= hysteresis) continue;
            const double distance = after ? nominal + hysteresis : nominal - hysteresis;
            const double speed = std::sqrt(2.0 * distance * a);
            const double variance = squared(electronics.comparator_noise_relative) + squared(speed) * tick_variance;
            if (!(variance > 0.0)) return 0.0;
            const double row[3] = {1.0, after ? speed : -speed, after ? distance : 0.0};
            for (std::size_t i = 0; i < 3; ++i) {
                for (std::size_t k = 0; k < 3; ++k) information[i][k] += row[i] * row[k] / variance;
            }
        }
    }
    const bool known = turn.acceleration_rms_relative == 0.0;
    if (!known) information[2][2] += 1.0 / squared(turn.acceleration_rms_relative);
    // Information on psi_0 that remains when the other unknowns are eliminated, one after the other.
    for (std::size_t gone = known ? 1 : 2; gone > 0; --gone) {
        for (std::size_t i = 0; i < gone; ++i) {
            const double factor = information[i][gone] / information[gone][gone];
            for (std::size_t k = 0; k < gone; ++k) information[i][k] -= factor * information[gone][k];
        }
    }
    return 1.0 / information[0][0];
}

double phase_bound_rad(const Electronics& electronics, const BoundedTurn& turn) {
    // Midpoints. The variance is smooth but for a jump where the nearest pulse appears, at the hysteresis.
    constexpr int points = 512;
    double sum = 0.0;
    for (int i = 0; i < points; ++i) {
        sum += phase_variance_bound_rad2(electronics, turn, quarter_fringe_rad * (i + 0.5) / points);
    }
    return std::sqrt(sum / points);
}

double walk_left_deg_rt_h(const gyro::Setup& setup, double phase_rms_rad) {
    return gyro::angle_random_walk_deg_rt_h(setup) * phase_rms_rad;
}

}  // namespace ringlock::readout
