#include "app/report/allan_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "app/allan/output/allan_figure.hpp"
#include "app/allan/output/explain.hpp"
#include "app/allan/several.hpp"
#include "app/run/slurm_script.hpp"

namespace ringlock::app {

namespace {

using report::Align;
using report::Table;

/// Findings of a table: of more the number is given.
constexpr std::size_t most_findings = 200;

/// "angle random walk N 0.0034 (68.27 %: 0.0033 to 0.0035) deg/sqrt(h)"
std::string coefficient_words(const CoefficientName& name, const noise::Coefficient& c) {
    return fmt::format("{} {:.4g} (68.27 %: {:.4g} to {:.4g}) {}", name.name, name.factor * c.value.value_or(0.0),
                       name.factor * c.lo.value_or(0.0), name.factor * c.hi.value_or(0.0), name.unit);
}

std::string answer_of_one(const std::string& title, const AllanOutput& out) {
    const std::string of = title.empty() ? "The record" : title;
    if (!out.noise) return fmt::format("{}: no unit was given, so that no noise coefficients were estimated.", of);
    if (!out.noise->described) {
        return fmt::format("{}: the data do not decide: the coefficients are withheld, for {}.", of, out.noise->reason);
    }
    std::string shown;
    for (const CoefficientName& name : names_of(*out.instrument).coefficients) {
        const noise::Coefficient& c = (*out.noise).*name.member;
        if (c.resolved) shown += (shown.empty() ? "" : "; ") + coefficient_words(name, c);
    }
    if (shown.empty()) return fmt::format("{}: the data resolve none of the noise coefficients.", of);
    return fmt::format("{}: {}.", of, shown);
}

Table coefficient_table(const AllanOutput& out) {
    Table table({{"coefficient"}, {"value", Align::right}, {"68.27 %", Align::right}, {"unit"}});
    const InstrumentNames& names = names_of(*out.instrument);
    for (const CoefficientName& name : names.coefficients) {
        const noise::Coefficient& c = (*out.noise).*name.member;
        if (c.resolved) {
            table.add_row({std::string(name.name), fmt::format("{:.5g}", name.factor * *c.value),
                           fmt::format("{:.5g} to {:.5g}", name.factor * *c.lo, name.factor * *c.hi),
                           std::string(name.unit)});
        } else {
            table.add_row({std::string(name.name), "not resolved",
                           c.hi ? fmt::format("< {:.3g} (95 %)", name.factor * *c.hi) : "", std::string(name.unit)});
        }
    }
    const auto add = [&](std::string name, const noise::Estimate& e, double factor, std::string_view unit) {
        table.add_row({std::move(name), fmt::format("{:.6g}", factor * e.value),
                       fmt::format("{:.6g} to {:.6g}", factor * e.lo, factor * e.hi), std::string(unit)});
    };
    if (const auto& correlated = out.noise->correlated) {
        add("correlated noise q_c", correlated->amplitude_deg_h_rt_h, names.driving_factor, names.driving_unit);
        add("its correlation time", correlated->correlation_time_s, 1.0, "s");
        add("its rms", correlated->rms_rate_deg_h, 1.0, names.rate_unit);
    }
    for (const noise::Sinusoid& line : out.noise->sinusoids) {
        add("sinusoid, amplitude", line.rate_amplitude_deg_h, 1.0, names.rate_unit);
        add("its frequency", line.frequency_hz, 1.0, "Hz");
    }
    return table;
}

Table findings_table(const AllanOutput& out) {
    Table table({{"kind"},
                 {"row", Align::right},
                 {"line of the file", Align::right},
                 {"time [s]", Align::right},
                 {"rows", Align::right},
                 {"size", Align::right},
                 {"in standard errors", Align::right}});
    std::vector<std::size_t> shown = findings::listed(out.findings);
    shown.resize(std::min(most_findings, shown.size()));
    for (const std::size_t i : shown) {
        const findings::Finding& found = out.findings[i];
        const std::string kind = found.kind == findings::Kind::jump
                                     ? fmt::format("jump of the {}", found.of_angle ? "angle" : "rate")
                                     : std::string(findings::name_of(found.kind));
        const std::size_t line = i < out.finding_lines.size() ? out.finding_lines[i] : 0;
        table.add_row({kind, fmt::format("{}", found.row + 1), line == 0 ? "" : fmt::format("{}", line),
                       fmt::format("{:.6g}", static_cast<double>(found.row) * out.tau0_s),
                       fmt::format("{}", found.length), fmt::format("{:.5g}", found.size),
                       std::isfinite(found.size_sigma) ? fmt::format("{:.3g}", found.size_sigma) : ""});
    }
    return table;
}

void add_findings_of(report::Page& page, const AllanOutput& out) {
    if (out.findings.empty()) {
        page.paragraph(
            "The search for outliers, jumps, wraps, disturbed stretches and repeated or clipped values found nothing.");
        return;
    }
    page.table(findings_table(out), "Found in the data, rows counted from 1");
    if (out.findings.size() > most_findings) {
        page.paragraph(fmt::format("and {} more", out.findings.size() - most_findings));
    }
    page.paragraph(
        "The size is in the unit of the data; of a disturbed stretch it is the ratio of its variance to that of the "
        "rest, of a gap the number of missing data.");
    if (out.cleaned) {
        page.paragraph(fmt::format("Deviations and coefficients are of {}.", findings::data_of(*out.cleaned)));
    } else {
        const std::string without = findings::estimated_without(out.findings);
        const bool estimated = out.noise && out.noise->described && !without.empty();
        page.paragraph(fmt::format("The deviations are of the data as they are{}.",
                                   estimated ? fmt::format("; coefficients are of the data without {}", without) : ""));
    }
}

}  // namespace

std::vector<std::string> allan_answer(const std::vector<AllanOutput>& series) {
    const std::vector<std::string> titles = names_of_series(series);
    std::vector<std::string> sentences;
    for (std::size_t i = 0; i < series.size(); ++i) {
        sentences.push_back(answer_of_one(series.size() == 1 ? "" : titles[i], series[i]));
    }
    return sentences;
}

void add_allan_analysis(report::Page& page, const std::vector<AllanOutput>& series) {
    page.answer("Answer", allan_answer(series));
    const double percent = 100.0 * series.front().confidence;
    page.chart(series_figure(series), fmt::format("Bars are {:.4g} % intervals.", percent));
    const std::vector<std::string> titles = names_of_series(series);
    for (std::size_t i = 0; i < series.size(); ++i) {
        const AllanOutput& out = series[i];
        page.heading(series.size() == 1 ? "Noise coefficients and findings" : titles[i]);
        page.paragraph(fmt::format("{} data of kind {}, {} missing, one every {:.6g} s.", out.n, out.kind, out.missing,
                                   out.tau0_s));
        if (out.noise && out.noise->described) page.table(coefficient_table(out), "Noise coefficients");
        if (out.jump_instead_of_walk) {
            page.paragraph(
                fmt::format("A jump at row {} explains the record as well as a random walk of the rate does.",
                            out.jump_instead_of_walk->row + 1));
        }
        add_findings_of(page, out);
        page.subheading("In sentences");
        page.list(explanation(out));
    }
}

std::string allan_command(const std::vector<AllanOutput>& series) {
    const AllanOutput& first = series.front();
    std::string command = "ringlock allan";
    std::vector<std::string> data;
    std::string columns;
    std::string deviations;
    for (const AllanOutput& out : series) {
        if (std::find(data.begin(), data.end(), out.data) == data.end()) data.push_back(out.data);
        columns += (columns.empty() ? "" : ",") + out.column;
    }
    for (const std::string& one : data) command += " " + (one.empty() ? std::string("DATA") : shell_quoted(one));
    for (const DeviationOutput& deviation : first.deviations) {
        deviations += fmt::format("{}{}", deviations.empty() ? "" : ",", allan::name(deviation.estimator));
    }
    command += fmt::format(" --tau0 {:.12g}s --kind {}", first.tau0_s, shell_quoted(first.kind));
    if (data.size() == 1 && !columns.empty()) command += " --column " + shell_quoted(columns);
    if (first.instrument) command += " --unit UNIT";
    return command + " --dev " + deviations + " --json";
}

}  // namespace ringlock::app
