#include "tests/support/extended_precision.hpp"

#include <algorithm>
#include <array>
#include <boost/math/constants/constants.hpp>
#include <stdexcept>

namespace ringlock::test {

namespace {

constexpr std::size_t order = 40;
// Terms of the Taylor series of g: the dither turns by less than 1e-2 rad in the longest step, at a turn, and
// (1e-2)^20/20! is below 1e-58.
constexpr std::size_t drive_terms = 20;

// On |time| = rho h the solution stays below exp(r h rho/2 + a h^2 rho^2/4), so that Cauchy bounds the terms of order
// 41 by that over rho^41, for every rho. With h = stride/(r + weight sqrt(a)) and a stride of 5 rad this is below 1e-31
// in fast motion (rho = 16) and below 1e-34 at a turn (rho = 11).
constexpr double turn_weight = 6.5;

Quad pi() { return boost::math::constants::pi<Quad>(); }

/// `angle_rad` without whole fringes, in [-pi, pi].
Quad wrapped(const Quad& angle_rad) { return angle_rad - 2 * pi() * round(angle_rad / (2 * pi())); }

/// Taylor coefficients of size sin(angle + frequency h x) in powers of x.
std::array<Quad, drive_terms> sine_series(const Quad& size, const Quad& angle, const Quad& frequency_h) {
    const Quad s = sin(angle);
    const Quad c = cos(angle);
    std::array<Quad, drive_terms> series;
    Quad power = size;
    for (std::size_t n = 0; n < drive_terms; ++n) {
        if (n > 0) power *= frequency_h / static_cast<int>(n);
        series[n] = power * (n % 2 == 0 ? s : c) * (n % 4 < 2 ? 1 : -1);
    }
    return series;
}

/// Terms that matter: beside the first, 1e-40 is far below rounding.
std::size_t length(const std::array<Quad, drive_terms>& series) {
    std::size_t terms = drive_terms;
    while (terms > 1 && abs(series[terms - 1]) < Quad(1e-40)) --terms;
    return terms;
}

}  // namespace

ExtendedHalfCycle::ExtendedHalfCycle(gyro::Coupling coupling, const gyro::HalfCycle& half, double stride_rad)
    : coupling_(coupling) {
    if (coupling.second_ratio != 0.0)
        throw std::invalid_argument("extended precision: second harmonic of the coupling");
    const Quad b = coupling.b_rad_s;
    const Quad end_s = half.duration_s;
    const Quad w = pi() / end_s;
    const Quad peak = half.amplitude_rad * w;
    const Quad b_swing = b * half.sign * coupling.turn_asymmetry;
    const Quad root_acceleration = sqrt(peak * w * (1 + 2 * abs(Quad(half.harmonic_ratio))));
    std::array<Quad, 4> now{1, 0, 0, 0};  // x_re, x_im, y_re, y_im: the first column of the flow
    Quad t = 0;
    while (t < end_s) {
        const Quad drive = half.rate_rad_s + peak * (half.sign * sin(w * t) +
                                                     half.harmonic_ratio * sin(2 * w * t + half.harmonic_phase_rad));
        Quad h = stride_rad / (abs(drive) + b + abs(b_swing) + turn_weight * root_acceleration);
        const bool last = t + h >= end_s;
        if (last) h = end_s - t;

        auto g = sine_series(peak * half.sign * h / 2, w * t, w * h);  // half of g h
        const auto harmonic =
            sine_series(peak * half.harmonic_ratio * h / 2, 2 * w * t + half.harmonic_phase_rad, 2 * w * h);
        for (std::size_t n = 0; n < drive_terms; ++n) g[n] += harmonic[n];
        g[0] += half.rate_rad_s * h / 2;
        auto bs = sine_series(b_swing * h / 2, w * t + pi() / 2, w * h);  // half of b h
        bs[0] += b * h / 2;
        const std::size_t g_terms = length(g);
        const std::size_t b_terms = length(bs);

        std::array<std::array<Quad, 4>, order + 1> s;
        s[0] = now;
        for (std::size_t n = 0; n < order; ++n) {
            std::array<Quad, 4> gs;
            std::array<Quad, 4> bx;
            for (std::size_t j = 0; j < std::min(g_terms, n + 1); ++j) {
                for (std::size_t c = 0; c < 4; ++c) gs[c] += g[j] * s[n - j][c];
            }
            for (std::size_t j = 0; j < std::min(b_terms, n + 1); ++j) {
                for (std::size_t c = 0; c < 4; ++c) bx[c] += bs[j] * s[n - j][c];
            }
            const int next = static_cast<int>(n) + 1;
            s[n + 1] = {(-gs[1] - bx[2]) / next, (gs[0] - bx[3]) / next, (gs[3] - bx[0]) / next,
                        (-gs[2] - bx[1]) / next};
        }
        now = {};
        for (std::size_t n = order + 1; n-- > 0;) {
            for (std::size_t c = 0; c < 4; ++c) now[c] += s[n][c];
        }
        t = last ? end_s : t + h;
    }
    // w -> (x w + conj y)/(y w + conj x): alpha = x, beta = conj y, z = beta/alpha.
    const auto& [x_re, x_im, y_re, y_im] = now;
    const Quad norm = x_re * x_re + x_im * x_im;
    const Quad plain_rad = half.rate_rad_s * end_s + 2 * Quad(half.sign) * half.amplitude_rad;
    shift_rad_ = wrapped(2 * atan2(x_im, x_re) - plain_rad);
    z_re_ = (y_re * x_re - y_im * x_im) / norm;
    z_im_ = -(y_re * x_im + y_im * x_re) / norm;
    group_error_ = abs(norm - (y_re * y_re + y_im * y_im) - 1);
}

Quad ExtendedHalfCycle::lockin_gain_rad(double phase_rad) const {
    const Quad phase = Quad(phase_rad) + coupling_.phase_rad;
    const Quad c = cos(phase);
    const Quad s = sin(phase);
    return shift_rad_ + 2 * atan2(z_im_ * c - z_re_ * s, 1 + z_re_ * c + z_im_ * s);
}

}  // namespace ringlock::test
