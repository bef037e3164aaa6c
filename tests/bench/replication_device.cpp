#include <fmt/format.h>

#include <cmath>

#include "engine/core/units.hpp"
#include "engine/gyro/theory.hpp"
#include "tests/bench/page.hpp"
#include "tests/bench/replication_blocks.hpp"
#include "tests/support/replication.hpp"

namespace ringlock::bench::replication {

void device() {
    const gyro::Setup setup = rp::paper_device(0.0);
    const gyro::Device device(setup);
    const double depth = gyro::modulation_depth_rad(setup);
    const double period = device.period_s();
    const double count_arcsec = 0.25 * setup.scale_factor_arcsec;
    const double short_s = period - rp::reading_interval_s;
    const double w = units::two_pi / period;
    const double residue = device.dither_amplitude_rad * (1.0 - std::cos(w * short_s));
    const double to_reading = 1.0 / device.phase_per_arcsec / rp::reading_interval_s;
    head({"quantity", "value"});
    row({"dither period 2 pi/w", fmt::format("{:.4f} ms", 1e3 * period)});
    row({"one count, K/4, in 8 ms", fmt::format("{:.3f} deg/h", count_arcsec / rp::reading_interval_s)});
    row({"one count in a dither period", fmt::format("{:.3f} deg/h", count_arcsec / period)});
    row({"one count in half a period", fmt::format("{:.3f} deg/h", 2.0 * count_arcsec / period)});
    row({"K itself in 8 ms", fmt::format("{:.3f} deg/h", 4.0 * count_arcsec / rp::reading_interval_s)});
    row({"by how much 8 ms is short of a period", fmt::format("{:.2f} us", 1e6 * short_s)});
    row({"dither left in the first 8 ms after a turn", fmt::format("{:.3f} rad, {:.2f} counts, {:.2f} deg/h", residue,
                                                                   residue / (0.5 * units::pi), residue * to_reading)});
    row({"dither left in 8 ms at the worst instant",
         fmt::format("{:.0f} deg/h", 2.0 * depth * std::sin(0.5 * w * short_s) * to_reading)});
    row({"period/8 ms", fmt::format("{:.5f}", period / rp::reading_interval_s)});
    row({"depth of modulation M", fmt::format("{:.2f} rad", depth)});
    row({"M, last digit of 109.1 deg/s +- 1/2", fmt::format("+- {:.2f} rad", depth * 0.05 / 109.1)});
    row({"M, last digit of 783.4 rad/s +- 1/2", fmt::format("+- {:.2f} rad", depth * 0.05 / 783.4)});
    row({"theta/rate, theta = 2 pi^2 rate/(K w)",
         fmt::format("{:.5f} rad/(deg/h)", gyro::Device(rp::paper_device(1.0)).input_rate_rad_s * 0.5 * period)});
    row({"counts of the dither's swing in half a cycle", fmt::format("{:.1f}", 2.0 * depth / (0.5 * units::pi))});
    const double b = device.coupling.b_rad_s;
    const double acceleration = device.dither_amplitude_rad * w * w;
    row({"coupling b", fmt::format("{:.1f} rad/s", b)});
    row({"phase acceleration at a turn, psi''", fmt::format("{:.4g} rad/s^2", acceleration)});
    row({"how long a turn lasts, 1/sqrt(psi'')", fmt::format("{:.1f} us", 1e6 / std::sqrt(acceleration))});
    row({"by how much lock-in moves a turn, b/psi'', at most", fmt::format("{:.2f} us", 1e6 * b / acceleration)});
    row({"phase that this is, b^2/(2 psi'')", fmt::format("{:.4f} rad", 0.5 * b * b / acceleration)});
    row({"second harmonic of a reading, kappa^2 (1/(4 pi) - 1/16)",
         fmt::format(
             "{:.6f} rad, {:.5f} deg/h over a period", std::abs(rp::half_turn_second_harmonic_rad(setup)),
             std::abs(rp::half_turn_second_harmonic_rad(setup)) * setup.scale_factor_arcsec / units::two_pi / period)});
    row({"kick of a turn, kappa", fmt::format("{:.5f} rad", gyro::turn_kick_rad(setup))});
    row({"the same over a period", fmt::format("{:.4f} deg/h", rp::turn_kick_deg_h(setup))});
    row({"largest correction of a cycle, corrected", fmt::format("{:.3f} deg/h", 2.0 * rp::turn_kick_deg_h(setup))});
    row({"largest correction of a cycle, printed", fmt::format("{:.3f} deg/h", 4.0 * rp::turn_kick_deg_h(setup))});
    row({"widest locked band Omega_L sqrt(2/(pi M))", fmt::format("{:.3f} deg/h", gyro::band_envelope_deg_h(setup))});
}

void half_turns() {
    head({"half of a turn", "sin psi_0", "cos psi_0", "right", "printed", "constant [rad]", "cos 2 psi_0 [rad]",
          "sin 2 psi_0 [rad]"});
    for (const bool minimum : {true, false}) {
        for (const bool after : {false, true}) {
            const rp::HalfTurnFit fit = rp::fit_half_turn(minimum, after, 64);
            row({fmt::format("{} a {}", after ? "after" : "before", minimum ? "minimum" : "maximum"),
                 fmt::format("{:+.4f}", fit.sine), fmt::format("{:+.4f}", fit.cosine),
                 minimum ? "+1/2, +1/2" : "+1/2, -1/2", minimum ? "+1, +1" : "+1, -1",
                 fmt::format("{:+.5f}", fit.constant_rad), signed_number(fit.second_cosine_rad, 5),
                 signed_number(fit.second_sine_rad, 5)});
        }
    }
}

void turns() {
    head({"turn", "amplitude/kappa", "angle added to psi_0 [pi]", "right"});
    for (const bool minimum : {true, false}) {
        const rp::HalfTurnFit before = rp::fit_half_turn(minimum, false, 64);
        const rp::HalfTurnFit after = rp::fit_half_turn(minimum, true, 64);
        const double sine = before.sine + after.sine;
        const double cosine = before.cosine + after.cosine;
        row({minimum ? "minimum" : "maximum", number(std::hypot(sine, cosine) / std::sqrt(2.0), 4),
             fmt::format("{:+.4f}", std::atan2(cosine, sine) / units::pi), minimum ? "+1/4" : "-1/4"});
    }
}

void averaging() {
    const rp::AveragedCycle average = rp::averaged_cycle(64);
    head({"over one cycle, in units of b T J_0(M)", "sine of the mean phase", "cosine"});
    row({"exact average of sin(psi - M cos(w t))", signed_number(average.plain_sine, 4),
         signed_number(average.plain_cosine, 4)});
    row({"integrated equation of motion", signed_number(average.exact_sine, 4),
         signed_number(average.exact_cosine, 4)});
}

namespace {

/// rms over phases of the exact lock-in error of a cycle and of what is left when the formula is taken away, with and
/// without theta.
struct CycleFormula {
    double error = 0.0, with_theta = 0.0, without_theta = 0.0;
};
CycleFormula cycle_formula(double rate_deg_h, int phases) {
    const gyro::Setup setup = rp::paper_device(rate_deg_h);
    test::GyroPath path(gyro::Device(setup), tolerance_rad);
    CycleFormula result;
    for (int i = 0; i < phases; ++i) {
        path.restart(units::two_pi * i / phases);
        const rp::Cycle cycle = rp::exact_cycle(path, Span::minimum_and_maximum);
        const double psi = rp::extremum_phase_rad(path, 2);
        const double full = rp::first_order_correction_deg_h(setup, Span::minimum_and_maximum, psi);
        const double bare = rp::first_order_correction_deg_h(rp::paper_device(0.0), Span::minimum_and_maximum, psi);
        result.error += cycle.lockin_deg_h * cycle.lockin_deg_h / phases;
        result.with_theta += std::pow(cycle.lockin_deg_h - full, 2) / phases;
        result.without_theta += std::pow(cycle.lockin_deg_h - bare, 2) / phases;
    }
    for (double* value : {&result.error, &result.with_theta, &result.without_theta}) *value = std::sqrt(*value);
    return result;
}

}  // namespace

void cycles() {
    head({"input [deg/h]", "theta [rad]", "rms lock-in error [deg/h]", "left by the formula with theta",
          "without theta"});
    for (const double rate : {0.0, 15.0, 100.0, 200.0, 300.0, 400.0}) {
        const CycleFormula formula = cycle_formula(rate, 64);
        const gyro::Device device(rp::paper_device(rate));
        row({number(rate, 0), number(device.input_rate_rad_s * 0.5 * device.period_s(), 2), number(formula.error),
             number(formula.with_theta), number(formula.without_theta)});
    }
}

}  // namespace ringlock::bench::replication
