#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "engine/gyro/half_cycle.hpp"

namespace ringlock::gyro {

/// Taylor series in time of the solution of the equation of motion
///
///     psi' = g(t) + b sin(psi + e),   g(t) = rate + sign A w sin(w t),   w = pi / duration       (Gao & Deng 2007, eq.
///     1)
///
/// around a point (t, psi). With S = sin(psi + e) and Q = cos(psi + e) the coefficients follow from
/// S' = Q psi', Q' = -S psi':
///
///     (n+1) psi_{n+1} = g_n + b S_n,   n S_n = sum_{j=1..n} j psi_j Q_{n-j},   n Q_n = -sum_{j=1..n} j psi_j S_{n-j}.
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
        const double sin_wt = std::sin(w * t_s);
        const double cos_wt = std::cos(w * t_s);
        double power = half.sign * half.amplitude_rad * x;  // A w scale (w scale)^n / n!
        const double b = coupling.b_rad_s * scale_s;
        std::array<double, Order> s{};
        std::array<double, Order> q{};
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
                power *= x / static_cast<double>(n);
            }
            set_sine_derivative(n, sin_wt, cos_wt);
            double g = power * sine_;
            if (n == 0) g += half.rate_rad_s * scale_s;
            weighted[n + 1] = g + b * s[n];
            psi_[n + 1] = weighted[n + 1] / static_cast<double>(n + 1);
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
    void set_sine_derivative(std::size_t n, double sin_wt, double cos_wt) {
        switch (n % 4) {  // n-th derivative of sine
            case 0:
                sine_ = sin_wt;
                break;
            case 1:
                sine_ = cos_wt;
                break;
            case 2:
                sine_ = -sin_wt;
                break;
            default:
                sine_ = -cos_wt;
                break;
        }
    }

    double scale_s_;
    double sine_ = 0.0;
    std::array<double, Order + 1> psi_{};
};

}  // namespace ringlock::gyro
