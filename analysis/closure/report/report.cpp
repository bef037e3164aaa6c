#include "analysis/closure/report/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "analysis/closure/report/folder.hpp"
#include "analysis/closure/report/seal.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"
#include "engine/scenario/keys/schema.hpp"
#include "engine/store/atomic_file.hpp"

namespace ringlock::closure {

namespace {

using nlohmann::json;

json number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json estimates_json(const std::vector<Estimate>& estimates) {
    json object = json::object();
    for (const Estimate& estimate : estimates) {
        object[estimate.name] = {{"value", number(estimate.value)}, {"std", number(estimate.sd)}};
        if (!estimate.text.empty()) object[estimate.name]["value"] = estimate.text;
    }
    return object;
}

std::string value_text(const Estimate& e) {
    if (!std::isfinite(e.sd)) return fmt::format("  {:<26} {:>14.8g}    (no standard error)", e.name, e.value);
    return fmt::format("  {:<26} {:>14.8g} +- {:.2g}", e.name, e.value, e.sd);
}

}  // namespace

nlohmann::json to_json(const Closure& closure) {
    json object;
    object["verdict"] = name_of(closure.verdict);
    object["base"] = estimates_json(closure.base);
    object["steps"] = json::array();
    for (const Step& step : closure.steps) {
        json s = {{"effect", step.effect->name()},
                  {"parameters", estimates_json(step.parameters)},
                  {"heldout_error_before", number(step.heldout_error_before)},
                  {"heldout_error_after", number(step.heldout_error_after)},
                  {"heldout_log_score_gain", number(step.heldout_log_score_gain)},
                  {"p_value", number(step.p_value)}};
        if (!step.confounded_with.empty()) {
            s["confounded_with"] = names_of(step.confounded_with);
            s["experiment"] = step.experiment;
        }
        object["steps"].push_back(std::move(s));
    }
    object["heldout_error"] = {{"unit", closure.unit},
                               {"before", number(closure.heldout_before)},
                               {"after", number(closure.heldout_after)},
                               {"noise_floor", number(closure.noise_floor)}};
    json unexplained = {{"present", closure.unexplained.has_value()}};
    if (closure.unexplained) {
        unexplained["where"] = name_of(closure.unexplained->where);
        unexplained["detail"] = closure.unexplained->description();
    } else {
        unexplained["where"] = nullptr;
        unexplained["detail"] = "";
    }
    object["unexplained"] = std::move(unexplained);
    object["tests"] = json::array();
    for (const ResidualTest& test : closure.tests) {
        object["tests"].push_back({{"where", name_of(test.where)},
                                   {"view", test.subject},
                                   {"p_value", number(test.p_value)},
                                   {"detail", test.detail}});
    }
    object["gaps"] = json::array();
    for (const TimeSpan& gap : closure.gaps) {
        object["gaps"].push_back({{"from_s", number(gap.from_s)}, {"to_s", number(gap.to_s)}});
    }
    object["family_wise_level"] = closure.level;
    object["notes"] = closure.notes;
    return object;
}

nlohmann::json to_json(const ClosedScenario& closed) {
    return {{"placeholders", closed.placeholders()}, {"not_held", closed.not_held}};
}

std::string verdict_sentence(const Closure& closure) {
    switch (closure.verdict) {
        case Verdict::nothing_missing:
            return "nothing missing: the residual of the base model is consistent with chance";
        case Verdict::closed:
            return "closed: with the effects below, the residual is consistent with chance";
        case Verdict::unexplained:
            break;
    }
    return unexplained_sentence(closure.unexplained->where, closure.unexplained->description());
}

std::string unexplained_sentence(Where where, const std::string& description) {
    return fmt::format("unexplained: the residual has structure that no effect of the library explains, in {}: {}",
                       name_of(where), description);
}

std::string to_text(const Closure& closure) {
    std::string text;
    const auto line = [&](const std::string& s) { text += s + "\n"; };
    line(verdict_sentence(closure));
    line("");
    line("base model:");
    for (const Estimate& e : closure.base) line(value_text(e));
    for (std::size_t k = 0; k < closure.steps.size(); ++k) {
        const Step& step = closure.steps[k];
        line("");
        line(fmt::format("step {}: {}   (by chance: p {})", k + 1, step.effect->name(), probability(step.p_value)));
        for (const Estimate& e : step.parameters) {
            line(e.text.empty() ? value_text(e) : fmt::format("  {:<26} {:>14}", e.name, e.text));
        }
        line(fmt::format("  held-out error {:.6g} -> {:.6g} {}, log-score {:+.1f}", step.heldout_error_before,
                         step.heldout_error_after, closure.unit, step.heldout_log_score_gain));
        if (!step.confounded_with.empty()) {
            line(fmt::format("  tied with: {} (the record supports these effects equally well)",
                             fmt::join(names_of(step.confounded_with), ", ")));
            line(fmt::format("  to distinguish them: {}", step.experiment));
        }
    }
    line("");
    line(fmt::format("held-out one-step error: {:.6g} {} before, {:.6g} after; the fitted noise alone gives {:.6g}",
                     closure.heldout_before, closure.unit, closure.heldout_after, closure.noise_floor));
    line("");
    line("tests of the residual:");
    for (const ResidualTest& test : closure.tests) {
        line(fmt::format("  {:<11} {:<62} p {}", name_of(test.where), test.subject, probability(test.p_value)));
    }
    for (const std::string& note : closure.notes) line("note: " + note);
    return text;
}

nlohmann::json to_json(const Predictive& predictive) {
    json statistics = json::array();
    for (const PredictiveStatistic& statistic : predictive.statistics) {
        json one = {{"name", statistic.name},
                    {"points", statistic.x.size()},
                    {"p_value", number(statistic.p_value_all)},
                    {"largest_deviation", number(statistic.largest)}};
        if (!statistic.x.empty()) {
            one["at"] = {{"what", statistic.x_name}, {"value", number(statistic.x[statistic.at])}};
            one["at"]["unit"] = statistic.x_unit;
        }
        statistics.push_back(std::move(one));
    }
    return {{"simulations", predictive.simulations}, {"statistics", statistics}, {"notes", predictive.notes}};
}

std::string to_text(const Predictive& predictive) {
    std::string text;
    if (predictive.simulations > 0) {
        text += fmt::format("among {} simulations of this model:\n", predictive.simulations);
    }
    for (const PredictiveStatistic& statistic : predictive.statistics) {
        text += fmt::format("  {:<74} p {:.2g}\n", statistic.description, statistic.p_value_all);
    }
    for (const std::string& note : predictive.notes) text += "note: " + note + "\n";
    return text;
}

namespace {

void write_predictive(store::File& h5, const Predictive& predictive) {
    store::Group all = h5.create_group("predictive");
    all.set_attribute("simulations", predictive.simulations);
    for (const PredictiveStatistic& statistic : predictive.statistics) {
        store::Group group = all.create_group(statistic.name);
        group.set_attribute("description", std::string_view(statistic.description));
        group.set_attribute("p_value", statistic.p_value_all);
        group.set_attribute("largest_deviation", statistic.largest);
        group.write("x", statistic.x, {statistic.x_unit, statistic.x_name});
        group.write("measured", statistic.measured, {statistic.unit, "of the record"});
        group.write("lowest", statistic.lowest, {statistic.unit, "of the simulations of the closed model"});
        group.write("highest", statistic.highest, {statistic.unit, "of the simulations of the closed model"});
        if (!statistic.measured_whole.empty()) {
            group.write("measured_whole", statistic.measured_whole,
                        {statistic.unit, "of the record with its disturbed stretches"});
        }
        if (!statistic.base.empty()) {
            group.write("base", statistic.base, {statistic.unit, "mean of simulations of the base model alone"});
        }
        group.write("p_value", statistic.p_value, {"1", "of this point alone, two-sided"});
    }
}

}  // namespace

void write_closure(const std::filesystem::path& folder, const std::string& source, const record::Record& record,
                   const Closure& closure, const Predictive& predictive) {
    check_folder(folder);  // again: the computation may have taken hours
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    if (failed) {
        throw InputError(
            fmt::format("{}: the folder for the files of the closed loop cannot be made ({}); "
                        "give another folder with -o",
                        printable(folder), failed.message()));
    }
    store::AtomicFile file(folder / "closure.h5");
    store::File& h5 = file.file();
    h5.set_attribute("format", std::string_view("rlg-closure"));
    h5.set_attribute("format_version", 1);
    h5.set_attribute("verdict", name_of(closure.verdict));
    h5.set_attribute("source", std::string_view(source));
    store::Group parameters = h5.create_group("parameters");
    std::vector<std::string> names;
    std::vector<std::string> units;
    std::vector<double> values;
    std::vector<double> sds;
    const auto add = [&](const std::string& effect, const std::vector<Estimate>& estimates) {
        for (const Estimate& estimate : estimates) {
            names.push_back(effect + "." + estimate.name);
            units.emplace_back(scenario::unit_of(estimate.name));
            values.push_back(estimate.value);
            sds.push_back(estimate.sd);
        }
    };
    add("base", closure.base);
    for (const Step& step : closure.steps) add(std::string(step.effect->name()), step.parameters);
    parameters.write("name", names, {"", "effect.parameter"});
    parameters.write("unit", units, {"", "unit of value and std in this row; 1 of a pure number"});
    parameters.write("value", values, {"1", "estimate from the whole record, in the unit of its row"});
    parameters.write("std", sds, {"1", "standard error, in the unit of its row"});
    store::Group residual = h5.create_group("residual");
    const Residual& r = closure.residual;
    residual.write("time_s", r.time_s, {"s", "time of the prediction"});
    residual.write("innovation", r.innovation, {closure.unit, "measured less predicted one step before"});
    residual.write("sd", r.sd, {closure.unit, "standard deviation that the model predicts"});
    std::vector<std::int8_t> reported(r.reported.begin(), r.reported.end());
    residual.write("reported", reported, {"1", "1: held out, used only for the report"});
    store::Group scores = h5.create_group("scores");
    std::vector<std::string> steps{"base"};
    std::vector<double> errors{closure.heldout_before};
    std::vector<double> gains{0.0};
    for (const Step& step : closure.steps) {
        steps.emplace_back(step.effect->name());
        errors.push_back(step.heldout_error_after);
        gains.push_back(step.heldout_log_score_gain);
    }
    scores.write("step", steps, {"", "base model, then each effect added"});
    scores.write("heldout_error", errors, {closure.unit, "rms one-step prediction error of the held-out part"});
    scores.write("heldout_log_score_gain", gains, {"1", "over the step before"});
    write_predictive(h5, predictive);
    const ClosedScenario closed = closed_scenario(record, closure);
    json object = to_json(closure);
    object["predictive"] = to_json(predictive);
    object["closed"] = to_json(closed);
    write_text(folder / "closure.json", json_text(object, 2) + "\n");
    write_text(folder / "closed.toml", sealed(to_toml(closed, source, closure.verdict), Comment::toml));
    file.commit();
}

}  // namespace ringlock::closure
