#include "analysis/study/experiment.hpp"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <memory>
#include <ratio>
#include <utility>

#include "analysis/lot/stopping.hpp"
#include "analysis/study/figures/lot_figures.hpp"

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

/// Figures that the rule judges at a look: random walks of arms whose records show them, and yields, of all points.
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

std::vector<Stretch> missing(std::size_t point, std::int64_t first, std::int64_t last, std::vector<Stretch> there) {
    std::sort(there.begin(), there.end(), [](const Stretch& a, const Stretch& b) { return a.first < b.first; });
    std::vector<Stretch> gaps;
    std::int64_t next = first;
    for (const Stretch& stretch : there) {
        if (stretch.first > next) gaps.push_back({point, next, stretch.first});
        next = stretch.last;
    }
    if (next < last) gaps.push_back({point, next, last});
    return gaps;
}

namespace {

/// Keeps nothing.
class NoStore final : public Store {
   public:
    explicit NoStore(const OnSamples& on_samples) : make_keeper_(hand_on(on_samples)) {}
    std::vector<Stretch> take_up(std::span<Study> points, std::int64_t first, std::int64_t) override {
        std::vector<Stretch> all;
        for (std::size_t point = 0; point < points.size(); ++point) {
            const Stretch rest{point, first, static_cast<std::int64_t>(points[point].gyros.size())};
            if (rest.first < rest.last) all.push_back(rest);
        }
        return all;
    }
    std::unique_ptr<BlockKeeper> keeper(std::size_t point, std::int64_t first_gyro, std::size_t gyros) override {
        return make_keeper_(point, first_gyro, gyros);
    }
    void collect(std::span<Study>, std::int64_t, std::int64_t) override {}
    double hours_before() const override { return 0.0; }

   private:
    MakeKeeper make_keeper_;
};

}  // namespace

Experiment run(Experiment experiment, int threads, Store& store, const ensemble::Monitor& monitor) {
    predict_noise(experiment.points, threads, monitor);
    const MakeKeeper make_keeper = [&](std::size_t point, std::int64_t first_gyro, std::size_t gyros) {
        return store.keeper(point, first_gyro, gyros);
    };
    const auto simulate = [&](std::int64_t first, std::int64_t last) {
        const std::vector<Stretch> stretches = store.take_up(experiment.points, first, last);
        run(experiment.points, stretches, threads, make_keeper, monitor);
        store.collect(experiment.points, first, last);
    };
    const scenario::Stop stop = experiment.scenario.stop;
    if (!scenario::asks(stop)) {
        simulate(0, std::numeric_limits<std::int64_t>::max());
        return experiment;
    }
    const lot::StoppingRule rule = rule_of(stop);
    const auto start = std::chrono::steady_clock::now();
    Growth growth;
    std::optional<std::int64_t> next = rule.next(0);
    for (std::int64_t there = 0; next; there = growth.looks.back()) {
        grow(experiment, *next);
        simulate(there, *next);
        growth.looks.push_back(*next);
        if (monitor.observer) monitor.observer->stage("judging the precision");
        const std::chrono::duration<double, std::ratio<3600>> gone = std::chrono::steady_clock::now() - start;
        const lot::Decision decision = decide(rule, stop, *next, experiment, store.hours_before() + gone.count());
        growth.precise = decision.precise;
        growth.why = decision.why;
        next = decision.stop ? std::nullopt : decision.next;
    }
    experiment.growth = std::move(growth);
    return experiment;
}

Experiment run(Experiment experiment, int threads, const OnSamples& on_samples, const ensemble::Monitor& monitor) {
    NoStore store(on_samples);
    return run(std::move(experiment), threads, store, monitor);
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
