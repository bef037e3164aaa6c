// The figures of docs/replication.md, one block of Markdown after another.
//
//   bench_replication [BLOCK [RESULT.h5]]
//
// Without arguments every block but `coefficients`, which needs the result of
// scenarios/gao-deng-2007-coefficients.toml;
// `--list` names them. tools/replication puts them into the page.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "analysis/study/result_file.hpp"
#include "analysis/study/summary.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/gyro/theory.hpp"
#include "tests/support/replication.hpp"

namespace {

using namespace ringlock;
namespace rp = ringlock::test::replication;
using rp::Span;

/// Rates that what is cited of the paper implies or suggests, see the page.
constexpr double rates_deg_h[] = {15.0, 100.0, 200.0, 300.0, 400.0};
constexpr double tolerance_rad = 1e-10;

class Uniform {
   public:
    explicit Uniform(std::uint64_t seed) : engine_(seed) {}
    double operator()(double low, double high) {
        return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
    }

   private:
    std::mt19937_64 engine_;
};

const char* name(Span span) {
    switch (span) {
        case Span::minimum_to_minimum:
            return "minimum to minimum";
        case Span::maximum_to_maximum:
            return "maximum to maximum";
        case Span::minimum_and_maximum:
            return "a minimum, then a maximum";
        case Span::maximum_and_minimum:
            return "a maximum, then a minimum";
    }
    return "";
}

void row(const std::vector<std::string>& cells) {
    for (const std::string& cell : cells) fmt::print("| {} ", cell);
    fmt::print("|\n");
}
void head(const std::vector<std::string>& cells) {
    row(cells);
    for (std::size_t i = 0; i < cells.size(); ++i) fmt::print("|---");
    fmt::print("|\n");
}
std::string number(double value, int digits = 3) { return fmt::format("{:.{}f}", value, digits); }

/// With its sign, but for a zero, whose sign is of rounding.
std::string signed_number(double value, int digits) {
    const bool zero = std::abs(value) < 0.5 * std::pow(10.0, -digits);
    return zero ? fmt::format("{:.{}f}", 0.0, digits) : fmt::format("{:+.{}f}", value, digits);
}

double quantile(std::vector<double> values, double level) {
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(level * static_cast<double>(values.size() - 1) + 0.5)];
}

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

