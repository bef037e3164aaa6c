#include <fmt/format.h>

#include <cmath>
#include <string>
#include <vector>

#include "engine/core/units.hpp"
#include "tests/bench/page.hpp"
#include "tests/bench/replication_blocks.hpp"
#include "tests/support/replication.hpp"

namespace ringlock::bench::replication {

namespace {

/// Errors of readings over random initial phases.
std::vector<double> reading_errors(double rate_deg_h, int kind, int gyros) {
    const gyro::Setup setup = rp::paper_device(rate_deg_h);
    const gyro::Device device(setup);
    test::GyroPath path(device, tolerance_rad);
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

}  // namespace

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

}  // namespace ringlock::bench::replication
