#include "analysis/study/figures/lot_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "analysis/study/figures/scale_factor.hpp"
#include "engine/ensemble/schedule.hpp"

namespace ringlock::study {

namespace {

constexpr double reported_quantiles[] = {0.05, 0.5, 0.95};

template <class What>
std::vector<double> of_gyros(const ArmStatistics& arm, What&& what) {
    std::vector<double> values;
    for (const GyroStatistics& gyro : arm.gyros) values.push_back(what(gyro));
    return values;
}

/// Deviations of the gyros at an averaging time that the study has.
std::vector<double> deviations_at(const Study& study, const ArmStatistics& arm, double tau_s) {
    const std::int64_t m = ensemble::outputs_in(study.schedule, tau_s);
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

lot::Confidence confidence_of(const scenario::Scenario& scenario) {
    lot::Confidence confidence;
    if (scenario::asks(scenario.stop)) confidence.sampling = lot::Sampling::until_precise;
    return confidence;
}

std::vector<LotValues> lot_values(const Study& study, const ArmStatistics& arm) {
    std::vector<LotValues> figures;
    figures.push_back({"arw_deg_rt_h", random_walks_deg_rt_h(arm)});
    figures.push_back({"rate_error_deg_h", rate_errors(arm)});
    std::vector<double> taus = study.scenario.output.tau_s;
    const scenario::Specification& wanted = study.scenario.specification;
    if (wanted.bias_stability_deg_h > 0.0) taus.push_back(wanted.at_s);
    for (const double tau_s : taus) {
        figures.push_back({fmt::format("allan_deviation_{:g}_s_deg_h", tau_s), deviations_at(study, arm, tau_s)});
    }
    for (std::size_t i = 0; i < study.angle_times_s.size(); ++i) {
        if (!study.angle_output(i)) continue;
        figures.push_back({fmt::format("angle_error_{:g}_s_arcsec", study.angle_times_s[i]), angle_errors(arm, i)});
    }
    return figures;
}

std::vector<LotFigure> lot_figures(const Study& study, const ArmStatistics& arm) {
    std::vector<LotFigure> figures;
    for (LotValues& figure : lot_values(study, arm)) {
        figures.push_back(
            {std::move(figure.name), lot::quantiles(figure.values, reported_quantiles, confidence_of(study.scenario))});
    }
    return figures;
}

namespace {

/// Distinct gyros: the gyros of one rate of a sweep are those of every other rate, and consecutive turn-ons belong to
/// one gyro.
struct Members {
    std::size_t rows_of_rate;
    std::size_t turn_ons;

    std::size_t count() const { return rows_of_rate / turn_ons; }
    std::size_t of_row(std::size_t row) const { return row % rows_of_rate / turn_ons; }
};

Members members_of(const Study& study, const ArmStatistics& arm) {
    return {arm.gyros.size() / static_cast<std::size_t>(study.scenario.input.sweep_points),
            static_cast<std::size_t>(study.scenario.ensemble.turn_ons)};
}

/// One limit of a specification, and the values that must not exceed it in magnitude: one for every gyro, and for every
/// rate of a sweep where each rate has a value, in the order of the rows of a study.
struct Limit {
    std::string name;
    double most;
    std::vector<double> values;

    /// For every member, whether all its values are within the limit; NaN is not.
    std::vector<bool> holds(const Members& members) const {
        std::vector<bool> within(members.count(), true);
        for (std::size_t row = 0; row < values.size(); ++row) {
            if (!(std::abs(values[row]) <= most)) within[members.of_row(row)] = false;
        }
        return within;
    }
};

/// Scale factor error of every gyro, from the line through its rates of the sweep.
std::vector<double> scale_factor_errors(const Study& study, const ArmStatistics& arm) {
    std::vector<double> rates;
    for (std::int64_t rate = 0; rate < study.scenario.input.sweep_points; ++rate) {
        rates.push_back(scenario::input_rate_deg_h(study.scenario.input, rate));
    }
    return scale_factor_errors_ppm(rates, rate_errors(arm));
}

std::vector<Limit> limits_of(const Study& study, const ArmStatistics& arm) {
    const scenario::Specification& wanted = study.scenario.specification;
    std::vector<Limit> limits;
    if (wanted.arw_deg_rt_h > 0.0) limits.push_back({"arw_deg_rt_h", wanted.arw_deg_rt_h, random_walks_deg_rt_h(arm)});
    if (wanted.bias_stability_deg_h > 0.0) {
        limits.push_back({"bias_stability_deg_h", wanted.bias_stability_deg_h, deviations_at(study, arm, wanted.at_s)});
    }
    if (wanted.rate_error_deg_h > 0.0)
        limits.push_back({"rate_error_deg_h", wanted.rate_error_deg_h, rate_errors(arm)});
    if (wanted.scale_factor_error_ppm > 0.0) {
        limits.push_back({"scale_factor_error_ppm", wanted.scale_factor_error_ppm, scale_factor_errors(study, arm)});
    }
    if (wanted.angle_error_arcsec > 0.0) {
        limits.push_back(
            {"angle_error_arcsec", wanted.angle_error_arcsec, angle_errors(arm, study.angle_times_s.size() - 1)});
    }
    return limits;
}

}  // namespace

std::vector<bool> passed_gyros(const Study& study, const ArmStatistics& arm) {
    const Members members = members_of(study, arm);
    std::vector<bool> passed(members.count(), true);
    for (const Limit& limit : limits_of(study, arm)) {
        const std::vector<bool> within = limit.holds(members);
        for (std::size_t i = 0; i < passed.size(); ++i) passed[i] = passed[i] && within[i];
    }
    return passed;
}

Yield yield_of(const Study& study, const ArmStatistics& arm) {
    const Members members = members_of(study, arm);
    const auto gyros = static_cast<std::int64_t>(members.count());
    const lot::Confidence confidence = confidence_of(study.scenario);
    Yield yield;
    for (const Limit& limit : limits_of(study, arm)) {
        const std::vector<bool> within = limit.holds(members);
        yield.limits.push_back(
            {limit.name, limit.most, lot::share(std::count(within.begin(), within.end(), true), gyros, confidence)});
    }
    const std::vector<bool> passed = passed_gyros(study, arm);
    yield.share = lot::share(std::count(passed.begin(), passed.end(), true), gyros, confidence);
    const auto worst = std::min_element(yield.limits.begin(), yield.limits.end(),
                                        [](const auto& a, const auto& b) { return a.share.k < b.share.k; });
    if (worst != yield.limits.end() && worst->share.k < gyros) yield.fails_most = worst->name;
    return yield;
}

}  // namespace ringlock::study