/// rms over phases of the exact lock-in error of a cycle and of what is left when the formula is taken away, with and
/// without theta.
struct CycleFormula {
    double error = 0.0, with_theta = 0.0, without_theta = 0.0;
};
CycleFormula cycle_formula(double rate_deg_h, int phases) {
    const gyro::Setup setup = rp::paper_device(rate_deg_h);
    propagate::GyroPath path(gyro::Device(setup), tolerance_rad);
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

/// Errors of readings over random initial phases.
std::vector<double> reading_errors(double rate_deg_h, int kind, int gyros) {
    const gyro::Setup setup = rp::paper_device(rate_deg_h);
    const gyro::Device device(setup);
    propagate::GyroPath path(device, tolerance_rad);
    Uniform uniform(15625);
    const double period = device.period_s();
    const double count_arcsec = 0.25 * setup.scale_factor_arcsec;
    std::vector<double> errors;
    for (int i = 0; i < gyros; ++i) {
        path.restart(uniform(-units::pi, units::pi));
        const double random_s = uniform(0.0, period);
        double first_s = 0.0;
        double interval_s = rp::reading_interval_s;
        double swing_counts = 0.0;
        switch (kind) {
            case 0:
                break;  // 8 ms from a minimum
            case 1:
                first_s = path.turn_time_s(1);
                break;  // from a maximum
            case 2:
                first_s = random_s;
                break;  // from anywhere
            case 3:
                interval_s = period;
                break;  // a cycle from a minimum
            case 4:
                first_s = random_s;
                interval_s = period;
                break;
            default:  // a half cycle, the swing known and taken away
                interval_s = 0.5 * period;
                swing_counts = 2.0 * device.dither_amplitude_rad / (0.5 * units::pi);
        }
        const auto count = static_cast<double>(path.quarter_counts(first_s, interval_s, 1)[0]);
        errors.push_back((count - swing_counts) * count_arcsec / interval_s - rate_deg_h);
    }
    return errors;
}

void readings() {
    const char* kinds[] = {"8 ms from a minimum",         "8 ms from a maximum",
                           "8 ms from any instant",       "one period from a minimum",
                           "one period from any instant", "half a period from a minimum, swing taken away"};
    const double steps[] = {0.125 / 8e-3,
                            0.125 / 8e-3,
                            0.125 / 8e-3,
                            0.125 * 783.4 / units::two_pi,
                            0.125 * 783.4 / units::two_pi,
                            0.25 * 783.4 / units::two_pi};
    head({"reading", "step [deg/h]", "input [deg/h]", "mean error [deg/h]", "rms", "lowest", "highest"});
    for (int kind = 0; kind < 6; ++kind) {
        for (const double rate : {15.0, 100.0, 400.0}) {
            const rp::ReadingStatistics s = rp::statistics(reading_errors(rate, kind, 1000));
            row({kinds[kind], number(steps[kind]), number(rate, 0), fmt::format("{:+.2f}", s.mean_deg_h),
                 number(s.rms_deg_h, 2), fmt::format("{:+.2f}", s.lowest_deg_h),
                 fmt::format("{:+.2f}", s.highest_deg_h)});
        }
    }
}

void implied() {
    head({"from", "follows", "smallest", "largest"});
    const double worst = rp::worst_error_after_deg_h;
    row({"worst error 2.489 deg/h is 0.622 %", fmt::format("input {:.1f} deg/h", worst / 0.00622),
         number(worst / 0.006225, 1), number(worst / 0.006215, 1)});
    row({"worst error 2.489 deg/h, column 4 is 1.0062 x input",
         fmt::format("input {:.1f} deg/h", worst / (rp::column_4_over_input - 1.0)),
         number(worst / (rp::column_4_over_input - 1.0 + 5e-5), 1),
         number(worst / (rp::column_4_over_input - 1.0 - 5e-5), 1)});
    row({"reading 15.625 deg/h, error 0.625", "input 15 deg/h", "", ""});
    row({"error 6.25 % of a reading in steps of 15.625 deg/h, input 100 deg/h",
         fmt::format("reading {:.2f} deg/h", 6.0 * rp::reading_step_deg_h), "", ""});
}

void table_1() {
    constexpr int kinds[] = {0, 1, 4};
    const char* titles[] = {"8 ms from a minimum", "8 ms from a maximum", "one period"};
    fmt::print("| input [deg/h] | nearest multiple | less input [deg/h] | in per cent | within 6.25 % |");
    for (const char* title : titles) fmt::print(" {}: nearest | within 6.25 % |", title);
    fmt::print("\n|---|---|---|---|---|---|---|---|---|---|---|\n");
    double all[6] = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0};
    for (const double rate : rates_deg_h) {
        const double step = rp::reading_step_deg_h;
        const double nearest = std::nearbyint(rate / step);
        const auto allowed = [&](double count) {
            return std::abs(count * step - rate) <= 0.0625 * rate * (1.0 + 1e-12);
        };
        std::string within;
        for (double count = std::floor(0.9 * rate / step); count * step < 1.1 * rate; ++count) {
            if (allowed(count)) within += fmt::format("{}{:.3f}", within.empty() ? "" : ", ", count * step);
        }
        std::vector<std::string> cells = {number(rate, 0), number(nearest * step),
                                          fmt::format("{:+.3f}", nearest * step - rate),
                                          fmt::format("{:+.2f}", 100.0 * (nearest * step / rate - 1.0)), within};
        for (std::size_t k = 0; k < 3; ++k) {
            const double interval = kinds[k] < 3 ? rp::reading_interval_s : units::two_pi / 783.4;
            const std::vector<double> errors = reading_errors(rate, kinds[k], 1000);
            int hits[2] = {};
            for (const double error : errors) {
                const double count = std::nearbyint((error + rate) * interval / 0.125);
                hits[0] += count == nearest ? 1 : 0;
                hits[1] += allowed(count) ? 1 : 0;
            }
            for (std::size_t which = 0; which < 2; ++which) {
                const double share = hits[which] / static_cast<double>(errors.size());
                all[2 * k + which] *= share;
                cells.push_back(fmt::format("{:.2f} +- {:.2f}", share,
                                            std::sqrt(share * (1.0 - share) / static_cast<double>(errors.size()))));
            }
        }
        row(cells);
    }
    std::vector<std::string> cells = {"all five", "", "", "", ""};
    for (const double share : all) cells.push_back(number(share));
    row(cells);
}

