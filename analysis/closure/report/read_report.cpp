#include "analysis/closure/report/read_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "analysis/closure/report/report.hpp"
#include "engine/core/error.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/read_json.hpp"
#include "engine/store/hdf5.hpp"

namespace ringlock::closure {

namespace {

using nlohmann::json;

std::vector<Estimate> estimates_in(const json& object, const std::string& effect) {
    std::vector<Estimate> estimates;
    for (const auto& [name, one] : object.get_ref<const json::object_t&>()) {
        Estimate estimate{effect, name, std::numeric_limits<double>::quiet_NaN(), number_or_nan(one.at("std"))};
        if (one.at("value").is_string()) {
            estimate.text = one.at("value").get<std::string>();
        } else {
            estimate.value = number_or_nan(one.at("value"));
        }
        estimates.push_back(std::move(estimate));
    }
    return estimates;
}

const effects::Effect* effect_named(const std::string& name) {
    if (const effects::Effect* effect = effects::find(name)) return effect;
    throw InputError(fmt::format("the effect \"{}\" is none that this program knows", printable(name)));
}

Verdict verdict_named(const std::string& name) {
    for (const Verdict verdict : {Verdict::nothing_missing, Verdict::closed, Verdict::unexplained}) {
        if (name_of(verdict) == name) return verdict;
    }
    throw InputError(fmt::format(
        "verdict: \"{}\" is none; it must be \"nothing_missing\", \"closed\" or \"unexplained\"", printable(name)));
}

Where where_named(const std::string& name) {
    for (const Where where :
         {Where::phase, Where::time, Where::frequency, Where::temperature, Where::rate, Where::amplitude}) {
        if (name_of(where) == name) return where;
    }
    throw InputError(fmt::format("where: \"{}\" is no kind of structure of a residual", printable(name)));
}

Step step_in(const json& object) {
    Step step;
    step.effect = effect_named(object.at("effect").get<std::string>());
    step.parameters = estimates_in(object.at("parameters"), step.name());
    step.heldout_error_before = number_or_nan(object.at("heldout_error_before"));
    step.heldout_error_after = number_or_nan(object.at("heldout_error_after"));
    step.heldout_log_score_gain = number_or_nan(object.at("heldout_log_score_gain"));
    step.p_value = number_or_nan(object.at("p_value"));
    if (object.contains("confounded_with")) {
        for (const json& name : object.at("confounded_with")) {
            step.confounded_with.push_back(effect_named(name.get<std::string>()));
        }
        step.experiment = object.value("experiment", "");
    }
    return step;
}

std::vector<std::string> texts_in(const json& list) { return list.get<std::vector<std::string>>(); }

void read_statistics(const json& object, Predictive& predictive) {
    predictive.simulations = object.at("simulations").get<int>();
    predictive.notes = texts_in(object.at("notes"));
    for (const json& one : object.at("statistics")) {
        PredictiveStatistic statistic;
        statistic.name = one.at("name").get<std::string>();
        statistic.p_value_all = number_or_nan(one.at("p_value"));
        statistic.largest = number_or_nan(one.at("largest_deviation"));
        predictive.statistics.push_back(std::move(statistic));
    }
}

/// Point by point, from closure.h5.
void read_points(const store::Group& group, PredictiveStatistic& statistic) {
    statistic.description = group.string_attribute("description");
    const store::Dataset x = group.dataset("x");
    statistic.x = x.read<double>();
    statistic.x_unit = x.unit();
    statistic.x_name = x.description();
    const store::Dataset measured = group.dataset("measured");
    statistic.unit = measured.unit();
    statistic.measured = measured.read<double>();
    statistic.lowest = group.dataset("lowest").read<double>();
    statistic.highest = group.dataset("highest").read<double>();
    for (const auto& [name, values] :
         {std::pair{"measured_whole", &statistic.measured_whole}, std::pair{"base", &statistic.base}}) {
        if (group.has_dataset(name)) *values = group.dataset(name).read<double>();
    }
    for (const auto* values :
         {&statistic.measured, &statistic.lowest, &statistic.highest, &statistic.measured_whole, &statistic.base}) {
        if (values->empty() || values->size() == statistic.x.size()) continue;
        throw InputError(fmt::format("{}: {}: its datasets differ in length", printable(group.file()), group.path()));
    }
}

void read_residual(const store::Group& group, Residual& residual) {
    residual.time_s = group.dataset("time_s").read<double>();
    residual.innovation = group.dataset("innovation").read<double>();
    residual.sd = group.dataset("sd").read<double>();
    if (residual.innovation.size() == residual.time_s.size() && residual.sd.size() == residual.time_s.size()) return;
    throw InputError(fmt::format("{}: {}: its datasets differ in length", printable(group.file()), group.path()));
}

}  // namespace

Report report_of(const json& object) {
    Report report;
    Closure& closure = report.closure;
    closure.verdict = verdict_named(object.at("verdict").get<std::string>());
    closure.base = estimates_in(object.at("base"), "");
    for (const json& step : object.at("steps")) closure.steps.push_back(step_in(step));
    const json& error = object.at("heldout_error");
    closure.unit = error.at("unit").get<std::string>();
    closure.heldout_before = number_or_nan(error.at("before"));
    closure.heldout_after = number_or_nan(error.at("after"));
    closure.noise_floor = number_or_nan(error.at("noise_floor"));
    const json& left = object.at("unexplained");
    if (left.at("present").get<bool>()) {
        closure.unexplained = ResidualTest{where_named(left.at("where").get<std::string>()), "", 1.0, "", 0.0};
        report.unexplained_text = left.at("detail").get<std::string>();
    } else if (closure.verdict == Verdict::unexplained) {
        throw InputError("verdict: is \"unexplained\", but unexplained.present is false");
    }
    for (const json& test : object.at("tests")) {
        closure.tests.push_back({where_named(test.at("where").get<std::string>()), test.at("view").get<std::string>(),
                                 number_or_nan(test.at("p_value")), test.at("detail").get<std::string>(), 0.0});
    }
    closure.level = number_or_nan(object.at("family_wise_level"));
    closure.notes = texts_in(object.at("notes"));
    if (object.contains("predictive")) read_statistics(object.at("predictive"), report.predictive);
    if (object.contains("closed")) {
        report.placeholders = texts_in(object.at("closed").at("placeholders"));
        report.not_held = texts_in(object.at("closed").at("not_held"));
    }
    return report;
}

Report read_report(const std::filesystem::path& folder) {
    Report report;
    const std::filesystem::path file = folder / "closure.json";
    read_json(file, "closure.json of ringlock closure -o", [&](const json& object) { report = report_of(object); });
    store::guarded(folder / "closure.h5", [&](const store::GuardedPath& path) {
        const store::File h5 = store::File::open(path);
        if (!h5.has_attribute("format") || h5.string_attribute("format") != "rlg-closure") {
            throw InputError(
                fmt::format("{}: attribute format is not \"rlg-closure\"; ringlock closure -o writes the file",
                            printable(folder / "closure.h5")));
        }
        report.source = h5.string_attribute("source");
        read_residual(h5.group("residual"), report.closure.residual);
        for (PredictiveStatistic& statistic : report.predictive.statistics) {
            const std::string name = "predictive/" + statistic.name;
            if (h5.has_group(name)) read_points(h5.group(name), statistic);
        }
        return true;
    });
    return report;
}

std::string verdict_sentence(const Report& report) {
    if (!report.closure.unexplained) return verdict_sentence(report.closure);
    return unexplained_sentence(report.closure.unexplained->where, report.unexplained_text);
}

}  // namespace ringlock::closure
