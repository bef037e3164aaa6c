#include "analysis/report/closure_page.hpp"

#include <fmt/format.h>

#include <cmath>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/closure/report/closed_scenario.hpp"
#include "analysis/closure/report/folder.hpp"
#include "analysis/closure/report/report.hpp"
#include "analysis/closure/report/seal.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/report/closure_figures.hpp"
#include "analysis/report/plot.hpp"
#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/units.hpp"

namespace ringlock::report {

namespace {

using closure::Closure;
using closure::Estimate;
using closure::Predictive;
using closure::PredictiveStatistic;
using closure::Step;

/// The text escaped for a cell of a table.
std::string cell(std::string_view text) {
    std::string out;
    for (const char c : text) out += c == '|' ? std::string("\\|") : std::string(1, c == '\n' ? ' ' : c);
    return out;
}

void add_steps(const Closure& closure, std::string& page) {
    page += "## Effects\n\n";
    if (closure.steps.empty()) {
        page +=
            "No effect was added: the record does not need one, "
            "or no effect of the library explains its structure.\n\n";
        return;
    }
    page += fmt::format(
        "Each row is an effect that the record supports, in the order in which the effects were added. "
        "The held-out error is the rms error\n"
        "of one-step predictions [{}] in parts of the record that were not used for the fit. p is the probability "
        "that chance alone looks\nlike the effect, with the look-elsewhere correction for the whole search.\n\n",
        closure.unit);
    page += "| step | effect | parameters | held-out error before | after | log-score gained | p |\n";
    page += "|---|---|---|---|---|---|---|\n";
    for (std::size_t k = 0; k < closure.steps.size(); ++k) {
        const Step& step = closure.steps[k];
        std::string parameters;
        for (const Estimate& e : step.parameters) {
            parameters += fmt::format("{}`{}` {}", parameters.empty() ? "" : "; ", e.name, cell(estimate_text(e)));
        }
        page += fmt::format("| {} | `{}` | {} | {:.6g} | {:.6g} | {:.1f} | {} |\n", k + 1, step.effect->name(),
                            parameters, step.heldout_error_before, step.heldout_error_after,
                            step.heldout_log_score_gain, closure::probability(step.p_value));
    }
    page += "\n";
    if (closure.steps.front().heldout_error_before < closure.heldout_before) {
        page +=
            "Effects that were only placeholders for one of these were removed again, "
            "so that the first row does not begin at the base model.\n\n";
    }
    page += "Advice for each effect:\n\n";
    for (const Step& step : closure.steps) {
        page += fmt::format("- `{}`: {}\n", step.effect->name(), step.effect->advice());
    }
    page += "\n";
    for (const Step& step : closure.steps) {
        if (step.confounded_with.empty()) continue;
        page += fmt::format(
            "`{}` is tied with `{}`: the record supports these effects equally well. "
            "To distinguish them: {}.\n\n",
            step.effect->name(), fmt::join(closure::names_of(step.confounded_with), "`, `"), step.experiment);
    }
}

void add_closed(const closure::ClosedScenario& closed, std::string& page) {
    const std::vector<std::string> placeholders = closed.placeholders();
    if (placeholders.empty() && closed.not_held.empty()) return;
    page += "## Limits of closed.toml\n\n";
    if (!placeholders.empty()) {
        page += fmt::format(
            "The record neither declares nor determines {} of its values. "
            "Placeholders with the values of the standard gyro are: `{}`.\n\n",
            placeholders.size(), fmt::join(placeholders, "`, `"));
    }
    if (closed.not_held.empty()) return;
    page += "A scenario cannot hold all findings. It does not contain:\n\n";
    for (const std::string& finding : closed.not_held) page += fmt::format("- {}\n", cell(finding));
    page += "\n";
}

void add_predictive(const Predictive& predictive, std::string& page) {
    page += "## Predictive check\n\n";
    if (predictive.simulations > 0) {
        page += fmt::format(
            "The device of `closed.toml` was simulated {} times over the length and the input of this record, "
            "with parameters drawn about their\n"
            "estimates by their standard errors, and every simulation was analysed like the record. p is the rank "
            "of the record's largest deviation\nfrom the simulations among their own largest deviations. "
            "Its least value, {:.2g}, means that no simulation deviates as far as the record.\n\n",
            predictive.simulations, 1.0 / (predictive.simulations + 1.0));
        page += "| statistic | points | p | largest deviation |\n|---|---|---|---|\n";
        for (const PredictiveStatistic& s : predictive.statistics) {
            const std::string where = s.x.empty() ? "" : fmt::format(" at {:.4g} {}", s.x[s.at], s.x_unit);
            page += fmt::format("| {} | {} | {:.2g} | {:.{}f} standard deviations{} |\n", cell(s.description),
                                s.x.size(), s.p_value_all, s.largest, s.largest < 10.0 ? 1 : 0, where);
        }
        page += "\n";
    }
    for (const std::string& note : predictive.notes) page += fmt::format("- {}\n", cell(note));
    if (!predictive.notes.empty()) page += "\n";
}

}  // namespace

std::string estimate_text(const Estimate& e) {
    if (!e.text.empty()) return e.text;
    if (!std::isfinite(e.value)) return "not known";
    if (!std::isfinite(e.sd)) return fmt::format("{:.6g}", e.value);
    return fmt::format("{:.6g} ± {:.2g}", e.value, e.sd);
}

void write_closure_page(const std::filesystem::path& folder, const std::string& source, const record::Record& record,
                        const Closure& closure, const Predictive& predictive) {
    std::string page =
        fmt::format("# Error sources in {}\n\n**{}.**\n\n", markdown(source), closure::verdict_sentence(closure));
    page += fmt::format(
        "The base model predicts the next reading to {:.6g} {} rms, the model found here to {:.6g} {};\n"
        "its noise alone gives {:.6g} {}. A record without a further error source gets a verdict other "
        "than `nothing_missing` with a\nprobability of {:.2g}.\n\n",
        closure.heldout_before, closure.unit, closure.heldout_after, closure.unit, closure.noise_floor, closure.unit,
        closure.level);
    add_steps(closure, page);
    page +=
        "## The base model\n"
        "\nFitted with all effects above; ± one standard error.\n\n| parameter | value |\n|---|---|\n";
    for (const Estimate& e : closure.base) page += fmt::format("| `{}` | {} |\n", e.name, cell(estimate_text(e)));
    page += "\n";
    add_closed(closure::closed_scenario(record, closure), page);
    add_predictive(predictive, page);

    std::string problem;
    std::set<std::filesystem::path> drawn;
    for (const Picture& picture : closure_pictures(source, record, closure, predictive)) {
        try {
            const std::string figure = draw_svg(picture.figure, (folder / picture.file).string());
            write_text(folder / picture.file, closure::sealed(figure, closure::Comment::markup));
            drawn.insert(folder / picture.file);
            page += fmt::format("![{}]({})\n\n{}\n\n", markdown(picture.figure.title), picture.file, picture.caption);
        } catch (const RunError& error) {
            problem = error.what();
        }
    }
    for (const std::filesystem::path& file : closure::files_of(folder)) {
        if (file.extension() == ".svg" && !drawn.contains(file)) std::filesystem::remove(file);
    }
    if (!problem.empty()) page += fmt::format("Figures are missing: {}\n\n", problem);

    page += "## Tests of the residual\n\n";
    page +=
        "Each row is one test of the residual of the last model; its p includes the look-elsewhere correction "
        "for its own search.\n\n";
    page += "| where | test | p | largest |\n|---|---|---|---|\n";
    for (const closure::ResidualTest& test : closure.tests) {
        page += fmt::format("| {} | {} | {} | {} |\n", closure::name_of(test.where), cell(test.subject),
                            closure::probability(test.p_value), cell(test.detail));
    }
    page += "\n";
    if (!closure.notes.empty()) page += "## Notes\n\n";
    for (const std::string& note : closure.notes) page += fmt::format("- {}\n", cell(note));
    if (!closure.notes.empty()) page += "\n";
    page +=
        "## The files\n\n- `closed.toml`: the device as fitted, for `ringlock run` and `ringlock record`\n"
        "- `closure.h5`: parameters, one-step predictions, scores, the predictive check point by point\n"
        "- `closure.json`: the content of this page for programs\n";
    write_text(folder / "report.md", closure::sealed(page, closure::Comment::markup));
}

}  // namespace ringlock::report