void corrections() {
    head({"input [deg/h]", "cycle", "first order: largest, corrected", "printed", "simulated: 95 % below, corrected",
          "largest, corrected", "95 % below, printed", "largest, printed", "largest, printed, clocks of 1 to 100 MHz"});
    for (const double rate : rates_deg_h) {
        const gyro::Setup setup = rp::paper_device(rate);
        propagate::GyroPath path(gyro::Device(setup), tolerance_rad);
        for (const Span span : {Span::minimum_to_minimum, Span::minimum_and_maximum, Span::maximum_and_minimum}) {
            Uniform uniform(354);
            std::vector<double> sizes;
            std::vector<double> clocked;
            for (int i = 0; i < 400; ++i) {
                path.restart(uniform(-units::pi, units::pi));
                const double clock_hz = std::exp(uniform(std::log(1e6), std::log(100e6)));
                sizes.push_back(std::abs(rp::exact_cycle(path, span).corrected_deg_h));
                clocked.push_back(std::abs(rp::exact_cycle(path, span, clock_hz).corrected_deg_h));
            }
            const double largest = *std::max_element(sizes.begin(), sizes.end());
            const double bound = rp::largest_correction_deg_h(setup, span);
            row({number(rate, 0), name(span), number(bound), number(2.0 * bound), number(quantile(sizes, 0.95)),
                 number(largest), number(2.0 * quantile(sizes, 0.95)), number(2.0 * largest),
                 number(2.0 * *std::max_element(clocked.begin(), clocked.end()))});
        }
    }
}

void likelihood() {
    const double kick = rp::turn_kick_deg_h(rp::paper_device(0.0));
    using Turns = rp::CorrectionDensity::Turns;
    const rp::CorrectionDensity densities[] = {rp::CorrectionDensity(Turns::two_whole),
                                               rp::CorrectionDensity(Turns::half_whole_half)};
    int beyond = 0;
    double largest = 0.0;
    for (const double each : rp::applied_deg_h) {
        beyond += std::abs(each) > 2.0 * kick ? 1 : 0;
        largest = std::max(largest, std::abs(each));
    }
    const auto figure = [&](const std::string& title, const auto& text) {
        row({title, text(densities[0]), text(densities[1])});
    };
    head({"figure", "two whole turns a cycle", "half a turn, a whole one, half a turn"});
    figure("corrections beyond the bound of the right coefficients",
           [&](const auto&) { return fmt::format("{} of 6", beyond); });
    figure("corrections beyond the bound of the printed ones",
           [&](const auto&) { return fmt::format("{} of 6", largest > 4.0 * kick ? "some" : "0"); });
    figure("chance that printed coefficients pass the bound of the right ones, one correction",
           [&](const auto& density) { return number(density.beyond(1.0)); });
    figure(fmt::format("chance of {} and more of 6", beyond), [&](const auto& density) {
        const double p = density.beyond(1.0);
        const double binomial[] = {1, 6, 15, 20, 15, 6, 1};
        double at_least = 0.0;
        for (int k = beyond; k <= 6; ++k) at_least += binomial[k] * std::pow(p, k) * std::pow(1.0 - p, 6 - k);
        return number(at_least);
    });
    const auto estimate = [&](const auto& density) { return rp::estimate_factor(density, rp::applied_deg_h, kick); };
    figure("smallest factor that allows all six (1: right, 2: printed)",
           [&](const auto& density) { return number(estimate(density).smallest); });
    figure("likeliest factor", [&](const auto& density) { return number(estimate(density).likeliest, 2); });
    figure("median of the factor", [&](const auto& density) { return number(estimate(density).median, 2); });
    figure("95 % of the factor are below", [&](const auto& density) { return number(estimate(density).upper_95, 2); });
    figure("times that psi'' must be read too small for right coefficients to reach the largest",
           [&](const auto&) { return number(std::pow(largest / (2.0 * kick), 2), 2); });
    fmt::print("\n");
    head({"error of each correction, rms [deg/h]", "two whole turns: log likelihood, right", "printed",
          "printed over right", "half, whole, half: right", "printed", "printed over right"});
    for (const double error : {0.0, 0.1, 0.3, 0.5, 1.0, 1.5, 2.0, 3.0}) {
        std::vector<std::string> cells = {number(error, 1)};
        for (const auto& density : densities) {
            const double right = rp::log_likelihood(density, rp::applied_deg_h, 1.0, kick, error);
            const double printed = rp::log_likelihood(density, rp::applied_deg_h, 2.0, kick, error);
            const bool possible = std::isfinite(right);
            cells.push_back(possible ? number(right, 2) : "impossible");
            cells.push_back(number(printed, 2));
            const double ratio = std::exp(printed - right);
            cells.push_back(!possible     ? "-"
                            : ratio > 1e6 ? "> 1e6"
                                          : fmt::format("{:.{}f}", ratio, ratio < 10.0 ? 2 : 0));
        }
        row(cells);
    }
}

