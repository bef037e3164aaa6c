#include "app/report/closed_loop_page.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "analysis/closure/report/folder.hpp"
#include "analysis/report/closure_figures.hpp"
#include "analysis/report/closure_page.hpp"
#include "app/run/slurm_script.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/read_json.hpp"

namespace ringlock::app {

namespace {

namespace fs = std::filesystem;
using closure::Closure;
using report::Align;
using report::Figure;
using report::Table;

/// Blocks of the figure of innovations over time.
constexpr std::size_t most_blocks = 200;

/// Captions are Markdown with code marks.
std::string without_marks(std::string text) {
    std::erase(text, '`');
    return text;
}

/// Innovations over the standard deviation that the model predicts, rms of each of some hundred blocks: about one all
/// along where the model holds.
Figure innovation_figure(const closure::Residual& residual) {
    Figure figure{.title = "One-step innovations over what the closed model predicts",
                  .x_label = "time [s]",
                  .y_label = "rms innovation over its predicted standard deviation"};
    report::Curve measured{.label = "rms of a block", .style = report::Curve::Style::line};
    const std::size_t rows = residual.time_s.size();
    const std::size_t block = std::max<std::size_t>(1, (rows + most_blocks - 1) / most_blocks);
    for (std::size_t begin = 0; begin < rows; begin += block) {
        double sum = 0.0;
        std::size_t count = 0;
        for (std::size_t i = begin; i < std::min(rows, begin + block); ++i) {
            const double ratio = residual.innovation[i] / residual.sd[i];
            if (!std::isfinite(ratio)) continue;
            sum += ratio * ratio;
            ++count;
        }
        if (count == 0) continue;
        measured.x.push_back(residual.time_s[begin]);
        measured.y.push_back(std::sqrt(sum / static_cast<double>(count)));
    }
    if (measured.x.empty()) return figure;
    const report::Curve expected{.label = "expected",
                                 .x = {measured.x.front(), measured.x.back()},
                                 .y = {1.0, 1.0},
                                 .style = report::Curve::Style::dashed};
    figure.curves = {measured, expected};
    return figure;
}

void add_steps(report::Page& page, const Closure& closure) {
    page.heading("Effects, step by step");
    if (closure.steps.empty()) {
        page.paragraph(
            "No effect was added: the record does not need one, or no effect of the library explains its structure.");
        return;
    }
    Table table({{"step", Align::right},
                 {"effect"},
                 {"parameters"},
                 {fmt::format("error before [{}]", closure.unit), Align::right},
                 {"after", Align::right},
                 {"log-score gained", Align::right},
                 {"p", Align::right}});
    for (std::size_t k = 0; k < closure.steps.size(); ++k) {
        const closure::Step& step = closure.steps[k];
        std::vector<std::string> parameters;
        for (const closure::Estimate& e : step.parameters) {
            parameters.push_back(fmt::format("{} {}", e.name, report::estimate_text(e)));
        }
        table.add_row({fmt::format("{}", k + 1), step.name(), fmt::format("{}", fmt::join(parameters, "; ")),
                       fmt::format("{:.6g}", step.heldout_error_before),
                       fmt::format("{:.6g}", step.heldout_error_after),
                       fmt::format("{:.1f}", step.heldout_log_score_gain), closure::probability(step.p_value)});
    }
    page.table(table, "Effects that the record supports, in the order in which they were added");
    page.paragraph(
        "The error is the rms one-step error in parts of the record that were not used for the fit; p is the "
        "probability that chance alone looks like the effect.");
    for (const closure::Step& step : closure.steps) {
        if (step.confounded_with.empty()) continue;
        page.paragraph(
            fmt::format("{} is tied with {}: the record supports these effects equally well. To distinguish "
                        "them: {}.",
                        step.name(), fmt::join(closure::names_of(step.confounded_with), ", "), step.experiment));
    }
    page.subheading("Advice for each effect");
    std::vector<std::string> advice;
    for (const closure::Step& step : closure.steps) {
        advice.push_back(fmt::format("{}: {}", step.name(), step.effect->advice()));
    }
    page.list(advice);
}

void add_checks(report::Page& page, const closure::Report& report) {
    const closure::Predictive& predictive = report.predictive;
    if (predictive.simulations > 0) page.heading("Predictive check");
    if (!predictive.statistics.empty()) {
        page.paragraph(
            fmt::format("The closed model was simulated {} times over the length and the input of the record, "
                        "and every simulation was analysed like the record.",
                        predictive.simulations));
        Table table({{"statistic"}, {"p", Align::right}, {"largest deviation, standard deviations", Align::right}});
        for (const closure::PredictiveStatistic& s : predictive.statistics) {
            table.add_row({s.description.empty() ? s.name : s.description, fmt::format("{:.2g}", s.p_value_all),
                           fmt::format("{:.3g}", s.largest)});
        }
        page.table(table, "The record among the simulations");
    }
    page.list(predictive.notes);
    page.heading("Tests of the residual");
    Table tests({{"where"}, {"test"}, {"p", Align::right}, {"largest"}});
    for (const closure::ResidualTest& test : report.closure.tests) {
        tests.add_row({std::string(closure::name_of(test.where)), printable(test.subject),
                       closure::probability(test.p_value), printable(test.detail)});
    }
    page.table(tests, "Each p includes the look-elsewhere correction of its own search");
}

std::string text_in(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

void add_files(report::Page& page, const fs::path& folder, const std::string& command) {
    page.heading("Provenance");
    page.paragraph("The command that repeats the closed loop, started where the record is:");
    page.code(command + "\n", "Command");
    std::error_code unknown;
    if (fs::is_regular_file(folder / "closed.toml", unknown)) {
        page.folded_code("The device as fitted (closed.toml), which ringlock run and ringlock record read",
                         text_in(folder / "closed.toml"));
    }
}

/// A data chain: the shared source, then each record.
report::Page chain_page(const fs::path& folder, const nlohmann::json& object) {
    const nlohmann::json& chain = object.at("chain");
    std::vector<std::string> names;
    for (const nlohmann::json& record : chain.at("records")) names.push_back(record.at("record").get<std::string>());
    if (object.at("records").size() != names.size()) {
        throw InputError("chain.records and records differ in length");
    }
    report::Page page(fmt::format("Data chain of {} records", names.size()), "Closed loop");
    const nlohmann::json& effect = chain.at("effect");
    const nlohmann::json& from = chain.at("from_hz");
    std::string answer = "No record shows a source rate that the data chain resamples.";
    if (chain.at("contradicted").get<bool>()) {
        answer = "The data do not decide: the records contradict each other about the source rate.";
    } else if (!effect.is_null() && !from.is_null()) {
        const double std_hz = number_or_nan(from.at("std"));
        answer = fmt::format("The records share a source of {:.8g} Hz{}, found as {}.", number_or_nan(from.at("value")),
                             std::isfinite(std_hz) ? fmt::format(" (standard error {:.2g} Hz)", std_hz) : "",
                             printable(effect.get<std::string>()));
    }
    page.answer("Answer", {answer});
    const std::vector<std::string> folders = closure::record_folders(names);
    std::string records;
    for (std::size_t r = 0; r < names.size(); ++r) {
        page.heading(names[r]);
        std::error_code unknown;
        const bool written = fs::is_regular_file(folder / folders[r] / "closure.h5", unknown);
        add_closed_loop(
            page, written ? closure::read_report(folder / folders[r]) : closure::report_of(object.at("records").at(r)));
        records += " " + shell_quoted(names[r]);
    }
    add_files(page, folder, "ringlock closure --same-chain" + records + " -o " + shell_quoted(folder.string()));
    return page;
}

}  // namespace

void add_closed_loop(report::Page& page, const closure::Report& report) {
    const Closure& closure = report.closure;
    page.answer(
        "Answer",
        {closure::verdict_sentence(report) + ".",
         fmt::format("The base model predicts the next reading to {:.6g} {} rms, the model with the effects found "
                     "to {:.6g} {}; its noise alone gives {:.6g} {}.",
                     closure.heldout_before, closure.unit, closure.heldout_after, closure.unit, closure.noise_floor,
                     closure.unit)});
    add_steps(page, closure);
    report::Picture steps = report::step_picture(report.source, closure);
    page.chart(std::move(steps.figure), without_marks(steps.caption));
    for (report::Picture& picture : report::predictive_pictures(report.source, report.predictive)) {
        page.chart(std::move(picture.figure), without_marks(picture.caption));
    }
    if (!closure.residual.time_s.empty()) page.chart(innovation_figure(closure.residual));
    page.heading("The base model");
    Table base({{"parameter"}, {"value ± one standard error", Align::right}});
    for (const closure::Estimate& e : closure.base) base.add_row({printable(e.name), report::estimate_text(e)});
    page.table(base, "Fitted with all effects above");
    add_checks(page, report);
    if (!closure.notes.empty() || !report.not_held.empty() || !report.placeholders.empty()) {
        page.heading("Notes");
        page.list(closure.notes);
        if (!report.placeholders.empty()) {
            page.paragraph(fmt::format("Values of closed.toml that the record neither declares nor determines: {}.",
                                       fmt::join(report.placeholders, ", ")));
        }
        if (!report.not_held.empty()) page.paragraph("A scenario cannot hold all findings. closed.toml lacks:");
        page.list(report.not_held);
    }
}

report::Page closed_loop_page(const fs::path& folder) {
    std::optional<report::Page> page;
    read_json(folder / "closure.json", "closure.json of ringlock closure -o", [&](const nlohmann::json& object) {
        if (object.is_object() && object.contains("chain")) page = chain_page(folder, object);
    });
    if (page) return *page;
    const closure::Report report = closure::read_report(folder);
    page.emplace(fmt::format("Error sources in {}", report.source), "Closed loop");
    add_closed_loop(*page, report);
    add_files(*page, folder,
              fmt::format("ringlock closure {} -o {}", shell_quoted(report.source), shell_quoted(folder.string())));
    return *page;
}

}  // namespace ringlock::app
