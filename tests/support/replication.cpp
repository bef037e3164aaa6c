#include "tests/support/replication.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/special_functions/bessel.hpp>
#include <cmath>
#include <complex>
#include <limits>

#include "engine/core/units.hpp"
#include "engine/gyro/theory.hpp"
#include "tests/support/turn_path.hpp"

namespace ringlock::test::replication {

namespace {

bool begins_at_minimum(Span span) { return span == Span::minimum_to_minimum || span == Span::minimum_and_maximum; }
bool whole_turns(Span span) { return span == Span::minimum_and_maximum || span == Span::maximum_and_minimum; }

double cycle_s(const gyro::Setup& setup) { return 1.0 / setup.dither_frequency_hz; }

double deg_h_per_rad(const gyro::Setup& setup) {
    return setup.scale_factor_arcsec / units::two_pi / cycle_s(setup);  // 1 deg/h is 1 arcsec/s
}

/// Correction as a phasor: Im(it exp(i psi)), psi the phase at the first extremum, in whole turn kicks.
std::complex<double> phasor(const gyro::Setup& setup, Span span, double shift_rad) {
    const gyro::Device device(setup);
    const double theta = device.input_rate_rad_s * 0.5 * device.period_s();
    const double w = units::two_pi * setup.dither_frequency_hz;
    const double acceleration = device.dither_amplitude_rad * w * w;
    const double q = 0.5 * device.input_rate_rad_s * device.input_rate_rad_s / acceleration;
    const double swing = 2.0 * (device.dither_amplitude_rad + shift_rad + q);
    const int turns = whole_turns(span) ? 2 : 3;
    double phase = 0.0;
    double direction = begins_at_minimum(span) ? 1.0 : -1.0;
    std::complex<double> sum;
    for (int i = 0; i < turns; ++i) {
        const double weight = turns == 3 && i != 1 ? 0.5 : 1.0;
        sum += weight * std::polar(1.0, phase + direction * 0.25 * units::pi);
        phase += theta + direction * swing;
        direction = -direction;
    }
    return sum;
}

/// The phase near one turn of a path.
struct Turn {
    double sign;  ///< +1: minimum
    TurnPath path;
    double lockin_to_extremum_rad;

    Turn(GyroPath& gyro, std::int64_t turn)
        : sign(turn % 2 == 0 ? 1.0 : -1.0),
          path(gyro.half_cycle_after(turn + 1), gyro.half_cycle_after(turn), gyro.device().coupling,
               gyro.at_turn(turn).remainder_rad),
          lockin_to_extremum_rad(path.zero_rate_phase_rad() - gyro.at_turn(turn).remainder_rad -
                                 path.plain_gain_rad()) {}

