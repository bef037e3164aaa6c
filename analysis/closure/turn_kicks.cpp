#include "analysis/closure/turn_kicks.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/gyro/device.hpp"
#include "engine/gyro/motion.hpp"
#include "engine/propagate/phase_tables.hpp"

namespace ringlock::closure {

namespace {

using Complex = std::complex<double>;

/// One half turn by the angle at the dither's turn, in radians (propagate::PhaseTables).
struct ByDitherTurn {
    const propagate::PhaseTables::Part* part;

    double value(double angle_rad) const {
        double sum = 0.0;
        for (std::size_t k = 0; k < part->size(); ++k) {
            const auto& c = (*part)[k].coefficients;
            const double angle = static_cast<double>(k) * angle_rad;
            sum += c[0][0] * std::cos(angle) - (k > 0 ? c[1][0] * std::sin(angle) : 0.0);
        }
        return units::two_pi * sum;
    }
    double shift() const { return units::two_pi * (*part)[0].coefficients[1][0]; }

    double after(double theta) const { return value(theta); }
    /// theta = y + value(y), y = (angle at the middle) + shift: solved for the angle at the middle.
    double before(double theta) const {
        double y = theta;
        for (int i = 0; i < 30; ++i) y = theta - value(y);
        return theta - (y - shift());
    }
};

/// The zero-rate point next to the dither's turn at which a half cycle begins (or, turned round in time, ends): phase
/// gained from the dither's turn to it.
double to_zero_rate(const gyro::Device& device, int direction, double psi_rad) {
    const double a = device.dither_amplitude_rad;
    const gyro::HalfCycle after = device.half_cycle(direction, a);
    const gyro::HalfCycle before = device.half_cycle(-direction, a);
    const double scale = 1.0 / std::sqrt(after.end_acceleration_rad_s2());
    const gyro::PhaseSeries<16> ahead(after, device.coupling, 0.0, psi_rad, scale);
    const gyro::PhaseSeries<16> back(before, device.coupling, before.duration_s, psi_rad, scale);
    const bool late = direction * ahead.rate_rad_s(0.0) < 0.0;
    const auto& series = late ? ahead : back;
    double t = 0.0;
    for (int i = 0; i < 8; ++i) t -= series.rate_rad_s(t) / series.acceleration_rad_s2(t);
    return series.gain_rad(t);
}

}  // namespace

TurnKicks::TurnKicks(const gyro::Setup& setup) {
    constexpr double tolerance_rad = 1e-7;
    const gyro::Device device(setup);
    if (device.coupling.b_rad_s == 0.0) return;
    const double a = device.dither_amplitude_rad;
    const double rate = device.input_rate_rad_s;
    const double b = device.coupling.b_rad_s;
    propagate::PhaseTables tables(tolerance_rad);
    tables.make(0, device, {{a, a}, {rate, rate}, {b, b}});
    constexpr std::size_t phases = 4 * harmonics;
    Eigen::Matrix<double, Eigen::Dynamic, 2 * harmonics + 1> basis(phases, 2 * harmonics + 1);
    for (int parity = 0; parity < 2; ++parity) {
        const int direction = parity == 0 ? 1 : -1;
        const ByDitherTurn after{&tables.part(direction, 0)};
        const ByDitherTurn before{&tables.part(-direction, 1)};
        Eigen::Matrix<double, Eigen::Dynamic, 2> values(phases, 2);
        for (std::size_t j = 0; j < phases; ++j) {
            const double psi = units::two_pi * static_cast<double>(j) / static_cast<double>(phases);
            const double theta = psi + device.coupling.phase_rad;
            const double gain = to_zero_rate(device, direction, psi);
            for (std::size_t k = 0; k <= harmonics; ++k) {
                const double angle = static_cast<double>(k) * (psi + gain);
                basis(j, k) = std::cos(angle);
                if (k > 0) basis(j, harmonics + k) = std::sin(angle);
            }
            values(j, 0) = before.before(theta) + gain;
            values(j, 1) = after.after(theta) - gain;
        }
        const Eigen::MatrixXd c = basis.colPivHouseholderQr().solve(values);
        for (std::size_t side = 0; side < 2; ++side) {
            for (std::size_t k = 0; k <= harmonics; ++k) {
                series_[parity][side][k] = Complex(c(k, side), k > 0 ? -c(harmonics + k, side) : 0.0);
            }
        }
    }
}

TurnKicks::Kick TurnKicks::at(int direction, double phase_rad) const {
    const auto& sides = series_[direction > 0 ? 0 : 1];
    const Complex w = std::polar(1.0, phase_rad);
    const auto sum = [&](const Series& c, double& value, double& slope) {
        Complex v;
        Complex s;
        for (std::size_t k = harmonics; k >= 1; --k) {
            v = v * w + c[k];
            s = s * w + static_cast<double>(k) * c[k];
        }
        value = c[0].real() + (v * w).real();
        slope = -(s * w).imag();
    };
    Kick kick{};
    sum(sides[0], kick.before_rad, kick.before_slope);
    sum(sides[1], kick.after_rad, kick.after_slope);
    return kick;
}

}  // namespace ringlock::closure
