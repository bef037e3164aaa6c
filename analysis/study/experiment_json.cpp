#include "analysis/study/experiment_json.hpp"

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "analysis/study/reader_facts.hpp"
#include "analysis/study/sensitivity.hpp"
#include "engine/core/json_text.hpp"
#include "engine/scenario/read_arms.hpp"

namespace ringlock::study {

namespace {

using Json = nlohmann::ordered_json;

Json number(std::optional<double> value) { return value && std::isfinite(*value) ? Json(*value) : Json(nullptr); }

Json json_figure(const Figure& figure) {
    return {{"median", number(figure.median)},
            {"lo", number(figure.lo)},
            {"hi", number(figure.hi)},
            {"median_ci", figure.median_lo ? Json{number(figure.median_lo), number(figure.median_hi)} : Json(nullptr)},
            {"resolved", figure.resolved}};
}

Json json_mean(const MeanFigure& figure) {
    return {{"mean", number(figure.mean)}, {"lo", number(figure.lo)}, {"hi", number(figure.hi)}};
}

Json json_signed(const SignedFigure& figure) {
    return {{"mean", number(figure.mean)}, {"lo", number(figure.lo)}, {"hi", number(figure.hi)}};
}

Json json_size(const SizeFigure& figure) {
    return {{"value", number(figure.value)}, {"lo", number(figure.lo)}, {"hi", number(figure.hi)}};
}

/// The line through the rates of a sweep; every field is null if no line was fitted.
void add_scale_factor(Json& json, const std::optional<ScaleFactor>& line) {
    const auto add = [&](const char* name, const auto& what) { json[name] = line ? what(*line) : Json(nullptr); };
    using Line = ScaleFactor;
    add("scale_factor_error_ppm", [](const Line& l) { return json_signed(l.scale_factor_ppm); });
    add("scale_factor_repeatability_ppm", [](const Line& l) {
        Json repeatability = json_size(l.repeatability_ppm);
        repeatability["noise"] = number(l.noise_ppm);
        repeatability["beyond_noise"] = json_size(l.beyond_noise_ppm);
        return repeatability;
    });
    add("bias_deg_h", [](const Line& l) {
        Json bias = json_signed(l.bias_deg_h);
        bias["sd"] = number(l.bias_spread_deg_h);
        return bias;
    });
    add("largest_deviation_deg_h", [](const Line& l) {
        Json largest = json_size(l.largest_deviation_deg_h);
        largest["input_rate_deg_h"] = l.largest_deviation_at_deg_h;
        return largest;
    });
    add("nonlinearity_ppm", [](const Line& l) { return json_size(l.nonlinearity_ppm); });
    add("gyro_deviation_deg_h", [](const Line& l) {
        return Json{{"median", number(l.gyro_deviation_deg_h)},
                    {"lo", number(l.gyro_deviation_lo_deg_h)},
                    {"hi", number(l.gyro_deviation_hi_deg_h)}};
    });
    add("scatter_deg_h", [](const Line& l) { return number(l.scatter_deg_h); });
}

Json json_reduction(const std::optional<Reduction>& reduction) {
    if (!reduction) return nullptr;
    return {{"ratio", number(reduction->ratio)}, {"lo", number(reduction->lo)}, {"hi", number(reduction->hi)}};
}

Json json_family(const std::vector<FamilyDeviation>& family) {
    Json json = Json::object();
    for (const FamilyDeviation& one : family) {
        Json list = Json::array();
        for (const EnsemblePoint& point : one.points) {
            list.push_back({{"tau_s", point.tau_s},
                            {"dev", number(point.dev_deg_h)},
                            {"lo", number(point.lo)},
                            {"hi", number(point.hi)},
                            {"edf", number(point.edf)}});
        }
        json[std::string(allan::name(one.estimator))] = std::move(list);
    }
    return json;
}

Json json_spread(const std::vector<dither::AngleSpread>& spread) {
    Json list = Json::array();
    for (const dither::AngleSpread& s : spread) {
        list.push_back({{"after_s", s.after_s}, {"arcsec", number(s.arcsec)}});
    }
    return list;
}

Json json_noise(const NoiseFigures& figures) {
    const dither::NoiseEffectiveness& predicted = figures.predicted;
    const auto& seen = figures.measured;
    Json json{{"input_rate_deg_h", predicted.input_rate_deg_h},
              {"change_per_cycle_rad", number(predicted.change_per_cycle_rad)},
              {"change_per_cycle_percent", number(figures.change_per_cycle_percent)},
              {"arw_over_theory", number(predicted.arw_over_theory)},
              {"bias_deg_h", number(predicted.bias_deg_h)},
              {"reason", predicted.reason.empty() ? Json(nullptr) : Json(predicted.reason)},
              {"not_randomised", figures.not_randomised.empty() ? Json(nullptr) : Json(figures.not_randomised)}};
    json["measured"] = {{"change_per_cycle_rad", number(seen.change_per_cycle_rad)},
                        {"arw_over_theory", number(seen.arw_over_theory)},
                        {"bias_deg_h", number(seen.bias_deg_h)},
                        {"bias_se_deg_h", number(seen.bias_error_deg_h)}};
    if (!predicted.angle_spread.empty()) {
        json["angle_spread"] = json_spread(predicted.angle_spread);
        json["measured"]["angle_spread"] = json_spread(seen.angle_spread);
    }
    return json;
}

Json json_arw_theory(const ArwTheory& theory) {
    Json effects = Json::object();
    for (const auto& [effect, deg_rt_h] : theory.effects_deg_rt_h) effects[effect] = deg_rt_h;
    return {{"arw_deg_rt_h", theory.total_deg_rt_h},
            {"lockin_arw_deg_rt_h", theory.lockin_deg_rt_h},
            {"effects_arw_deg_rt_h", std::move(effects)}};
}

Json json_share(const lot::Share& share) {
    return {{"value", number(share.value)},
            {"lo", share.interval ? Json(share.interval->lo) : Json(nullptr)},
            {"hi", share.interval ? Json(share.interval->hi) : Json(nullptr)},
            {"passed", share.k},
            {"gyros", share.n}};
}

Json json_yield(const Yield& yield) {
    Json json = json_share(yield.share);
    json["fails_most"] = yield.fails_most.empty() ? Json(nullptr) : Json(yield.fails_most);
    json["limits"] = Json::object();
    for (const LimitYield& limit : yield.limits) {
        json["limits"][limit.name] = json_share(limit.share);
        json["limits"][limit.name]["most"] = limit.most;
    }
    return json;
}

Json json_lot(const std::vector<LotFigure>& figures) {
    Json json = Json::object();
    for (const LotFigure& figure : figures) {
        Json list = Json::array();
        for (const lot::Quantile& q : figure.quantiles) {
            list.push_back({{"p", q.p},
                            {"value", number(q.value)},
                            {"lo", number(q.lo)},
                            {"hi", number(q.hi)},
                            {"missing", q.missing}});
        }
        json[figure.name] = std::move(list);
    }
    return json;
}

Json json_paired(const lot::PairedFigure& figure) {
    return {{"value", number(figure.value)},
            {"lo", figure.interval ? number(figure.interval->lo) : Json(nullptr)},
            {"hi", figure.interval ? number(figure.interval->hi) : Json(nullptr)},
            {"distinguishable", figure.distinguishable},
            {"gyros", figure.pairs}};
}

Json json_allan(const std::vector<EnsemblePoint>& points) {
    Json list = Json::array();
    for (const EnsemblePoint& point : points) {
        list.push_back({{"tau_s", point.tau_s},
                        {"dev_deg_h", number(point.dev_deg_h)},
                        {"lo", number(point.lo)},
                        {"hi", number(point.hi)},
                        {"edf", number(point.edf)}});
    }
    return list;
}

Json json_interval(double value, const std::optional<lot::Interval>& interval) {
    return {{"value", number(value)},
            {"lo", interval ? number(interval->lo) : Json(nullptr)},
            {"hi", interval ? number(interval->hi) : Json(nullptr)}};
}

Json json_scatter(const Scatter& scatter) {
    return {{"sd_deg_h", number(scatter.sd_deg_h)},
            {"lo", number(scatter.interval.lo)},
            {"hi", number(scatter.interval.hi)},
            {"degrees_of_freedom", scatter.degrees_of_freedom}};
}

Json json_arm(const ArmSummary& arm) {
    Json json{{"gyros", arm.gyros},
              {"arw_deg_rt_h", has_arw(arm) ? json_figure(arm.arw_deg_rt_h) : Json(nullptr)},
              {"arw_reason", arm.arw_reason.empty() ? Json(nullptr) : Json(arm.arw_reason)},
              {"theory", json_arw_theory(arm.arw_theory)},
              {"bias_instability_deg_h",
               arm.bias_instability_deg_h ? json_figure(*arm.bias_instability_deg_h) : Json(nullptr)},
              {"arw_reduction", json_reduction(arm.arw_reduction)},
              {"rate_error_deg_h", json_mean(arm.rate_error_deg_h)}};
    if (!arm.lot.empty()) json["quantiles"] = json_lot(arm.lot);
    const auto& mean = arm.arw_mean_deg_rt_h;
    json["arw_mean_deg_rt_h"] = mean.value ? json_interval(*mean.value, mean.interval) : Json(nullptr);
    json["average_scatter"] = Json::array();
    for (const AverageScatter& average : arm.scatter) {
        Json scatter = json_scatter(average.scatter);
        scatter["after_s"] = average.after_s;
        json["average_scatter"].push_back(std::move(scatter));
    }
    json["turn_on_repeatability"] =
        arm.turn_on_repeatability ? json_scatter(*arm.turn_on_repeatability) : Json(nullptr);
    if (arm.yield) json["yield"] = json_yield(*arm.yield);
    if (arm.noise_effectiveness) json["noise_effectiveness"] = json_noise(*arm.noise_effectiveness);
    add_scale_factor(json, arm.scale_factor);
    json["allan"] = json_allan(arm.allan);
    if (!arm.asked.empty()) json["asked"] = json_allan(arm.asked);
    if (!arm.family.empty()) json["deviations"] = json_family(arm.family);
    if (!arm.sweep.empty()) {
        json["locked_up_to_deg_h"] = number(locked_up_to_deg_h(arm));
        json["sweep"] = Json::array();
        for (const SweepPoint& point : arm.sweep) {
            Json rate{{"input_rate_deg_h", point.input_rate_deg_h},
                      {"output_rate_deg_h", json_mean(point.output_rate_deg_h)},
                      {"locked", point.locked},
                      {"gyros", point.gyros}};
            if (point.closed_form_rate_deg_h) rate["closed_form_rate_deg_h"] = number(point.closed_form_rate_deg_h);
            json["sweep"].push_back(std::move(rate));
        }
        if (has_closed_form(arm)) {
            json["steps"] = Json::array();
            for (const Step& step : arm.steps) {
                json["steps"].push_back({{"order", step.order},
                                         {"output_rate_deg_h", step.output_rate_deg_h},
                                         {"first_input_rate_deg_h", step.first_deg_h},
                                         {"last_input_rate_deg_h", step.last_deg_h}});
            }
        }
    }
    return json;
}

Json json_reader(const scenario::Scenario& scenario) {
    Json json = Json::object();
    for (const ReaderFact& fact : reader_facts(scenario)) {
        std::visit([&](const auto& value) { json[fact.name] = value; }, fact.value);
    }
    return json;
}

/// Arms, theory and pairs: the part that every point of a design has.
void add_summary(Json& json, const Study& study, const Summary& summary) {
    json["sample_interval_s"] = study.schedule.sample_interval_s;
    if (scenario::reads_arms(study.scenario)) json["reader"] = json_reader(study.scenario);
    json["turn_map_error_rad"] = number(study.turn_map_error_rad);
    json["arms"] = Json::object();
    for (const ArmSummary& arm : summary.arms) json["arms"][arm.name] = json_arm(arm);
    json["theory"] = {{"arw_deg_rt_h", number(summary.theory.arw_deg_rt_h)},
                      {"arw_first_order_deg_rt_h", number(summary.theory.arw_first_order_deg_rt_h)},
                      {"dead_band_deg_h", number(summary.theory.dead_band_deg_h)}};
    json["pairs"] = Json::array();
    for (const ArmPair& pair : summary.pairs) {
        json["pairs"].push_back({{"arms", {pair.first, pair.second}},
                                 {"figure", "arw_deg_rt_h"},
                                 {"ratio", json_paired(pair.arw_deg_rt_h.ratio)},
                                 {"difference", json_paired(pair.arw_deg_rt_h.difference)}});
    }
}

Json json_index(const design::Index& index) {
    return {{"value", number(index.estimate)}, {"lo", number(index.lo)}, {"hi", number(index.hi)}};
}

Json json_sensitivity(const Experiment& experiment) {
    Json json = Json::object();
    for (const ArmSensitivity& arm : sensitivity(experiment)) {
        for (const SensitiveFigure& figure : arm.figures) {
            const design::OutputIndices& found = figure.indices;
            Json one{{"base_points", found.base_points},
                     {"left_out", found.left_out},
                     {"mean", number(found.mean)},
                     {"variance", number(found.variance)},
                     {"noise_share", number(found.noise_share)},
                     {"absent", found.absent.empty() ? Json(nullptr) : Json(found.absent)},
                     {"keys", Json::object()}};
            for (std::size_t k = 0; k < found.factors.size(); ++k) {
                one["keys"][experiment.axes[k].key] = {{"first", json_index(found.factors[k].first)},
                                                       {"total", json_index(found.factors[k].total)}};
            }
            json[arm.arm][figure.name] = std::move(one);
        }
    }
    return json;
}

Json json_design(const Experiment& experiment, const std::vector<Summary>& summaries) {
    Json json{{"keys", Json::array()}, {"points", Json::array()}};
    for (const Axis& axis : experiment.axes) json["keys"].push_back({{"key", axis.key}, {"unit", axis.unit}});
    for (std::size_t p = 0; p < experiment.points.size(); ++p) {
        Json point{{"values", Json::object()}};
        for (const Axis& axis : experiment.axes) point["values"][axis.key] = axis.values[p];
        add_summary(point, experiment.points[p], summaries[p]);
        for (std::size_t arm = 0; arm < summaries[p].arms.size(); ++arm) {
            const auto over_first = arw_over_first(experiment, summaries, p, arm);
            point["arms"][summaries[p].arms[arm].name]["arw_over_first_point"] =
                over_first ? json_paired(*over_first) : Json(nullptr);
        }
        json["points"].push_back(std::move(point));
    }
    if (experiment.scenario.design.sensitivity_base_points > 0) json["sensitivity"] = json_sensitivity(experiment);
    const auto lines = scale_factors(experiment);
    if (!lines.empty()) {
        json["scale_factor"] = Json::object();
        for (std::size_t arm = 0; arm < lines.size(); ++arm) {
            Json line = Json::object();
            add_scale_factor(line, lines[arm]);
            json["scale_factor"][experiment.scenario.arms[arm].name] = std::move(line);
        }
    }
    return json;
}

}  // namespace

std::string experiment_json(const Experiment& experiment, const std::vector<Summary>& summaries,
                            const store::Provenance& provenance) {
    const std::int64_t turns = experiment.turns();
    Json json{{"scenario", provenance.scenario_file},
              {"seed", experiment.scenario.ensemble.seed},
              {"turns", turns},
              {"wall_s", number(provenance.wall_s)},
              {"turns_per_s", number(static_cast<double>(turns) / provenance.wall_s)}};
    if (experiment.growth) {
        json["stop"] = {{"gyros", experiment.growth->looks.back()},
                        {"looks", experiment.growth->looks},
                        {"precise", experiment.growth->precise},
                        {"why", experiment.growth->why}};
    }
    if (experiment.has_design()) {
        json["design"] = json_design(experiment, summaries);
    } else {
        add_summary(json, experiment.points.front(), summaries.front());
    }
    return json_text(json, 2) + "\n";
}

}  // namespace ringlock::study
