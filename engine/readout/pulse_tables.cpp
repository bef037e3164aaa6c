#include "engine/readout/pulse_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/core/error.hpp"
#include "engine/gyro/motion.hpp"

namespace ringlock::readout {

namespace {

constexpr double quarter_rad = 0.5 * units::pi;
constexpr double tolerance_rad = 1e-12;
constexpr double negligible_s = 2e-12;  // in the time of a pulse
constexpr double longest_root = 3.545;  // of twice the distance of any pulse, sqrt(4 pi)
using Series = gyro::PhaseSeries<20>;

/// Time, from the turn at which `half` begins (side +1) or ends (-1), at which the phase would stand still with the
/// value `psi_rad`.
double standstill_s(const gyro::HalfCycle& half, const gyro::Coupling& coupling, int side, double psi_rad) {
    const double origin = side > 0 ? 0.0 : half.duration_s;
    const double w = half.angular_frequency_rad_s();
    const double theta = psi_rad + coupling.phase_rad;
    const double pull =
        std::sin(theta) + coupling.second_ratio * std::sin(2.0 * theta + coupling.second_from_first_rad());
    double t = 0.0;
    for (int i = 0; i < 50; ++i) {
        const double cosine = half.sign * std::cos(w * (origin + t));
        const double rate =
            half.drive_rate_rad_s(origin + t) + coupling.b_rad_s * (1.0 + coupling.turn_asymmetry * cosine) * pull;
        // Close to the turn the drive's rate is nearly linear in time.
        const double slope = side * half.sign * half.end_acceleration_rad_s2(side > 0 ? 0 : 1);
        const double step = -rate / slope;
        t += step;
        if (std::abs(step) * w < 1e-15) break;
    }
    return t;
}

using PerPulse = std::array<double, kept_pulses>;

/// Times from the standstill to the first `pulses` distances beyond it.
PerPulse crossings_s(const gyro::HalfCycle& half, const gyro::Coupling& coupling, int side, double psi_rad,
                     const PerPulse& distances_rad, std::size_t pulses) {
    const double origin = side > 0 ? 0.0 : half.duration_s;
    const double start = standstill_s(half, coupling, side, psi_rad);
    const double up = side * half.sign;  // the phase rises on both sides of a minimum
    const double scale = 1.0 / std::sqrt(half.end_acceleration_rad_s2(side > 0 ? 0 : 1));
    PerPulse times{};
    std::size_t found = 0;
    double t = start;
    double psi = psi_rad;
    double gone = 0.0;
    while (found < pulses) {
        const Series series(half, coupling, origin + t, psi, scale);
        const double h = side * std::min(series.step_s(tolerance_rad), scale);
        const double reached = gone + up * series.gain_rad(h);
        while (found < pulses && reached >= distances_rad[found]) {
            // Newton from outside: the phase moves away ever faster.
            double at = h;
            for (int i = 0; i < 60; ++i) {
                const double step =
                    (gone + up * series.gain_rad(at) - distances_rad[found]) / (up * series.rate_rad_s(at));
                at -= step;
                if (std::abs(step) <= 1e-15 * scale) break;
            }
            times[found++] = t + at - start;
        }
        psi += series.gain_rad(h);
        gone = reached;
        t += h;
        if (std::abs(t) > 0.5 * half.duration_s) {
            throw RunError(fmt::format(
                "readout: fewer than {} quarter-fringe pulses between a turn and the middle of its half cycle",
                pulses));
        }
    }
    return times;
}

/// Polynomial through values at Chebyshev nodes, without the last terms that together make less than `negligible`.
std::array<double, PulseTables::terms> powers(const std::array<double, PulseTables::terms>& values, double negligible,
                                              std::size_t& used) {
    constexpr std::size_t n = PulseTables::terms;
    std::array<double, n> weights{};
    for (std::size_t k = 0; k < n; ++k) {
        for (std::size_t i = 0; i < n; ++i) {
            weights[k] += values[i] * std::cos(static_cast<double>(k) * units::pi * (static_cast<double>(i) + 0.5) / n);
        }
        weights[k] *= (k == 0 ? 1.0 : 2.0) / n;
    }
    std::size_t kept = n;
    for (double left_out = 0.0; kept > 1; --kept) {
        left_out += std::abs(weights[kept - 1]);
        if (left_out > negligible) break;
    }
    used = std::max(used, kept);
    std::array<double, n> sum{};
    std::array<double, n> before{};
    std::array<double, n> now{};
    before[0] = 1.0;
    now[1] = 1.0;
    for (std::size_t k = 0; k < kept; ++k) {
        const auto& chebyshev = k == 0 ? before : now;
        for (std::size_t p = 0; p < n; ++p) sum[p] += weights[k] * chebyshev[p];
        if (k == 0) continue;
        std::array<double, n> next{};
        for (std::size_t p = 0; p < n; ++p) next[p] = (p > 0 ? 2.0 * now[p - 1] : 0.0) - before[p];
        before = now;
        now = next;
    }
    return sum;
}

}  // namespace

void PulseTables::make(std::size_t lane, const gyro::Device& device, std::size_t pulses) {
    for (const std::size_t which : {0U, 1U}) {
        const gyro::HalfCycle half = device.half_cycle(which == 0 ? 1.0 : -1.0, device.dither_amplitude_rad);
        const double b = device.coupling.b_rad_s;
        inverse_bend[which][lane] = b != 0.0 ? std::sqrt(half.end_acceleration_rad_s2()) / b : 0.0;
    }
    for (const int direction : {1, -1}) {
        for (const int side : {-1, 1}) {
            const gyro::HalfCycle half = device.half_cycle(side * direction, device.dither_amplitude_rad);
            const double root = std::sqrt(half.end_acceleration_rad_s2(side > 0 ? 0 : 1));
            const double curve_per_rad = std::pow(half.angular_frequency_rad_s() / root, 2);
            for (std::size_t quarter = 0; quarter < quarters; ++quarter) {
                std::array<std::array<double, terms>, kept_pulses> values{};
                for (std::size_t i = 0; i < terms; ++i) {
                    const double node = std::cos(units::pi * (static_cast<double>(i) + 0.5) / terms);
                    const double first = quarter_rad * 0.25 * (1.0 + node) * (1.0 + node);
                    PerPulse distances{};
                    for (std::size_t k = 0; k < kept_pulses; ++k) {
                        distances[k] = first + static_cast<double>(k) * quarter_rad;
                    }
                    // The extremum lies before the end of its quarter in the direction in which the phase leaves it.
                    const double psi = direction * (static_cast<double>(quarter + 1) * quarter_rad - first);
                    const PerPulse seconds = crossings_s(half, device.coupling, side, psi, distances, pulses);
                    for (std::size_t pulse = 0; pulse < pulses; ++pulse) {
                        const double whole = std::abs(seconds[pulse]) * root / std::sqrt(2.0 * distances[pulse]);
                        values[pulse][i] = whole - sinusoid_factor(distances[pulse] * curve_per_rad);
                    }
                }
                for (std::size_t pulse = 0; pulse < pulses; ++pulse) {
                    const auto coefficients = powers(values[pulse], negligible_s * root / longest_root, used);
                    auto& row = times[direction > 0 ? 0 : 1][side < 0 ? 0 : 1][pulse][quarter];
                    for (std::size_t k = 0; k < terms; ++k) row[k][lane] = coefficients[k];
                }
            }
        }
    }
}

double PulseTables::sinusoid_factor(double share) {
    // The series of arcsin.
    const double half = 0.5 * share;
    double sum = 0.0;
    for (std::size_t k = std::size(arcsin_series); k-- > 0;) sum = sum * half + arcsin_series[k];
    return 1.0 + half * sum;
}

double PulseTables::at(const Times& times, std::size_t lane, std::size_t quarter, double first_distance_rad) {
    const double x = 2.0 * std::sqrt(first_distance_rad / quarter_rad) - 1.0;
    double sum = 0.0;
    for (std::size_t k = terms; k-- > 0;) sum = sum * x + times[quarter][k][lane];
    return sum;
}

}  // namespace ringlock::readout
