#include "analysis/study/sensitivity.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "analysis/study/figures/lot_figures.hpp"

namespace ringlock::study {

namespace {

/// Mean of the gyros and the variance of that mean.
struct Evaluation {
    double mean = std::numeric_limits<double>::quiet_NaN();
    double variance = 0.0;
};

Evaluation evaluate(const std::vector<double>& values) {
    Evaluation result;
    const auto n = static_cast<double>(values.size());
    double sum = 0.0;
    for (const double value : values) sum += value;
    if (!std::isfinite(sum)) return result;
    result.mean = sum / n;
    if (values.size() < 2) return result;
    double squares = 0.0;
    for (const double value : values) squares += (value - result.mean) * (value - result.mean);
    result.variance = squares / (n - 1.0) / n;
    return result;
}

struct NamedValues {
    std::string name;
    std::vector<double> of_gyros;
};

/// The figures of one arm at one point, the same at all points.
std::vector<NamedValues> figures_of(const Study& study, const ArmStatistics& arm) {
    std::vector<NamedValues> out;
    const auto logarithms = [](std::vector<double> values) {
        for (double& value : values) value = value > 0.0 ? std::log(value) : std::nan("");
        return values;
    };
    out.push_back({"log_arw_deg_rt_h", logarithms(random_walks_deg_rt_h(arm))});
    for (const LotValues& figure : lot_values(study, arm)) {
        const bool deviation = figure.name.starts_with("allan_deviation");
        if (deviation) out.push_back({"log_" + figure.name, logarithms(figure.values)});
        if (figure.name == "rate_error_deg_h") out.push_back({figure.name, figure.values});
    }
    if (!scenario::asks(study.scenario.specification)) return out;
    std::vector<double> passes;
    for (const bool passed : passed_gyros(study, arm)) passes.push_back(passed ? 1.0 : 0.0);
    out.push_back({"yield", std::move(passes)});
    return out;
}

}  // namespace

std::vector<ArmSensitivity> sensitivity(const Experiment& experiment) {
    std::vector<ArmSensitivity> found;
    const auto base_points = static_cast<std::size_t>(experiment.scenario.design.sensitivity_base_points);
    if (base_points == 0) return found;
    for (std::size_t arm = 0; arm < experiment.scenario.arms.size(); ++arm) {
        std::vector<std::string> names;
        std::vector<double> values;
        std::vector<double> variances;
        for (const Study& study : experiment.points) {
            names.clear();
            for (const NamedValues& figure : figures_of(study, study.arms[arm])) {
                const Evaluation evaluation = evaluate(figure.of_gyros);
                names.push_back(figure.name);
                values.push_back(evaluation.mean);
                variances.push_back(evaluation.variance);
            }
        }
        design::Evaluations evaluations{base_points, experiment.axes.size(), names.size(), values, {}};
        if (experiment.scenario.ensemble.gyros > 1) evaluations.noise_variance = variances;
        const auto indices = design::sensitivity_indices(evaluations, {.seed = experiment.scenario.ensemble.seed});
        ArmSensitivity one{experiment.scenario.arms[arm].name, {}};
        for (std::size_t i = 0; i < names.size(); ++i) one.figures.push_back({names[i], indices[i]});
        found.push_back(std::move(one));
    }
    return found;
}

}  // namespace ringlock::study
