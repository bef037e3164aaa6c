#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "analysis/study/result/result_file.hpp"
#include "analysis/study/summary.hpp"
#include "engine/gyro/theory.hpp"
#include "tests/bench/page.hpp"
#include "tests/bench/replication_blocks.hpp"
#include "tests/support/replication.hpp"

namespace ringlock::bench::replication {

namespace {

std::string arw_text(const study::ArmSummary& arm) {
    const study::Figure& figure = arm.arw_deg_rt_h;
    if (!figure.median) return figure.hi ? fmt::format("< {:.2g}", *figure.hi) : "not resolved";
    return fmt::format("{:.4g} ({:.4g} .. {:.4g})", *figure.median, *figure.median_lo, *figure.median_hi);
}

}  // namespace

void coefficients(const char* file) {
    const study::Study all = study::read_result(file).points.front();
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

}  // namespace ringlock::bench::replication
