#include "engine/propagate/half_turn.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>

#include "engine/core/error.hpp"

namespace ringlock::propagate {

namespace {

using Complex = std::complex<double>;

constexpr std::size_t slow_terms = 10;    // terms of the asymptotic series, and Taylor terms that its derivatives need
constexpr std::size_t matrix_order = 24;  // Taylor order of the 2x2 flow
constexpr double least_adiabaticity = 100.0;
constexpr double full_adiabaticity = 300.0;
constexpr double latest_sine = 0.9;  // the slow solution must hold from here to the middle

/// Taylor coefficients of g(t_s + scale_s x) scale_s in powers of x.
template <std::size_t N>
std::array<double, N> drive_series(const gyro::HalfCycle& half, double t_s, double scale_s) {
    std::array<double, N> g{};
    const double w = half.angular_frequency_rad_s();
    const double sine = std::sin(w * t_s);
    const double cosine = std::cos(w * t_s);
    double power = half.amplitude_rad * w * scale_s;
    for (std::size_t n = 0; n < N; ++n) {
        const double derivative = n % 4 == 0 ? sine : n % 4 == 1 ? cosine : n % 4 == 2 ? -sine : -cosine;
        g[n] = power * derivative;
        power *= w * scale_s / static_cast<double>(n + 1);
    }
    g[0] += half.rate_rad_s * scale_s;
    return g;
}

/// Time from which the motion is fast: g^2 >= adiabaticity * (greatest phase acceleration). NaN where there is none.
double fast_from_s(const gyro::HalfCycle& half, double adiabaticity) {
    const double w = half.angular_frequency_rad_s();
    const double peak = half.amplitude_rad * w;
    const double sine = (std::sqrt(adiabaticity * half.end_acceleration_rad_s2()) - half.rate_rad_s) / peak;
    if (!(sine <= latest_sine) || std::abs(half.rate_rad_s) >= peak) return std::nan("");
    return std::asin(std::max(sine, 0.0)) / w;
}

double choose_fast_from_s(const gyro::HalfCycle& half) {
    for (double adiabaticity = full_adiabaticity; adiabaticity >= least_adiabaticity; adiabaticity *= 0.9) {
        const double t = fast_from_s(half, adiabaticity);
        if (t == t) return t;
    }
    return std::nan("");
}

/// First column of a 2x2 flow, the Moebius map w -> (x w + conj y)/(y w + conj x).
struct Flow {
    Complex x = 1.0;
    Complex y = 0.0;
    double turned_rad = 0.0;  ///< argument of x, followed from 0 on: strong coupling turns it by whole fringes
};

/// The flow of x' = (i g/2) x - (b/2) y, y' = -(b/2) x - (i g/2) y from time 0 to `end_s`.
Flow flow(const gyro::HalfCycle& half, double b_rad_s, double end_s) {
    auto [x, y, turned_rad] = Flow();
    const double acceleration = half.end_acceleration_rad_s2();
    double t = 0.0;
    while (t < end_s) {
        // Terms of order 24 of exp(i (g h/2 + a h^2/4)) below 1e-17.
        const double rate = std::abs(half.drive_rate_rad_s(t)) + b_rad_s;
        const double h_wanted = std::min(3.6 / rate, std::sqrt(0.8 / acceleration));
        const double next = t + h_wanted >= end_s ? end_s : t + h_wanted;
        const double h = next - t;
        const auto g = drive_series<matrix_order>(half, t, h);
        const double b = b_rad_s * h;
        std::array<Complex, matrix_order + 1> xs{};
        std::array<Complex, matrix_order + 1> ys{};
        xs[0] = x;
        ys[0] = y;
        for (std::size_t n = 0; n < matrix_order; ++n) {
            Complex gx = 0.0;
            Complex gy = 0.0;
            for (std::size_t j = 0; j <= n; ++j) {
                gx += g[j] * xs[n - j];
                gy += g[j] * ys[n - j];
            }
            const double scale = 0.5 / static_cast<double>(n + 1);
            xs[n + 1] = scale * (Complex(-gx.imag(), gx.real()) - b * ys[n]);
            ys[n + 1] = scale * (-b * xs[n] - Complex(-gy.imag(), gy.real()));
        }
        x = 0.0;
        y = 0.0;
        for (std::size_t n = matrix_order + 1; n-- > 0;) {
            x += xs[n];
            y += ys[n];
        }
        turned_rad += std::arg(x * std::conj(xs[0]));  // some 2 rad a step, for |y| < |x|
        t = next;
    }
    return {x, y, turned_rad};
}

}  // namespace

Complex slow_solution(const gyro::HalfCycle& half, double b_rad_s, double t_s) {
    // K is iterated as a truncated Taylor series in x, t = t_s + x/|g|; each pass makes one more order of the
    // asymptotic series right and uses up one Taylor coefficient for the derivative.
    const double scale = 1.0 / half.angular_frequency_rad_s();
    const auto g = drive_series<slow_terms>(half, t_s, scale);
    const double b = b_rad_s * scale;
    std::array<Complex, slow_terms> k{};
    for (std::size_t pass = 0; pass < slow_terms; ++pass) {
        std::array<Complex, slow_terms> right{};
        for (std::size_t n = 0; n < slow_terms; ++n) {
            Complex square = n == 0 ? 1.0 : 0.0;
            for (std::size_t j = 0; j <= n; ++j) square += k[j] * k[n - j];
            const Complex derivative = n + 1 < slow_terms ? static_cast<double>(n + 1) * k[n + 1] : Complex(0.0);
            right[n] = 0.5 * b * square - Complex(0.0, 1.0) * derivative;
        }
        std::array<Complex, slow_terms> next{};  // right / g
        for (std::size_t n = 0; n < slow_terms; ++n) {
            Complex rest = right[n];
            for (std::size_t j = 1; j <= n; ++j) rest -= g[j] * next[n - j];
            next[n] = rest / g[0];
        }
        k = next;
    }
    return k[0];
}

bool has_fast_middle(const gyro::HalfCycle& half) { return choose_fast_from_s(half) == choose_fast_from_s(half); }

HalfTurn exact_half_turn(const gyro::HalfCycle& half, double b_rad_s) {
    const double start = choose_fast_from_s(half);
    if (!(start == start)) {
        throw RunError(
            fmt::format("turn map: a half cycle of {:.1f} fringes at an input of {:.4g} rad/s has no fast middle; "
                        "use propagation.method = \"direct\"",
                        half.amplitude_rad / units::pi, half.rate_rad_s));
    }
    const double middle = 0.5 * half.duration_s;
    const auto [x, y, turned_rad] = flow(half, b_rad_s, start);
    const Complex k = slow_solution(half, b_rad_s, start);
    // z = (w + i K)/(1 - i conj(K) w) after w -> (x w + conj y)/(y w + conj x); the common factor 1/sqrt(1 - |K|^2)
    // is real and drops out.
    const Complex ik = Complex(0.0, 1.0) * k;
    const Complex alpha = x + ik * y;
    const Complex beta = std::conj(y) + ik * std::conj(x);
    // From `start` to the middle the frame turns at g - b Re K. K goes as 1/(t - zero), and the substitution
    // t - zero = (start - zero) stretch^u takes that out.
    const double w = half.angular_frequency_rad_s();
    const double zero = std::asin(-half.rate_rad_s / (half.amplitude_rad * w)) / w;
    const double stretch = std::log((middle - zero) / (start - zero));
    const auto slow_rate = [&](double u) {
        const double since = (start - zero) * std::exp(stretch * u);
        return since * stretch * slow_solution(half, b_rad_s, zero + since).real();
    };
    const double slowed = b_rad_s * boost::math::quadrature::gauss<double, 20>::integrate(slow_rate, 0.0, 1.0);
    // The fringe from the argument that was followed, the rest from alpha itself: a sum over steps loses digits.
    // |K y| < |x|, so that alpha lies within a quarter turn of x.
    const double plain = half.plain_phase_rad(start);
    const double followed = 2.0 * (turned_rad + std::arg(alpha * std::conj(x))) - plain;
    const double rest = std::remainder(2.0 * std::arg(alpha) - plain, units::two_pi);
    HalfTurn turn;
    turn.shift_rad = rest + units::two_pi * std::nearbyint((followed - rest) / units::two_pi) - slowed;
    turn.z = beta / alpha;
    return turn;
}

}  // namespace ringlock::propagate
