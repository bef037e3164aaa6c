#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "engine/gyro/half_cycle.hpp"

namespace ringlock::gyro {

/// Taylor series in time of the solution of the equation of motion
///
///     psi' = g(t) + b(t) F(psi),      F = sin(psi + e)                                   (Gao & Deng 2007, eq. 1)
///
/// around a point (t, psi), g and b as HalfCycle and Coupling say. With S = sin(psi + e) and Q = cos(psi + e) the
/// coefficients follow from S' = Q psi', Q' = -S psi':
///
///     (n+1) psi_{n+1} = g_n + sum_{j=0..n} b_j F_{n-j},
///     n S_n = sum_{j=1..n} j psi_j Q_{n-j},   n Q_n = -sum_{j=1..n} j psi_j S_{n-j}.
///
/// A second harmonic of the coupling adds products of S and Q to F: sin 2x = 2 S Q, cos 2x = 1 - 2 S^2.
///
/// Coefficients are in powers of h/scale, which keeps them near one.
template <std::size_t Order>
class PhaseSeries {
   public:
    /// Expands at time `t_s` of `half`, where the phase is `psi_rad`. `scale_s` is the unit of time of the series.
    PhaseSeries(const HalfCycle& half, const Coupling& coupling, double t_s, double psi_rad, double scale_s)
        : scale_s_(scale_s) {
        const double w = half.angular_frequency_rad_s();
        const double x = w * scale_s;
        std::array<double, 4> sine{};      // sin(w t) and its derivatives in w t
        std::array<double, 4> harmonic{};  // sin(2 w t + f), likewise
        cycle(sine, w * t_s);
        cycle(harmonic, 2.0 * w * t_s + half.harmonic_phase_rad);
        // In units of the scale: A w, times (w scale)^n/n! or (2 w scale)^n/n!; the swing of b likewise
        double first = half.sign * half.amplitude_rad * x;
        double second = half.harmonic_ratio * half.amplitude_rad * x;
        const double b = coupling.b_rad_s * scale_s;
        double grown = half.sign * half.amplitude_change_rad * (t_s / half.duration_s - 0.5) * x;
        double growth = 0.0;  // of the term before: change w scale (x/pi) x^(n-1)/(n-1)!
        double swing = half.sign * coupling.turn_asymmetry * b;
        const bool swings = swing != 0.0;
        const bool doubles = coupling.second_ratio != 0.0;
        const double second_sine = coupling.second_ratio * std::cos(coupling.second_from_first_rad());
        const double second_cosine = coupling.second_ratio * std::sin(coupling.second_from_first_rad());
        std::array<double, Order> s{};
        std::array<double, Order> q{};
        std::array<double, Order> f{};
        std::array<double, Order> bs{};            // b_j
        std::array<double, Order + 1> weighted{};  // j psi_j
        s[0] = std::sin(psi_rad + coupling.phase_rad);
        q[0] = std::cos(psi_rad + coupling.phase_rad);
        psi_[0] = psi_rad;
        for (std::size_t n = 0; n < Order; ++n) {
            if (n > 0) {
                double sum_s = 0.0;
                double sum_q = 0.0;
                for (std::size_t j = 1; j <= n; ++j) {
                    sum_s += weighted[j] * q[n - j];
                    sum_q += weighted[j] * s[n - j];
                }
                s[n] = sum_s / static_cast<double>(n);
                q[n] = -sum_q / static_cast<double>(n);
                first *= x / static_cast<double>(n);
                second *= 2.0 * x / static_cast<double>(n);
                growth = n == 1 ? half.sign * half.amplitude_change_rad * x * x / units::pi
                                : growth * x / static_cast<double>(n - 1);
                grown *= x / static_cast<double>(n);
                swing *= x / static_cast<double>(n);
            }
            double right = first * sine[n % 4] + second * harmonic[n % 4];
            if (half.amplitude_change_rad != 0.0) {
                right += grown * sine[n % 4];
                if (n > 0) right += growth * sine[(n - 1) % 4];
            }
            if (n == 0) right += half.rate_rad_s * scale_s;
            f[n] = s[n];
            if (doubles) {
                double sq = 0.0;
                double ss = 0.0;
                for (std::size_t j = 0; j <= n; ++j) {
                    sq += s[j] * q[n - j];
                    ss += s[j] * s[n - j];
                }
                f[n] += second_sine * 2.0 * sq + second_cosine * ((n == 0 ? 1.0 : 0.0) - 2.0 * ss);
            }
            right += b * f[n];
            if (swings) {
                bs[n] = swing * sine[(n + 1) % 4];
                for (std::size_t j = 0; j <= n; ++j) right += bs[j] * f[n - j];
            }
            weighted[n + 1] = right;
            psi_[n + 1] = right / static_cast<double>(n + 1);
        }
    }

    /// Phase gained after `h_s` (may be negative) [rad].
    double gain_rad(double h_s) const {
        const double x = h_s / scale_s_;
        double sum = psi_[Order];
        for (std::size_t n = Order - 1; n >= 1; --n) sum = sum * x + psi_[n];
        return sum * x;
    }
    double phase_rad(double h_s) const { return psi_[0] + gain_rad(h_s); }

    /// Phase rate after `h_s` [rad/s].
    double rate_rad_s(double h_s) const {
        const double x = h_s / scale_s_;
        double sum = static_cast<double>(Order) * psi_[Order];
        for (std::size_t n = Order - 1; n >= 1; --n) sum = sum * x + static_cast<double>(n) * psi_[n];
        return sum / scale_s_;
    }

    /// Phase acceleration after `h_s` [rad/s^2].
    double acceleration_rad_s2(double h_s) const {
        const double x = h_s / scale_s_;
        double sum = 0.0;
        for (std::size_t n = Order; n >= 2; --n) sum = sum * x + static_cast<double>(n * (n - 1)) * psi_[n];
        return sum / (scale_s_ * scale_s_);
    }

    /// Longest step [s] whose last two terms stay below `tolerance_rad` (Jorba & Zou 2005, Experimental Mathematics
    /// 14).
    double step_s(double tolerance_rad) const {
        const double last =
            std::pow(tolerance_rad / (std::abs(psi_[Order]) + 1e-300), 1.0 / static_cast<double>(Order));
        const double before =
            std::pow(tolerance_rad / (std::abs(psi_[Order - 1]) + 1e-300), 1.0 / static_cast<double>(Order - 1));
        return scale_s_ * std::min(last, before);
    }

   private:
    /// sin x and its first three derivatives, which then repeat.
    static void cycle(std::array<double, 4>& to, double x) {
        to = {std::sin(x), std::cos(x), 0.0, 0.0};
        to[2] = -to[0];
        to[3] = -to[1];
    }

    double scale_s_;
    std::array<double, Order + 1> psi_{};
};

}  // namespace ringlock::gyro
