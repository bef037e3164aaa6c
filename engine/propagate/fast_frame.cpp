#include "engine/propagate/fast_frame.hpp"

#include <cmath>

namespace ringlock::propagate {

namespace {

/// Terms of the asymptotic series, and Taylor terms in w (t' - t) that its derivatives need.
constexpr std::size_t frame_terms = 10;
using Series = std::array<double, frame_terms>;
using ComplexSeries = std::array<std::complex<double>, frame_terms>;

}  // namespace

FastFrame::FastFrame(const gyro::HalfCycle& half, const gyro::Coupling& coupling, double t_s) {
    using Complex = std::complex<double>;
    const double w = half.angular_frequency_rad_s();
    Series g{};
    Series b{};
    double factor = 1.0;
    double doubled = 1.0;
    for (std::size_t n = 0; n < frame_terms; ++n) {
        const double quarter = 0.5 * units::pi * static_cast<double>(n);  // each derivative turns by it
        g[n] = half.amplitude_rad * w *
               (half.sign * factor * std::sin(w * t_s + quarter) +
                half.harmonic_ratio * doubled * std::sin(2.0 * w * t_s + half.harmonic_phase_rad + quarter));
        b[n] = coupling.b_rad_s * half.sign * coupling.turn_asymmetry * factor * std::cos(w * t_s + quarter);
        factor /= static_cast<double>(n + 1);
        doubled *= 2.0 / static_cast<double>(n + 1);
    }
    g[0] += half.rate_rad_s;
    b[0] += coupling.b_rad_s;

    // Fourier coefficients of the coupling: sin theta + ratio sin(2 theta + f).
    const Complex first(0.0, -0.5);
    const Complex second = coupling.second_ratio * first * std::polar(1.0, coupling.second_from_first_rad());
    const std::array<Complex, 3> coefficient{Complex{}, first, second};

    // slope[k]: coefficient of d phi/d theta - 1. Each pass makes one more order right and uses up one Taylor term.
    std::array<ComplexSeries, harmonics + 1> slope{};
    for (std::size_t pass = 0; pass < frame_terms; ++pass) {
        const std::size_t kept = frame_terms - pass;
        std::array<ComplexSeries, harmonics + 1> next{};
        for (std::size_t k = 1; k <= harmonics; ++k) {
            ComplexSeries coupled{};  // coefficient of F (1 + slope)
            if (k <= 2) coupled[0] = coefficient[k];
            for (int m = -2; m <= 2; ++m) {
                const int from = static_cast<int>(k) - m;
                if (m == 0 || from == 0 || std::abs(from) > static_cast<int>(harmonics)) continue;
                const Complex weight = m > 0 ? coefficient[m] : std::conj(coefficient[-m]);
                const ComplexSeries& source = slope[static_cast<std::size_t>(std::abs(from))];
                for (std::size_t n = 0; n < kept; ++n) {
                    coupled[n] += weight * (from > 0 ? source[n] : std::conj(source[n]));
                }
            }
            const Complex per_order = w / Complex(0.0, static_cast<double>(k));
            for (std::size_t n = 0; n < kept; ++n) {
                Complex right{};
                for (std::size_t j = 0; j <= n; ++j) right -= b[j] * coupled[n - j];
                if (n + 1 < frame_terms) right -= per_order * static_cast<double>(n + 1) * slope[k][n + 1];
                for (std::size_t j = 1; j <= n; ++j) right -= g[j] * next[k][n - j];
                next[k][n] = right / g[0];
            }
        }
        slope = next;
    }
    for (std::size_t k = 1; k <= harmonics; ++k) p_[k] = slope[k][0] / Complex(0.0, static_cast<double>(k));
}

double FastFrame::correction_rad(double theta_rad) const {
    const std::complex<double> w = std::polar(1.0, theta_rad);
    std::complex<double> sum;
    for (std::size_t k = harmonics; k >= 1; --k) sum = sum * w + p_[k];
    return 2.0 * (sum * w).real();
}

}  // namespace ringlock::propagate
