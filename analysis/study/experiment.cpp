#include "analysis/study/experiment.hpp"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <chrono>
#include <ratio>
#include <utility>

#include "analysis/lot/stopping.hpp"
#include "analysis/study/lot_figures.hpp"

namespace ringlock::study {

Experiment::Experiment(const scenario::Scenario& what, std::vector<Axis> with_axes)
    : scenario(what), axes(std::move(with_axes)) {
    if (axes.empty()) {
        points.emplace_back(scenario);
        return;
    }
    const std::size_t count = axes.front().values.size();
    points.reserve(count);
    for (std::size_t point = 0; point < count; ++point) points.emplace_back(scenario_at(scenario, axes, point));
}

std::int64_t Experiment::gyros() const {
    std::int64_t sum = 0;
    for (const Study& study : points) sum += static_cast<std::int64_t>(study.gyros.size());
    return sum;
}

std::int64_t Experiment::turns() const {
    std::int64_t sum = 0;
    for (const Study& study : points) sum += study.turns;
    return sum;
}

namespace {

/// What the rule judges at a look: random walks of arms whose records show them, and yields, of all points.
struct Judged {
    std::vector<std::string> names;
    std::vector<std::vector<double>> walks;
    std::vector<lot::ArwColumn> columns;
    std::vector<lot::YieldCount> yields;
};

Judged judged(const Experiment& experiment, const std::vector<Summary>& summaries) {
    Judged all;
    for (std::size_t p = 0; p < summaries.size(); ++p) {
        const std::string point = experiment.has_design() ? fmt::format("point {}, ", p + 1) : "";
        for (std::size_t a = 0; a < summaries[p].arms.size(); ++a) {
            const ArmSummary& arm = summaries[p].arms[a];
            if (arm.yield) all.yields.push_back({fmt::format("yield of {}{}", point, arm.name), arm.yield->share.k});
            if (!arm.arw_deg_rt_h.median) continue;
            all.names.push_back(point + arm.name);
            all.walks.push_back(random_walks_deg_rt_h(experiment.points[p].arms[a]));
        }
    }
    for (std::size_t i = 0; i < all.walks.size(); ++i) all.columns.push_back({all.names[i], all.walks[i]});
    return all;
}

lot::StoppingRule rule_of(const scenario::Stop& stop) {
    lot::Precision precision;
    if (stop.arw_relative > 0.0) precision.arw_relative = stop.arw_relative;
    if (stop.yield_absolute > 0.0) precision.yield_absolute = stop.yield_absolute;
    return {precision, stop.most_gyros};
}

/// The decision of the rule at a look; the wall time, and arms that show no random walk yet, are not known to the rule.
lot::Decision decide(const lot::StoppingRule& rule, const scenario::Stop& stop, std::int64_t gyros,
                     const Experiment& experiment, double hours) {
    const Judged all = judged(experiment, summarise(experiment));
    lot::Decision decision;
    if (stop.arw_relative > 0.0 && all.columns.empty()) {
        // Too few gyros for any arm to show a random walk: nothing to judge yet.
        decision.next = rule.next(gyros);
        decision.stop = !decision.next;
        decision.why = "no arm shows a random walk";
    } else {
        decision = rule.decide(gyros, all.columns, all.yields);
    }
    if (decision.stop || stop.most_hours == 0.0 || hours < stop.most_hours) return decision;
    decision.stop = true;
    decision.why =
        fmt::format("{:.3g} hours have gone by, stop.most_hours are {:g}; {}", hours, stop.most_hours, decision.why);
    return decision;
}

void grow(Experiment& experiment, std::int64_t gyros) {
    experiment.scenario.ensemble.gyros = gyros;
    for (Study& study : experiment.points) extend(study, gyros);
}

}  // namespace

Experiment run(Experiment experiment, int threads, const OnSamples& on_samples, const ensemble::Monitor& monitor) {
    const scenario::Stop stop = experiment.scenario.stop;
    if (!scenario::asks(stop)) {
        run(experiment.points, 0, threads, on_samples, monitor);
        return experiment;
    }
    const lot::StoppingRule rule = rule_of(stop);
    const auto start = std::chrono::steady_clock::now();
    Growth growth;
    std::optional<std::int64_t> next = rule.next(0);
    for (std::int64_t there = 0; next; there = growth.looks.back()) {
        grow(experiment, *next);
        run(experiment.points, there, threads, on_samples, monitor);
        growth.looks.push_back(*next);
        if (monitor.observer) monitor.observer->stage("judging the precision");
        const std::chrono::duration<double, std::ratio<3600>> gone = std::chrono::steady_clock::now() - start;
        const lot::Decision decision = decide(rule, stop, *next, experiment, gone.count());
        growth.precise = decision.precise;
        growth.why = decision.why;
        next = decision.stop ? std::nullopt : decision.next;
    }
    experiment.growth = std::move(growth);
    return experiment;
}

std::vector<Summary> summarise(const Experiment& experiment) {
    std::vector<Summary> summaries(experiment.points.size());
    oneapi::tbb::parallel_for(std::size_t{0}, summaries.size(),
                              [&](std::size_t i) { summaries[i] = summarise(experiment.points[i]); });
    return summaries;
}

std::optional<lot::PairedFigure> arw_over_first(const Experiment& experiment, const std::vector<Summary>& summaries,
                                                std::size_t point, std::size_t arm) {
    const auto shows = [&](std::size_t p) { return summaries[p].arms[arm].arw_deg_rt_h.median.has_value(); };
    if (!shows(0) || !shows(point)) return std::nullopt;
    return lot::paired_ratio(random_walks_deg_rt_h(experiment.points[point].arms[arm]),
                             random_walks_deg_rt_h(experiment.points.front().arms[arm]));
}

std::vector<std::optional<ScaleFactor>> scale_factors(const Experiment& experiment) {
    std::vector<std::optional<ScaleFactor>> lines;
    if (experiment.axes.size() != 1 || experiment.axes.front().key != "input.rate_deg_h") return lines;
    for (std::size_t arm = 0; arm < experiment.scenario.arms.size(); ++arm) {
        std::vector<double> errors_deg_h;
        for (const Study& study : experiment.points) {
            for (const GyroStatistics& gyro : study.arms[arm].gyros) errors_deg_h.push_back(gyro.rate_error_deg_h);
        }
        lines.push_back(scale_factor(experiment.axes.front().values, errors_deg_h));
    }
    return lines;
}

std::int64_t expected_turns(const Experiment& experiment) {
    std::int64_t sum = 0;
    for (const Study& study : experiment.points) {
        scenario::Scenario largest = study.scenario;
        if (scenario::asks(largest.stop)) largest.ensemble.gyros = largest.stop.most_gyros;
        sum += ensemble::expected_turns(largest, largest.arms);
    }
    return sum;
}

}  // namespace ringlock::study
