#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/units.hpp"
#include "tests/bench/page.hpp"
#include "tests/bench/replication_blocks.hpp"
#include "tests/support/replication.hpp"

namespace ringlock::bench::replication {

namespace {

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

double quantile(std::vector<double> values, double level) {
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(level * static_cast<double>(values.size() - 1) + 0.5)];
}

/// The four corrections that would be of 100, 200, 300 and 400 deg/h, in the order of rates.
constexpr double assumed_rates[] = {100.0, 200.0, 300.0, 400.0};
constexpr double assumed_corrections[] = {1.12, 4.17, 4.80, 4.22};

}  // namespace

void corrections() {
    head({"input [deg/h]", "cycle", "first order: largest, corrected", "printed", "simulated: 95 % below, corrected",
          "largest, corrected", "95 % below, printed", "largest, printed", "largest, printed, clocks of 1 to 100 MHz"});
    for (const double rate : rates_deg_h) {
        const gyro::Setup setup = rp::paper_device(rate);
        test::GyroPath path(gyro::Device(setup), tolerance_rad);
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
        test::GyroPath path(gyro::Device(rp::paper_device(rate)), tolerance_rad);
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

}  // namespace ringlock::bench::replication
