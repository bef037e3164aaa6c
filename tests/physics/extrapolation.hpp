#pragma once
#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::test {

/// What straight lines through `pulses` pulses of either side leave of a kick, by first order and without noise: rms
/// error over rms kick. Units: a = 1, b = 1. By symmetry the common tau is the slope of either side.
inline double first_order_left(int pulses) {
    constexpr int phases = 720;
    double left2 = 0.0, kick2 = 0.0;
    for (int p = 0; p < phases; ++p) {
        const double x = units::two_pi * (p + 0.5) / phases;
        const double half_kick = 0.5 * std::sqrt(units::pi) * (std::sin(x) + std::cos(x));
        const double quarter = 0.5 * units::pi;
        const double near = (std::floor(x / quarter) + 1.0) * quarter - x;
        double t = 0.0, gained = 0.0;  // int_0^t sin(x + s^2/2) ds
        double n = 0.0, sg = 0.0, sy = 0.0, sgg = 0.0, sgy = 0.0;
        for (int k = 0; k < pulses; ++k) {
            const double end = std::sqrt(2.0 * (near + k * quarter));
            const auto f = [x](double s) { return std::sin(x + 0.5 * s * s); };
            constexpr int steps = 40;
            const double h = (end - t) / steps;
            for (int j = 0; j < steps; ++j) {
                const double s = t + j * h;
                gained += h / 6.0 * (f(s) + 4.0 * f(s + 0.5 * h) + f(s + h));
            }
            t = end;
            n += 1.0;
            sg += t;
            sy += gained;
            sgg += t * t;
            sgy += t * gained;
        }
        const double found = (sy * sgg - sg * sgy) / (n * sgg - sg * sg);
        left2 += (found - half_kick) * (found - half_kick);
        kick2 += half_kick * half_kick;
    }
    return std::sqrt(left2 / kick2);
}

}  // namespace ringlock::test