/// The four corrections that would be of 100, 200, 300 and 400 deg/h, in the order of rates.
constexpr double assumed_rates[] = {100.0, 200.0, 300.0, 400.0};
constexpr double assumed_corrections[] = {1.12, 4.17, 4.80, 4.22};

void search() {
    constexpr int depths = 2000;
    constexpr int phases = 1440;
    head({"cycle", "factor", "allowed at the published M", "share of M that allows all four",
          "one phase for all: best rms at the published M", "best rms over M"});
    for (const Span span : rp::spans) {
        for (const double factor : {1.0, 2.0}) {
            std::string allowed;
            int share = 0;
            for (int m = -1; m < depths; ++m) {
                const double shift = m < 0 ? 0.0 : units::pi * m / depths;
                bool all = true;
                for (std::size_t i = 0; i < 4; ++i) {
                    const double bound =
                        factor * rp::largest_correction_deg_h(rp::paper_device(assumed_rates[i]), span, shift);
                    const bool fits = std::abs(assumed_corrections[i]) <= bound;
                    all = all && fits;
                    if (m < 0 && fits)
                        allowed += fmt::format("{}{:.0f}", allowed.empty() ? "" : ", ", assumed_rates[i]);
                }
                if (m >= 0 && all) ++share;
            }
            // One initial phase for all four runs: turn 0 is a minimum there, whatever the rate; the maximum follows
            // it.
            const auto best_rms = [&](double shift) {
                double best = 1e300;
                std::vector<std::pair<double, double>> sine_cosine;
                for (const double rate : assumed_rates) {
                    const gyro::Setup setup = rp::paper_device(rate);
                    sine_cosine.emplace_back(
                        factor * rp::first_order_correction_deg_h(setup, span, 0.5 * units::pi, shift),
                        factor * rp::first_order_correction_deg_h(setup, span, 0.0, shift));
                }
                for (int k = 0; k < phases; ++k) {
                    const double psi = units::two_pi * k / phases;
                    double sum = 0.0;
                    for (std::size_t i = 0; i < 4; ++i) {
                        // Im(z exp(i psi)) from its values at pi/2 and 0
                        const double value =
                            sine_cosine[i].first * std::sin(psi) + sine_cosine[i].second * std::cos(psi);
                        sum += std::pow(value - assumed_corrections[i], 2) / 4.0;
                    }
                    best = std::min(best, sum);
                }
                return std::sqrt(best);
            };
            double over_all = 1e300;
            for (int m = 0; m < 400; ++m) over_all = std::min(over_all, best_rms(units::pi * m / 400));
            row({name(span), factor == 1.0 ? "right" : "printed", allowed.empty() ? "none" : allowed,
                 number(share / static_cast<double>(depths)), number(best_rms(0.0), 2), number(over_all, 2)});
        }
    }
}

