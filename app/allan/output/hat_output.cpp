#include "app/allan/output/hat_output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "app/allan/several.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

using HatJson = nlohmann::ordered_json;

HatJson finite_or_null(double v) { return std::isfinite(v) ? HatJson(v) : HatJson(nullptr); }

std::string title_of(const AllanOutput& s) {
    return fmt::format("{}, column {}", printable(s.data), printable(s.column));
}

void check_time_base(const std::vector<AnalysedSeries>& series) {
    const AnalysedSeries& first = series.front();
    for (const AnalysedSeries& other : series) {
        if (std::abs(other.out.tau0_s - first.out.tau0_s) > 1e-9 * first.out.tau0_s) {
            throw InputError(fmt::format(
                "--hat: differences need one time base, but {} has a sampling interval of {:.9g} s and {} of {:.9g} s",
                title_of(first.out), first.out.tau0_s, title_of(other.out), other.out.tau0_s));
        }
        if (other.values.size() != first.values.size()) {
            throw InputError(
                fmt::format("--hat: differences need one time base, but {} has {} data and {} has {} (missing ones "
                            "counted). Cut the "
                            "records to the time that they share",
                            title_of(first.out), first.values.size(), title_of(other.out), other.values.size()));
        }
    }
}

/// a - b, NaN where one is missing; of counts in whole numbers.
std::vector<double> difference(const AnalysedSeries& a, const AnalysedSeries& b) {
    std::vector<double> out(a.values.size());
    const bool counts = !a.counts.empty() && !b.counts.empty();
    for (std::size_t i = 0; i < out.size(); ++i) {
        std::int64_t exact = 0;
        const bool fits = counts && !__builtin_sub_overflow(a.counts[i], b.counts[i], &exact);
        out[i] = a.values[i] - b.values[i];
        if (fits && !std::isnan(out[i])) out[i] = static_cast<double>(exact);
    }
    return out;
}

std::array<allan::Phase, 3> differences(const AllanRequest& request, const std::vector<AnalysedSeries>& series) {
    constexpr std::array<std::array<std::size_t, 2>, 3> pairs = {{{0, 1}, {0, 2}, {1, 2}}};
    std::array<allan::Phase, 3> out;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
        const std::vector<double> values = difference(series[pairs[k][0]], series[pairs[k][1]]);
        out[k] = allan::phase_of(values, request.kind, series.front().out.tau0_s, request.scale());
        if (out[k].x.size() >= 3) continue;
        throw InputError(fmt::format("--hat: {} and {} have fewer than 3 data at the same times",
                                     title_of(series[pairs[k][0]].out), title_of(series[pairs[k][1]].out)));
    }
    return out;
}

double deviation_or_nan(double variance) {
    return variance >= 0.0 ? std::sqrt(variance) : std::numeric_limits<double>::quiet_NaN();
}

std::string hat_cell(double variance, double standard_error) {
    if (variance < 0.0) return fmt::format("negative ({:.3e} +- {:.1e})", variance, standard_error);
    return fmt::format("{:.5e} ({:.4e} to {:.4e})", std::sqrt(variance),
                       std::sqrt(std::max(0.0, variance - standard_error)), std::sqrt(variance + standard_error));
}

}  // namespace

HatOutput hat_of(const AllanRequest& request, const std::vector<AnalysedSeries>& series) {
    if (series.size() != 3) {
        throw InputError(
            fmt::format("--hat: the three-cornered hat needs three series, three columns or three files; "
                        "there {} {}",
                        series.size() == 1 ? "is" : "are", series.size()));
    }
    for (const allan::Estimator e : request.estimators) {
        if (allan::traits(e).has_interval) continue;
        throw InputError(
            fmt::format("--hat: {} is no variance, of which those of three instruments follow from their "
                        "differences; leave it out of --dev",
                        allan::name(e)));
    }
    check_time_base(series);
    HatOutput out;
    std::vector<AllanOutput> outputs;
    for (const AnalysedSeries& s : series) outputs.push_back(s.out);
    out.names = names_of_series(outputs);
    if (request.unit) {
        out.unit = names_of(request.unit->instrument).rate_unit;
        out.integral_unit = names_of(request.unit->instrument).integral_unit;
    }
    const std::array<allan::Phase, 3> phases = differences(request, series);
    const double tau0_s = series.front().out.tau0_s;
    for (const allan::Estimator estimator : request.estimators) {
        std::array<std::vector<allan::Point>, 3> points;
        for (std::size_t k = 0; k < 3; ++k) {
            const auto size = static_cast<std::int64_t>(phases[k].x.size());
            points[k] = allan::deviation(estimator, phases[k], tau0_s,
                                         allan_run::factors_for(request.taus, estimator, size, tau0_s, "--tau"),
                                         request.options);
        }
        out.by_estimator.push_back({estimator, stability::three_cornered_hat(points[0], points[1], points[2])});
    }
    return out;
}

std::string hat_text(const HatOutput& hat) {
    std::string text = "\nThree-cornered hat: deviations of each series by itself, from the differences of all three\n";
    bool any_negative = false;
    for (const auto& [estimator, points] : hat.by_estimator) {
        std::string unit = allan::traits(estimator).time ? hat.integral_unit : hat.unit;
        if (!unit.empty()) unit = fmt::format(" [{}]", unit);
        text += fmt::format("\n{:>12}", "tau [s]");
        for (const std::string& name : hat.names) {
            text += fmt::format("  {:>40}", fmt::format("{} {}{}", printable(name), allan::name(estimator), unit));
        }
        text += '\n';
        for (const stability::HatPoint& p : points) {
            text += fmt::format("{:>12.6g}", p.tau_s);
            for (std::size_t i = 0; i < 3; ++i) {
                text += fmt::format("  {:>40}", hat_cell(p.variance[i], p.standard_error[i]));
                any_negative = any_negative || p.variance[i] < 0.0;
            }
            text += '\n';
        }
    }
    text += "In brackets one standard error to either side, for independent Gaussian noises.\n";
    if (any_negative) {
        text +=
            "A negative variance says that the series is too quiet next to the others to be seen at that time, or "
            "that they are correlated.\n";
    }
    return text;
}

nlohmann::ordered_json hat_object(const HatOutput& hat) {
    HatJson json = HatJson::object();
    for (const auto& [estimator, points] : hat.by_estimator) {
        HatJson list = HatJson::array();
        for (const stability::HatPoint& p : points) {
            HatJson of_series = HatJson::array();
            for (std::size_t i = 0; i < 3; ++i) {
                const double v = p.variance[i];
                const double se = p.standard_error[i];
                of_series.push_back({{"variance", finite_or_null(v)},
                                     {"standard_error", finite_or_null(se)},
                                     {"dev", finite_or_null(deviation_or_nan(v))},
                                     {"lo", finite_or_null(std::sqrt(std::max(0.0, v - se)))},
                                     {"hi", finite_or_null(deviation_or_nan(v + se))}});
            }
            list.push_back({{"m", p.m}, {"tau_s", p.tau_s}, {"series", std::move(of_series)}});
        }
        json[std::string(allan::name(estimator))] = std::move(list);
    }
    return json;
}

}  // namespace ringlock::app
