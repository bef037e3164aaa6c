#include "app/allan/output/dynamic_output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "app/allan/output/csv.hpp"
#include "app/allan/several.hpp"
#include "app/arguments.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

/// As many columns as a figure shows apart.
constexpr std::size_t most_windows = 400;
constexpr std::size_t fewest_intervals = 8;

std::string label_of(const AllanOutput& out, allan::Estimator estimator) {
    std::string unit;
    if (out.instrument) {
        const InstrumentNames& names = names_of(*out.instrument);
        unit = allan::traits(estimator).time ? names.integral_unit : names.rate_unit;
    }
    return unit.empty() ? std::string(allan::name(estimator)) : fmt::format("{} [{}]", allan::name(estimator), unit);
}

}  // namespace

DynamicOutput dynamic_of(const AllanRequest& request, const AnalysedSeries& series, const std::string& window) {
    const double tau0_s = series.out.tau0_s;
    const double length = std::round(duration_s("--dynamic", window) / tau0_s);
    const std::size_t intervals = series.values.size() - (request.kind == allan::Kind::phase ? 1 : 0);
    if (length < fewest_intervals || length > static_cast<double>(intervals)) {
        throw InputError(fmt::format(
            "--dynamic {}: a window must have from {} sampling intervals to the whole record: for {}, column {} from "
            "{:.6g}s to {:.6g}s",
            window, fewest_intervals, printable(series.out.data), printable(series.out.column),
            static_cast<double>(fewest_intervals) * tau0_s, static_cast<double>(intervals) * tau0_s));
    }
    DynamicOutput out;
    out.estimator = request.estimators.front();
    out.windows = stability::windows_of(static_cast<std::size_t>(length), intervals, most_windows);
    out.of_windows = stability::dynamic_deviation(out.estimator, series.values, series.counts, request.kind, tau0_s,
                                                  request.scale(), out.windows, request.options);
    return out;
}

std::string dynamic_csv(const std::vector<AllanOutput>& series, const std::vector<DynamicOutput>& dynamic) {
    const std::string suffix = unit_suffix(series.front(), allan::traits(dynamic.front().estimator).time);
    std::string text = csv_line({"file", "column", "begin_s", "end_s", "deviation", "m", "tau_s", "dev" + suffix,
                                 "lo" + suffix, "hi" + suffix, "terms"});
    for (std::size_t k = 0; k < series.size(); ++k) {
        for (const stability::WindowDeviation& w : dynamic[k].of_windows) {
            for (const allan::Point& p : w.points) {
                text += csv_line({csv_cell(series[k].data), csv_cell(series[k].column), csv_cell(w.begin_s),
                                  csv_cell(w.end_s), std::string(allan::name(dynamic[k].estimator)),
                                  std::to_string(p.m), csv_cell(p.tau_s), csv_cell(p.dev), csv_cell(p.lo),
                                  csv_cell(p.hi), std::to_string(p.terms)});
            }
        }
    }
    return text;
}

report::Map dynamic_map(const std::vector<AllanOutput>& series, const std::vector<DynamicOutput>& dynamic) {
    report::Map map;
    const allan::Estimator estimator = dynamic.front().estimator;
    map.title = fmt::format("{} in windows of {:.6g} s", allan::name(estimator),
                            static_cast<double>(dynamic.front().windows.length) * series.front().tau0_s);
    map.x_label = "time, middle of the window [s]";
    map.y_label = "averaging time tau [s]";
    map.colour_label = label_of(series.front(), estimator);
    std::vector<double> tau_s;
    for (const DynamicOutput& d : dynamic) {
        for (const stability::WindowDeviation& w : d.of_windows) {
            for (const allan::Point& p : w.points) tau_s.push_back(p.tau_s);
        }
    }
    std::sort(tau_s.begin(), tau_s.end());
    tau_s.erase(std::unique(tau_s.begin(), tau_s.end()), tau_s.end());
    for (const double tau : tau_s) map.rows.push_back(fmt::format("{:.6g}", tau));
    const std::vector<std::string> names = names_of_series(series);
    for (std::size_t k = 0; k < series.size(); ++k) {
        report::MapPanel panel;
        panel.title =
            printable(series.size() == 1 ? fmt::format("{}, column {}", series[k].data, series[k].column) : names[k]);
        const double half_step = 0.5 * static_cast<double>(dynamic[k].windows.step) * series[k].tau0_s;
        for (const stability::WindowDeviation& w : dynamic[k].of_windows) {
            const double middle_s = 0.5 * (w.begin_s + w.end_s);
            for (const allan::Point& p : w.points) {
                const auto row = std::lower_bound(tau_s.begin(), tau_s.end(), p.tau_s) - tau_s.begin();
                panel.cells.push_back({.begin = middle_s - half_step,
                                       .end = middle_s + half_step,
                                       .row = static_cast<std::size_t>(row),
                                       .value = p.dev});
            }
        }
        map.panels.push_back(std::move(panel));
    }
    return map;
}

}  // namespace ringlock::app