void one_cycle() {
    constexpr int gyros = 400;
    head({"input [deg/h]", "lock-in error, rms [deg/h]", "left by the printed coefficients", "of the error",
          "left by the corrected ones", "of the error"});
    for (int rate = 0; rate <= 500; rate += 50) {
        propagate::GyroPath path(gyro::Device(rp::paper_device(rate)), tolerance_rad);
        Uniform uniform(2007);
        double raw = 0.0, printed = 0.0, corrected = 0.0;
        double ratio_printed[2] = {}, ratio_corrected[2] = {};
        std::vector<rp::Cycle> cycles;
        for (int i = 0; i < gyros; ++i) {
            path.restart(uniform(-units::pi, units::pi));
            cycles.push_back(rp::exact_cycle(path, Span::minimum_to_minimum));
        }
        const auto rms = [&](double taken, int first, int stride) {
            double sum = 0.0;
            int n = 0;
            for (int i = first; i < gyros; i += stride, ++n) {
                const auto& c = cycles[static_cast<std::size_t>(i)];
                sum += std::pow(c.lockin_deg_h - taken * c.corrected_deg_h, 2);
            }
            return std::sqrt(sum / n);
        };
        raw = rms(0.0, 0, 1);
        printed = rms(2.0, 0, 1);
        corrected = rms(1.0, 0, 1);
        // Standard errors from twenty groups of gyros.
        constexpr int groups = 20;
        for (int g = 0; g < groups; ++g) {
            const double of = rms(0.0, g, groups);
            const double p = rms(2.0, g, groups) / of;
            const double c = rms(1.0, g, groups) / of;
            ratio_printed[0] += p / groups;
            ratio_printed[1] += p * p / groups;
            ratio_corrected[0] += c / groups;
            ratio_corrected[1] += c * c / groups;
        }
        const auto error = [](const double* m) { return std::sqrt(std::max(0.0, m[1] - m[0] * m[0]) / (groups - 1)); };
        row({number(rate, 0), number(raw), number(printed),
             fmt::format("{:.4f} +- {:.4f}", printed / raw, error(ratio_printed)), number(corrected, 4),
             fmt::format("{:.4f} +- {:.4f}", corrected / raw, error(ratio_corrected))});
    }
}

std::string arw_text(const study::ArmSummary& arm) {
    const study::Figure& figure = arm.arw_deg_rt_h;
    if (!figure.median) return figure.hi ? fmt::format("< {:.2g}", *figure.hi) : "not resolved";
    return fmt::format("{:.4g} ({:.4g} .. {:.4g})", *figure.median, *figure.median_lo, *figure.median_hi);
}

