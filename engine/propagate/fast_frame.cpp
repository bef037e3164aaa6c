#include "engine/propagate/fast_frame.hpp"

#include <algorithm>
#include <cmath>

#include "engine/gyro/fast_motion.hpp"

namespace ringlock::propagate {

namespace {

/// Terms of the asymptotic series, and Taylor terms in w (t' - t) that its derivatives need.
constexpr std::size_t most_terms = 10;
using Series = std::array<double, most_terms>;
using ComplexSeries = std::array<std::complex<double>, most_terms>;

/// Sine of the angle and of the angle after one to four quarters of a turn: each derivative of a sine adds a quarter.
std::array<double, 5> quarters(double angle_rad) {
    const double sine = std::sin(angle_rad);
    const double cosine = std::cos(angle_rad);
    return {sine, cosine, -sine, -cosine, sine};
}

/// Product of finite numbers. The operator of std::complex also looks for infinities, which takes most of its time.
std::complex<double> product(std::complex<double> a, std::complex<double> b) {
    return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

std::complex<double> times_i(std::complex<double> a) { return {-a.imag(), a.real()}; }

/// Terms of the asymptotic series that exceed the tolerance: the n-th is some n! (acceleration/(2 rate^2))^n of the
/// first, which is the coupling over the rate.
std::size_t terms_for(double tolerance_rad, double beat, double adiabaticity) {
    double term = beat;
    std::size_t n = 1;
    while (n < most_terms && term > tolerance_rad) term *= 0.5 * static_cast<double>(n++) / adiabaticity;
    return n;
}

}  // namespace

FastFrame::FastFrame(const gyro::HalfCycle& half, const gyro::Coupling& coupling, double t_s, double tolerance_rad) {
    using Complex = std::complex<double>;
    const double w = half.angular_frequency_rad_s();
    Series g{};
    Series b{};
    double factor = 1.0;
    double doubled = 1.0;
    double last_sine = 0.0;
    const std::array<double, 5> turned = quarters(w * t_s);
    const std::array<double, 5> turned_harmonic = quarters(2.0 * w * t_s + half.harmonic_phase_rad);
    for (std::size_t n = 0; n < most_terms; ++n) {
        const double sine = factor * turned[n % 4];
        const double grown_rad = half.amplitude_change_rad * (w * t_s / units::pi - 0.5);
        g[n] = w * (half.sign *
                        ((half.amplitude_rad + grown_rad) * sine + half.amplitude_change_rad / units::pi * last_sine) +
                    half.amplitude_rad * half.harmonic_ratio * doubled * turned_harmonic[n % 4]);
        last_sine = sine;
        b[n] = coupling.b_rad_s * half.sign * coupling.turn_asymmetry * factor * turned[n % 4 + 1];
        factor /= static_cast<double>(n + 1);
        doubled *= 2.0 / static_cast<double>(n + 1);
    }
    g[0] += half.rate_rad_s;
    b[0] += coupling.b_rad_s;

    std::size_t terms = most_terms;
    if (tolerance_rad > 0.0) {
        const double beat = std::abs(b[0] / g[0]) * (1.0 + std::abs(coupling.second_ratio));
        terms = terms_for(tolerance_rad, beat, g[0] * g[0] / gyro::greatest_acceleration_rad_s2(half));
        // The k-th harmonic is proportional to the k-th power of the beat, or, with a second harmonic of the coupling,
        // of its root.
        const double power = coupling.second_ratio == 0.0 ? beat : std::sqrt(beat);
        harmonics_ = std::clamp<std::size_t>(
            static_cast<std::size_t>(std::ceil(std::log(tolerance_rad) / std::log(std::min(power, 0.5)))), 2,
            most_harmonics);
    }

    // Fourier coefficients of the coupling: sin theta + ratio sin(2 theta + f).
    const Complex first(0.0, -0.5);
    const Complex second = coupling.second_ratio * first * std::polar(1.0, coupling.second_from_first_rad());
    const std::array<Complex, 3> coefficient{Complex{}, first, second};

    const int most_coefficient = coupling.second_ratio == 0.0 ? 1 : 2;
    const std::size_t terms_of_b = coupling.turn_asymmetry == 0.0 ? 1 : terms;

    // slope[k]: coefficient of d phi/d theta - 1. Each pass makes one more order right and uses up one Taylor term.
    std::array<ComplexSeries, most_harmonics + 1> slope{};
    for (std::size_t pass = 0; pass < terms; ++pass) {
        const std::size_t kept = terms - pass;
        std::array<ComplexSeries, most_harmonics + 1> next{};
        // Pass after pass, harmonics appear in order.
        const std::size_t present = std::min(harmonics_, (pass + 1) * static_cast<std::size_t>(most_coefficient));
        for (std::size_t k = 1; k <= present; ++k) {
            ComplexSeries coupled{};  // coefficient of F (1 + slope)
            if (k <= 2) coupled[0] = coefficient[k];
            for (int m = -most_coefficient; m <= most_coefficient; ++m) {
                const int from = static_cast<int>(k) - m;
                if (m == 0 || from == 0 || std::abs(from) > static_cast<int>(harmonics_)) continue;
                const Complex weight = m > 0 ? coefficient[m] : std::conj(coefficient[-m]);
                const ComplexSeries& source = slope[static_cast<std::size_t>(std::abs(from))];
                for (std::size_t n = 0; n < kept; ++n) {
                    coupled[n] += product(weight, from > 0 ? source[n] : std::conj(source[n]));
                }
            }
            const double per_order = w / static_cast<double>(k);
            for (std::size_t n = 0; n < kept; ++n) {
                Complex right{};
                for (std::size_t j = 0; j <= n && j < terms_of_b; ++j) right -= b[j] * coupled[n - j];
                if (n + 1 < terms) right += times_i(per_order * static_cast<double>(n + 1) * slope[k][n + 1]);
                for (std::size_t j = 1; j <= n; ++j) right -= g[j] * next[k][n - j];
                next[k][n] = right / g[0];
            }
        }
        slope = next;
    }
    for (std::size_t k = 1; k <= harmonics_; ++k) p_[k] = -times_i(slope[k][0]) / static_cast<double>(k);
    const Complex mean =
        product(coefficient[1], std::conj(slope[1][0])) + product(coefficient[2], std::conj(slope[2][0]));
    rate_beyond_drive_rad_s_ = 2.0 * b[0] * mean.real();
}

double FastFrame::correction_rad(double theta_rad) const {
    const std::complex<double> w = std::polar(1.0, theta_rad);
    std::complex<double> sum;
    for (std::size_t k = harmonics_; k >= 1; --k) sum = product(sum, w) + p_[k];
    return 2.0 * product(sum, w).real();
}

double FastFrame::theta_rad(double phi_rad) const {
    // The correction's slope is the coupling over the rate, a quarter at most: each pass gains as many digits again.
    double theta = phi_rad;
    for (int pass = 0; pass < 60; ++pass) {
        const double next = phi_rad - correction_rad(theta);
        const double moved = std::abs(next - theta);
        theta = next;
        if (moved < 1e-13) break;
    }
    return theta;
}

}  // namespace ringlock::propagate
