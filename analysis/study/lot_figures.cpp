#include "analysis/study/lot_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/ensemble/schedule.hpp"

namespace ringlock::study {

namespace {

constexpr double told_quantiles[] = {0.05, 0.5, 0.95};

template <class What>
std::vector<double> of_gyros(const ArmStatistics& arm, What&& what) {
    std::vector<double> values;
    for (const GyroStatistics& gyro : arm.gyros) values.push_back(what(gyro));
    return values;
}

/// Deviations of the gyros at an averaging time that the study has.
std::vector<double> deviations_at(const Study& study, const ArmStatistics& arm, double tau_s) {
    const std::int64_t m = ensemble::cycles_in(study.schedule, tau_s);
    const auto place = std::lower_bound(study.factors.begin(), study.factors.end(), m) - study.factors.begin();
    return of_gyros(arm, [&](const GyroStatistics& g) { return g.allan[static_cast<std::size_t>(place)].dev; });
}

std::vector<double> rate_errors(const ArmStatistics& arm) {
    return of_gyros(arm, [](const GyroStatistics& g) { return g.rate_error_deg_h; });
}

std::vector<double> angle_errors(const ArmStatistics& arm, std::size_t time) {
    return of_gyros(arm, [&](const GyroStatistics& g) { return g.angle_error_arcsec[time]; });
}

}  // namespace

std::vector<LotFigure> lot_figures(const Study& study, const ArmStatistics& arm) {
    std::vector<LotFigure> figures;
    const auto add = [&](std::string name, const std::vector<double>& values) {
        figures.push_back({std::move(name), lot::quantiles(values, told_quantiles)});
    };
    add("arw_deg_rt_h", random_walks_deg_rt_h(arm));
    add("rate_error_deg_h", rate_errors(arm));
    std::vector<double> taus = study.scenario.output.tau_s;
    const scenario::Specification& wanted = study.scenario.specification;
    if (wanted.bias_stability_deg_h > 0.0) taus.push_back(wanted.at_s);
    for (const double tau_s : taus) {
        add(fmt::format("allan_deviation_{:g}_s_deg_h", tau_s), deviations_at(study, arm, tau_s));
    }
    const double end_s = study.schedule.cycle_s * static_cast<double>(study.schedule.cycles() - 1);
    for (std::size_t i = 0; i < study.angle_times_s.size(); ++i) {
        if (study.angle_times_s[i] > end_s) continue;
        add(fmt::format("angle_error_{:g}_s_arcsec", study.angle_times_s[i]), angle_errors(arm, i));
    }
    return figures;
}

Yield yield_of(const Study& study, const ArmStatistics& arm) {
    const scenario::Specification& wanted = study.scenario.specification;
    const auto gyros = static_cast<std::int64_t>(arm.gyros.size());
    std::vector<char> passes(arm.gyros.size(), 1);
    Yield yield;
    const auto limit = [&](std::string name, double most, const std::vector<double>& values) {
        std::int64_t within = 0;
        for (std::size_t i = 0; i < values.size(); ++i) {
            const bool good = std::abs(values[i]) <= most;  // false for what is no number
            within += good ? 1 : 0;
            if (!good) passes[i] = 0;
        }
        yield.limits.push_back({std::move(name), most, lot::share(within, gyros)});
    };
    if (wanted.arw_deg_rt_h > 0.0) limit("arw_deg_rt_h", wanted.arw_deg_rt_h, random_walks_deg_rt_h(arm));
    if (wanted.bias_stability_deg_h > 0.0) {
        limit("bias_stability_deg_h", wanted.bias_stability_deg_h, deviations_at(study, arm, wanted.at_s));
    }
    if (wanted.rate_error_deg_h > 0.0) limit("rate_error_deg_h", wanted.rate_error_deg_h, rate_errors(arm));
    if (wanted.angle_error_arcsec > 0.0) {
        limit("angle_error_arcsec", wanted.angle_error_arcsec, angle_errors(arm, study.angle_times_s.size() - 1));
    }
    yield.share = lot::share(std::count(passes.begin(), passes.end(), 1), gyros);
    const auto worst = std::min_element(yield.limits.begin(), yield.limits.end(),
                                        [](const auto& a, const auto& b) { return a.share.k < b.share.k; });
    if (worst != yield.limits.end() && worst->share.k < gyros) yield.fails_most = worst->name;
    return yield;
}

}  // namespace ringlock::study