void coefficients(const char* file) {
    const study::Study all = study::read_result(file);
    const auto points = static_cast<std::size_t>(all.scenario.input.sweep_points);
    const auto per_point = static_cast<std::size_t>(all.scenario.ensemble.gyros);
    std::vector<std::string> titles = {"input [deg/h]"};
    for (const auto& arm : all.arms) titles.push_back(arm.arm.name);
    const auto part = [&](std::size_t point) {
        study::Study one = all;
        one.scenario.input.rate_deg_h =
            scenario::input_rate_deg_h(all.scenario.input, static_cast<std::int64_t>(point));
        one.scenario.input.sweep_points = 1;
        const auto cut = [&](auto& values) {
            values = {values.begin() + static_cast<std::ptrdiff_t>(point * per_point),
                      values.begin() + static_cast<std::ptrdiff_t>((point + 1) * per_point)};
        };
        cut(one.gyros);
        for (auto& arm : one.arms) cut(arm.gyros);
        return one;
    };
    std::vector<study::Study> studies;
    std::vector<study::Summary> summaries;
    for (std::size_t i = 0; i < points; ++i) {
        studies.push_back(part(i));
        summaries.push_back(study::summarise(studies.back()));
    }
    const study::Summary together = study::summarise(all);
    fmt::print(
        "Angle random walk [deg/sqrt(h)], median of the gyros (bootstrap 95 % interval of it); theory {:.7f}:\n\n",
        together.theory.arw_deg_rt_h);
    head(titles);
    const auto line = [&](const std::string& first, const study::Summary& summary, const auto& text) {
        std::vector<std::string> cells = {first};
        for (const auto& arm : summary.arms) cells.push_back(text(arm));
        row(cells);
    };
    for (std::size_t i = 0; i < points; ++i) {
        line(number(studies[i].scenario.input.rate_deg_h, 0), summaries[i], arw_text);
    }
    line("all", together, arw_text);
    const auto one_cycle_text = [](const study::ArmSummary& arm) {
        const study::EnsemblePoint& point = arm.allan.front();
        return fmt::format("{:.4g} ({:.4g} .. {:.4g})", point.dev_deg_h, point.lo, point.hi);
    };
    fmt::print("\nAllan deviation of the rate at one cycle, {:.4f} ms [deg/h] (68 % interval):\n\n",
               1e3 * together.arms.front().allan.front().tau_s);
    // Half a kick, a whole one and half a kick make a cycle's; of the difference of two cycles in a row the turn
    // between them drops out, and the variance is (1/4 + 1 + 1 + 1/4) times that of a kick.
    fmt::print(
        "Turns fully randomised, uncorrected to first order: {:.4f} deg/h; second harmonics of the readings: {:.5f} "
        "deg/h.\n\n",
        rp::turn_kick_deg_h(rp::paper_device(0.0)) * std::sqrt(0.5 * 0.5 * 2.5),
        // Readings h cos(2 psi_0) in themselves, independent: second differences have 6 of their variances.
        std::abs(rp::half_turn_second_harmonic_rad(rp::paper_device(0.0))) *
            (rp::turn_kick_deg_h(rp::paper_device(0.0)) / gyro::turn_kick_rad(rp::paper_device(0.0))) *
            std::sqrt(0.5 * 0.5 * 6.0));
    head(titles);
    for (std::size_t i = 0; i < points; ++i) {
        line(number(studies[i].scenario.input.rate_deg_h, 0), summaries[i], one_cycle_text);
    }
    line("all", together, one_cycle_text);
    fmt::print("\nMean rate error over the record [1e-3 deg/h] (+- standard error over the gyros):\n\n");
    head(titles);
    const auto bias = [&](const std::string& first, const study::Study& study) {
        std::vector<std::string> cells = {first};
        for (const auto& arm : study.arms) {
            double mean = 0.0, square = 0.0;
            const auto n = static_cast<double>(arm.gyros.size());
            for (const auto& gyro : arm.gyros) mean += gyro.rate_error_deg_h / n;
            for (const auto& gyro : arm.gyros) square += std::pow(gyro.rate_error_deg_h - mean, 2) / (n - 1.0);
            cells.push_back(fmt::format("{} +- {:.4f}", signed_number(1e3 * mean, 4), 1e3 * std::sqrt(square / n)));
        }
        row(cells);
    };
    for (std::size_t i = 0; i < points; ++i) bias(number(studies[i].scenario.input.rate_deg_h, 0), studies[i]);
    bias("all", all);
}

const std::pair<const char*, std::function<void()>> blocks[] = {
    {"device", device},     {"half-turns", half_turns}, {"turns", turns},     {"averaging", averaging},
    {"cycles", cycles},     {"likelihood", likelihood}, {"search", search},   {"one-cycle", one_cycle},
    {"readings", readings}, {"implied", implied},       {"table-1", table_1}, {"corrections", corrections},
};

}  // namespace

int main(int argc, char** argv) {
    try {
        const std::string wanted = argc > 1 ? argv[1] : "";
        if (wanted == "--list") {
            for (const auto& [title, print] : blocks) fmt::print("{}\n", title);
            return 0;
        }
        if (wanted == "coefficients" && argc == 3) {
            coefficients(argv[2]);
            return 0;
        }
        bool found = false;
        for (const auto& [title, print] : blocks) {
            if (!wanted.empty() && wanted != title) continue;
            if (wanted.empty()) fmt::print("\n{}\n\n", title);
            print();
            found = true;
        }
        if (found) return 0;
        fmt::print(stderr, "bench_replication: no block {}\n", wanted);
        return 2;
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_replication: {}\n", error.what());
        return 1;
    }
}
