#include "app/allan/several.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>
#include <utility>

#include "analysis/report/table.hpp"
#include "app/allan/output/allan_figure.hpp"
#include "app/allan/output/explain.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

/// "N" of "angle random walk N".
std::string_view letter_of(const CoefficientName& name) { return name.name.substr(name.name.size() - 1); }

std::string summary_cell(const noise::NoiseFit& fit, const CoefficientName& name) {
    if (!fit.described) return "withheld";
    const noise::Coefficient& c = fit.*name.member;
    if (c.resolved) return fmt::format("{:.5g}", name.factor * *c.value);
    return c.hi ? fmt::format("< {:.3g}", name.factor * *c.hi) : "-";
}

/// Beyond the five coefficients.
std::string summary_of_the_rest(const noise::NoiseFit& fit) {
    if (!fit.described) return "";
    std::string text = fit.correlated ? "correlated noise" : "";
    if (const std::size_t lines = fit.sinusoids.size(); lines > 0) {
        text += fmt::format("{}{} sinusoid{}", text.empty() ? "" : ", ", lines, lines == 1 ? "" : "s");
    }
    return text;
}

std::string summary(const std::vector<AllanOutput>& series) {
    if (!series.front().noise) return "";
    const InstrumentNames& names = names_of(*series.front().instrument);
    std::vector<report::Column> columns = {{"series"}};
    for (const CoefficientName& name : names.coefficients) {
        const std::string unit = name.unit.empty() ? "" : fmt::format(" [{}]", name.unit);
        columns.push_back({fmt::format("{}{}", letter_of(name), unit), report::Align::right});
    }
    const bool any_more = std::any_of(series.begin(), series.end(),
                                      [](const AllanOutput& s) { return !summary_of_the_rest(*s.noise).empty(); });
    if (any_more) columns.push_back({"and"});
    report::Table table(std::move(columns));
    const std::vector<std::string> titles = names_of_series(series);
    for (std::size_t i = 0; i < series.size(); ++i) {
        std::vector<std::string> cells = {printable(titles[i])};
        for (const CoefficientName& name : names.coefficients) cells.push_back(summary_cell(*series[i].noise, name));
        if (any_more) cells.push_back(summary_of_the_rest(*series[i].noise));
        table.add_row(std::move(cells));
    }
    return fmt::format("\nCoefficients of all series (< limits 95 %)\n{}", table.text(2));
}

}  // namespace

std::vector<std::string> names_of_series(const std::vector<AllanOutput>& series) {
    std::set<std::string> files;
    for (const AllanOutput& s : series) files.insert(s.data);
    const bool one_file = files.size() == 1;
    const bool one_each = files.size() == series.size();
    std::vector<std::string> names;
    for (const AllanOutput& s : series) {
        names.push_back(one_file ? s.column : one_each ? s.data : fmt::format("{}, {}", s.data, s.column));
    }
    return names;
}

std::string series_text(const std::vector<AllanOutput>& series, bool explain, const std::optional<HatOutput>& hat) {
    std::string text;
    for (const AllanOutput& s : series) {
        text += (text.empty() ? "" : "\n") + allan_text(s);
        if (explain) text += explanation_text(s);
    }
    if (series.size() > 1) text += summary(series);
    return hat ? text + hat_text(*hat) : text;
}

std::string series_json(const std::vector<AllanOutput>& series, bool explain, const std::optional<HatOutput>& hat) {
    std::vector<nlohmann::ordered_json> objects;
    for (const AllanOutput& s : series) {
        objects.push_back(allan_run::allan_object(s));
        if (explain) objects.back()["explanation"] = explanation(s);
    }
    if (series.size() == 1) return json_text(objects.front()) + "\n";
    nlohmann::ordered_json json;
    json["series"] = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < series.size(); ++i) {
        nlohmann::ordered_json one;
        one["data"] = series[i].data;
        one.update(objects[i]);
        json["series"].push_back(std::move(one));
    }
    if (hat) json["hat"] = hat_object(*hat);
    return json_text(json) + "\n";
}

report::Figure series_figure(const std::vector<AllanOutput>& series) {
    if (series.size() == 1) return allan_figure(series.front());
    const std::vector<std::string> names = names_of_series(series);
    report::Figure figure;
    for (std::size_t i = 0; i < series.size(); ++i) {
        const std::string name = printable(names[i]);
        add_series(series[i], name, figure);
    }
    const bool one_file =
        std::all_of(series.begin(), series.end(), [&](const AllanOutput& s) { return s.data == series.front().data; });
    figure.title = one_file ? printable(series.front().data) : fmt::format("{} series", series.size());
    set_axes(series.front(), figure);
    return figure;
}

}  // namespace ringlock::app