    /// b/2 sqrt(pi/a) (sin psi_0 +- cos psi_0) on one side.
    double half_kick_rad(double b_rad_s, int side, double turn_time_s, double clock_hz) const {
        const double psi = path.zero_rate_phase_rad();
        double a = path.acceleration_rad_s2(side);
        if (clock_hz > 0.0) {
            const double quarter = 0.5 * units::pi;
            const double upright = sign * psi / quarter;
            const double near = (std::floor(upright) + 1.0 - upright) * quarter;
            const auto times = path.crossing_times_s(side, {near, near + quarter});
            const auto ticks = [&](double t) { return std::floor((turn_time_s + t) * clock_hz); };
            const double interval = std::abs(ticks(times[1]) - ticks(times[0])) / clock_hz;
            // A clock too slow to tell the pulses apart tells nothing.
            const double roots = std::sqrt(2.0 * (near + quarter)) - std::sqrt(2.0 * near);
            if (interval > 0.0) a = roots * roots / (interval * interval);
        }
        return 0.5 * b_rad_s * std::sqrt(units::pi / a) * (std::sin(psi) + sign * std::cos(psi));
    }
};

/// Phase that the lock-in adds from one turn to another.
double lockin_between_turns_rad(GyroPath& path, std::int64_t first, std::int64_t last) {
    double sum = 0.0;
    for (std::int64_t turn = first; turn < last; ++turn) {
        const Phase from = path.at_turn(turn);
        const Phase to = path.at_turn(turn + 1);
        Phase gain(to.remainder_rad - from.remainder_rad);
        gain.fringes += to.fringes - from.fringes;
        gain.add(-path.half_cycle_after(turn).plain_phase_total_rad());
        sum += gain.value_rad();
    }
    return sum;
}

/// Phase that the lock-in adds from the middle of the half cycle before a turn to the turn, or on to the next middle.
double lockin_to_middle_rad(GyroPath& path, std::int64_t turn, bool after) {
    const gyro::HalfCycle half = path.half_cycle_after(after ? turn : turn + 1);
    const double time = path.turn_time_s(turn) + (after ? 0.5 : -0.5) * half.duration_s;
    const Phase middle = path.at(std::vector<double>{time})[0];
    const Phase at = path.at_turn(turn);
    Phase gain(middle.remainder_rad - at.remainder_rad);
    gain.fringes += middle.fringes - at.fringes;
    const double plain = half.plain_phase_rad(0.5 * half.duration_s);
    gain.add(after ? -plain : half.plain_phase_total_rad() - plain);
    return after ? gain.value_rad() : -gain.value_rad();
}

}  // namespace

gyro::Setup paper_device(double rate_deg_h) {
    gyro::Setup setup;
    setup.scale_factor_arcsec = 0.5;
    setup.lockin_threshold_deg_h = 300.0;
    setup.dither_frequency_hz = 783.4 / units::two_pi;
    setup.dither_peak_rate_deg_s = 109.1;
    setup.input_rate_deg_h = rate_deg_h;
    return setup;
}

double turn_kick_deg_h(const gyro::Setup& setup) { return gyro::turn_kick_rad(setup) * deg_h_per_rad(setup); }

double largest_correction_deg_h(const gyro::Setup& setup, Span span, double shift_rad) {
    return std::abs(phasor(setup, span, shift_rad)) * turn_kick_deg_h(setup);
}

double first_order_correction_deg_h(const gyro::Setup& setup, Span span, double phase_rad, double shift_rad) {
    return (phasor(setup, span, shift_rad) * std::polar(1.0, phase_rad)).imag() * turn_kick_deg_h(setup);
}

Cycle exact_cycle(GyroPath& path, Span span, double clock_hz) {
    const bool whole = whole_turns(span);
    const std::int64_t first = begins_at_minimum(span) ? 2 : 1;
    const std::int64_t last = first + (whole ? 1 : 2);
    const double b = path.device().coupling.b_rad_s;
    const double to_deg_h = units::two_pi / path.device().phase_per_arcsec / units::two_pi / path.device().period_s();
    double lockin = lockin_between_turns_rad(path, first, last);
    double correction = 0.0;
    for (std::int64_t k = first; k <= last; ++k) {
        const Turn turn(path, k);
        const double time = path.turn_time_s(k);
        const bool before = whole || k != first;
        const bool after = whole || k != last;
        if (before) correction += turn.half_kick_rad(b, -1, time, clock_hz);
        if (after) correction += turn.half_kick_rad(b, +1, time, clock_hz);
        if (!before) lockin -= turn.lockin_to_extremum_rad;
        if (!after) lockin += turn.lockin_to_extremum_rad;
    }
    if (whole) lockin += lockin_to_middle_rad(path, first, false) + lockin_to_middle_rad(path, last, true);
    return {lockin * to_deg_h, correction * to_deg_h};
}

double extremum_phase_rad(GyroPath& path, std::int64_t turn) { return Turn(path, turn).path.zero_rate_phase_rad(); }

HalfTurnFit fit_half_turn(bool minimum, bool after, int phases) {
    GyroPath path(gyro::Device(paper_device(0.0)), 1e-11);
    const std::int64_t k = minimum ? 2 : 1;
    Eigen::MatrixXd design(phases, 5);
    Eigen::VectorXd gains(phases);
    double acceleration = 0.0;
    for (int i = 0; i < phases; ++i) {
        path.restart(units::two_pi * i / phases);
        const Turn turn(path, k);
        const double psi = turn.path.zero_rate_phase_rad();
        const double beyond = turn.lockin_to_extremum_rad;
        // In the middle the lock-in goes to and fro by b/g within each fringe, -b cos(psi)/g, which is not the turn's.
        const gyro::HalfCycle half = path.half_cycle_after(after ? k : k + 1);
        const double middle_s = path.turn_time_s(k) + (after ? 0.5 : -0.5) * half.duration_s;
        const double ripple = path.device().coupling.b_rad_s *
                              std::cos(path.at(std::vector<double>{middle_s})[0].remainder_rad) /
                              half.drive_rate_rad_s(0.5 * half.duration_s);
        gains[i] = lockin_to_middle_rad(path, k, after) + (after ? ripple - beyond : beyond - ripple);
        design.row(i) << 1.0, std::sin(psi), std::cos(psi), std::cos(2.0 * psi), std::sin(2.0 * psi);
        acceleration = turn.path.acceleration_rad_s2(after ? 1 : -1);
    }
    const Eigen::VectorXd fit = design.colPivHouseholderQr().solve(gains);
    const double unit = path.device().coupling.b_rad_s * std::sqrt(units::pi / acceleration);
    return {fit[0], fit[1] / unit, fit[2] / unit, fit[3], fit[4]};
}

AveragedCycle averaged_cycle(int phases) {
    const gyro::Setup setup = paper_device(0.0);
    const double depth = gyro::modulation_depth_rad(setup);
    GyroPath path(gyro::Device(setup), 1e-11);
    const double unit = path.device().coupling.b_rad_s * cycle_s(setup) * boost::math::cyl_bessel_j(0, depth);
    AveragedCycle result;
    constexpr int points = 1 << 15;  // many to a fringe: the mean of a periodic function is then exact
    for (int i = 0; i < phases; ++i) {
        const double psi = units::two_pi * i / phases;
        double mean = 0.0;
        for (int k = 0; k < points; ++k) mean += std::sin(psi - depth * std::cos(units::two_pi * k / points)) / points;
        const double plain = mean * path.device().coupling.b_rad_s * cycle_s(setup) / unit;
        path.restart(psi - depth);
        const double exact = lockin_between_turns_rad(path, 0, 2) / unit;
        result.plain_sine += 2.0 * plain * std::sin(psi) / phases;
        result.plain_cosine += 2.0 * plain * std::cos(psi) / phases;
        result.exact_sine += 2.0 * exact * std::sin(psi) / phases;
        result.exact_cosine += 2.0 * exact * std::cos(psi) / phases;
    }
    return result;
}

double half_turn_second_harmonic_rad(const gyro::Setup& setup) {
    const double kappa = gyro::turn_kick_rad(setup);
    // From the dither's turn kappa^2/16 (docs/physics.md); the lock-in on the way from there to the extremum, at
    // -b sin(psi)/a, takes b^2/(2 a) (1 - cos(2 psi)) of it away, b^2/(2 a) = kappa^2/(4 pi).
    return kappa * kappa * (1.0 / 16.0 - 0.25 / units::pi);
}

double turn_pair_density(double u) {
    const double inside = 1.0 - 0.25 * u * u;
    if (inside < 0.0) return 0.0;
    // Logarithmically infinite at 0.
    return std::comp_ellint_1(std::sqrt(std::min(inside, 1.0 - 1e-15))) / (units::pi * units::pi);
}

CorrectionDensity::CorrectionDensity(Turns turns) : turns_(turns), cells_(cells) {
    constexpr int phases = 1000;
    double total = 0.0;
    for (int i = 0; i < cells; ++i) {
        const double u = 4.0 * (i + 0.5) / cells - 2.0;
        double& value = cells_[static_cast<std::size_t>(i)];
        if (turns == Turns::two_whole) {
            value = turn_pair_density(u);
        } else {
            for (int k = 0; k < phases; ++k) {
                value += 2.0 * turn_pair_density(2.0 * (u - std::sin(units::pi * ((k + 0.5) / phases - 0.5)))) / phases;
            }
        }
        total += value * 4.0 / cells;
    }
    for (double& value : cells_) value /= total;
}

double CorrectionDensity::operator()(double u) const {
    if (turns_ == Turns::two_whole) return turn_pair_density(u);
    const double place = (u + 2.0) * cells / 4.0 - 0.5;
    if (!(std::abs(u) < 2.0)) return 0.0;
    const int i = std::clamp(static_cast<int>(std::floor(place)), 0, cells - 2);
    const double along = std::clamp(place - i, 0.0, 1.0);
    return (1.0 - along) * cell(i) + along * cell(i + 1);
}

double CorrectionDensity::beyond(double u) const {
    double sum = 0.0;
    for (int i = 0; i < cells; ++i) {
        if (std::abs(4.0 * (i + 0.5) / cells - 2.0) > u) sum += cell(i) * 4.0 / cells;
    }
    return sum;
}

double log_likelihood(const CorrectionDensity& density, std::span<const double> corrections_deg_h, double factor,
                      double kick_deg_h, double error_deg_h) {
    const double unit = factor * kick_deg_h;
    double sum = 0.0;
    for (const double correction : corrections_deg_h) {
        double likelihood = 0.0;
        if (error_deg_h == 0.0) {
            likelihood = density(correction / unit) / unit;
        } else {
            for (int i = 0; i < CorrectionDensity::cells; ++i) {
                const double u = 4.0 * (i + 0.5) / CorrectionDensity::cells - 2.0;
                const double z = (correction - unit * u) / error_deg_h;
                likelihood += density.cell(i) * std::exp(-0.5 * z * z);
            }
            likelihood *= 4.0 / (CorrectionDensity::cells * error_deg_h * std::sqrt(units::two_pi));
        }
        sum += std::log(likelihood);
    }
    return sum;
}

FactorEstimate estimate_factor(const CorrectionDensity& density, std::span<const double> corrections_deg_h,
                               double kick_deg_h) {
    FactorEstimate estimate;
    for (const double correction : corrections_deg_h) {
        estimate.smallest = std::max(estimate.smallest, 0.5 * std::abs(correction) / kick_deg_h);
    }
    // Even steps of the logarithm of the factor, in which the density beforehand is even.
    constexpr int steps = 20000;
    const double step = std::log(50.0) / steps;
    std::vector<double> weights(steps);
    double total = 0.0;
    double best = -1.0;
    for (int i = 0; i < steps; ++i) {
        const double factor = estimate.smallest * std::exp((i + 0.5) * step);
        weights[static_cast<std::size_t>(i)] = std::exp(log_likelihood(density, corrections_deg_h, factor, kick_deg_h));
        total += weights[static_cast<std::size_t>(i)];
        if (weights[static_cast<std::size_t>(i)] > best) {
            best = weights[static_cast<std::size_t>(i)];
            estimate.likeliest = factor;
        }
    }
    double sum = 0.0;
    for (int i = 0; i < steps; ++i) {
        const double before = sum;
        sum += weights[static_cast<std::size_t>(i)] / total;
        const double factor = estimate.smallest * std::exp((i + 0.5) * step);
        if (before < 0.5 && sum >= 0.5) estimate.median = factor;
        if (before < 0.95 && sum >= 0.95) estimate.upper_95 = factor;
    }
    return estimate;
}

ReadingStatistics statistics(std::span<const double> errors_deg_h) {
    ReadingStatistics result;
    result.lowest_deg_h = std::numeric_limits<double>::infinity();
    result.highest_deg_h = -result.lowest_deg_h;
    for (const double error : errors_deg_h) {
        result.mean_deg_h += error / static_cast<double>(errors_deg_h.size());
        result.rms_deg_h += error * error / static_cast<double>(errors_deg_h.size());
        result.lowest_deg_h = std::min(result.lowest_deg_h, error);
        result.highest_deg_h = std::max(result.highest_deg_h, error);
    }
    result.rms_deg_h = std::sqrt(result.rms_deg_h);
    return result;
}

}  // namespace ringlock::test::replication
