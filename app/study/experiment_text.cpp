#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/report/passage.hpp"
#include "analysis/report/table.hpp"
#include "analysis/study/reader_facts.hpp"
#include "analysis/study/sensitivity.hpp"
#include "app/study/study_output.hpp"
#include "engine/core/printable.hpp"
#include "engine/scenario/read_arms.hpp"

namespace ringlock::app {

namespace {

/// Widest line of a text.
constexpr std::size_t most_columns = 100;

using report::Passage;

/// Lines broken between words where they are wider than a table.
std::string wrapped(const std::string& text) {
    std::string lines;
    std::size_t column = 0;
    for (std::size_t begin = 0; begin < text.size();) {
        const std::size_t end = std::min(text.find(' ', begin), text.size());
        const std::size_t length = end - begin;
        if (column > 0) {
            const bool fits = column + 1 + length <= most_columns;
            lines += fits ? ' ' : '\n';
            column = fits ? column + 1 : 0;
        }
        lines += text.substr(begin, length);
        column += length;
        begin = end + 1;
    }
    return lines;
}

/// The readers of the arms, where all points have the same ones.
std::string reader_text(const study::Experiment& experiment) {
    const scenario::Scenario& first = experiment.points.front().scenario;
    const auto facts = study::reader_facts(first);
    const auto same = [&](const study::Study& point) { return study::reader_facts(point.scenario) == facts; };
    if (!scenario::reads_arms(first) || !std::all_of(experiment.points.begin(), experiment.points.end(), same)) {
        return "";
    }
    const scenario::StudyReader reader = scenario::study_reader(first);
    return wrapped(fmt::format("arms read at {:g} Hz: stripping {}, fraction {}, latched at {:g} Hz; {:.3g} s late, "
                               "{:.2g} of a steady dither left",
                               first.reader.output_hz,
                               reader::stripping_names.at(static_cast<std::size_t>(first.reader.stripping)),
                               reader::fraction_names.at(static_cast<std::size_t>(first.reader.fraction)),
                               reader.latch_hz, reader.delay_s, scenario::reader_residue_relative(first))) +
           "\n";
}

std::string heading(const study::Experiment& experiment, const store::Provenance& provenance) {
    const study::Study& first = experiment.points.front();
    const double duration_s = first.schedule.sample_interval_s * static_cast<double>(first.schedule.samples - 1);
    const std::string what =
        experiment.has_design()
            ? fmt::format("{} points of {} gyros", experiment.points.size(), experiment.scenario.ensemble.gyros)
            : fmt::format("{} gyros, {:.6g} s each", first.gyros.size(), duration_s);
    const auto turns = static_cast<double>(experiment.turns());
    return fmt::format("{}: {}, seed {}\n{} turns in {:.1f} s ({:.3g} a second)\n{}\n",
                       printable(provenance.scenario_file), what, experiment.scenario.ensemble.seed, experiment.turns(),
                       provenance.wall_s, turns / provenance.wall_s, reader_text(experiment));
}

std::string walk_cell(const study::Figure& arw) {
    if (!arw.median) return arw.hi ? fmt::format("< {:.2g}", *arw.hi) : "-";
    return fmt::format("{:.4g}", *arw.median);
}

std::string yield_cell(const study::ArmSummary& arm) {
    return arm.yield && arm.yield->share.value ? fmt::format("{:.0f}", 100.0 * *arm.yield->share.value) : "-";
}

std::string rate_cell(const study::ArmSummary& arm) { return rate_text(arm.rate_error_deg_h.mean); }

std::size_t width(const report::Table& table) { return table.text().find('\n'); }

/// Several tables below one heading, without empty lines between them.
void add_tables(const std::string& heading, const std::vector<report::Table>& tables, std::vector<Passage>& out) {
    if (tables.empty()) return;
    Passage passage{.heading = heading, .table = tables.front()};
    for (std::size_t i = 1; i < tables.size(); ++i) passage.notes += tables[i].text();
    out.push_back(std::move(passage));
}

/// A column of a table of points.
struct PointColumn {
    std::string name;
    std::function<std::string(std::size_t point)> cell;
};

/// One row for each point. Every table begins with the columns `leading`; the other columns are divided among several
/// tables, one below the other, where the layout is too narrow for one.
std::vector<report::Table> points_tables(std::size_t points, const std::vector<PointColumn>& leading,
                                         const std::vector<PointColumn>& columns, const DesignLayout& layout) {
    const std::size_t step = (points + layout.most_rows - 1) / layout.most_rows;
    const auto table_of = [&](std::size_t first, std::size_t last) {
        std::vector<PointColumn> shown = leading;
        shown.insert(shown.end(), columns.begin() + static_cast<std::ptrdiff_t>(first),
                     columns.begin() + static_cast<std::ptrdiff_t>(last));
        std::vector<report::Column> heads{{"point", report::Align::right}};
        for (const PointColumn& column : shown) heads.push_back({column.name, report::Align::right});
        report::Table table(heads);
        for (std::size_t p = 0; p < points; p += step) {
            std::vector<std::string> row{fmt::format("{}", p + 1)};
            for (const PointColumn& column : shown) row.push_back(column.cell(p));
            table.add_row(row);
        }
        return table;
    };
    std::vector<report::Table> tables;
    for (std::size_t first = 0; first < columns.size();) {
        std::size_t last = columns.size();
        while (last > first + 1 && width(table_of(first, last)) > layout.most_columns) --last;
        tables.push_back(table_of(first, last));
        first = last;
    }
    return tables;
}

/// Most keys that are printed next to the figures; more keys have tables of their own.
constexpr std::size_t most_keys_in_table = 4;

std::vector<PointColumn> key_columns(const study::Experiment& experiment, const DesignLayout& layout) {
    std::vector<PointColumn> columns;
    for (std::size_t k = 0; k < experiment.axes.size(); ++k) {
        const study::Axis& axis = experiment.axes[k];
        const std::string name =
            layout.names ? fmt::format("{} [{}]", axis.key, axis.unit) : fmt::format("[{}]", k + 1);
        columns.push_back(
            {name, [&values = experiment.axes[k].values](std::size_t p) { return fmt::format("{:.5g}", values[p]); }});
    }
    return columns;
}

/// One figure of all arms, points down.
template <class Cell>
std::vector<report::Table> figure_tables(const study::Experiment& experiment,
                                         const std::vector<study::Summary>& summaries, const DesignLayout& layout,
                                         Cell&& cell) {
    const bool keys_in_table = experiment.axes.size() <= most_keys_in_table;
    std::vector<PointColumn> arms;
    for (std::size_t a = 0; a < summaries.front().arms.size(); ++a) {
        const std::string name = layout.names ? summaries.front().arms[a].name : fmt::format("({})", a + 1);
        arms.push_back({name, [&, a](std::size_t p) { return cell(summaries[p].arms[a]); }});
    }
    return points_tables(summaries.size(), keys_in_table ? key_columns(experiment, layout) : std::vector<PointColumn>{},
                         arms, layout);
}

std::string index_cell(const design::Index& index) {
    return fmt::format("{:.2f} ({:.2f} .. {:.2f})", index.estimate, index.lo, index.hi);
}

/// The keys that decide, arm by arm and figure by figure.
void add_sensitivity(const study::Experiment& experiment, std::vector<Passage>& out) {
    for (const study::ArmSensitivity& arm : study::sensitivity(experiment)) {
        for (const study::SensitiveFigure& figure : arm.figures) {
            const design::OutputIndices& found = figure.indices;
            Passage& passage = out.emplace_back();
            passage.heading = fmt::format("{}, {}: Sobol' indices, 95 %", arm.arm, figure.name);
            if (found.noise_share)
                passage.before = fmt::format("estimation noise is {:.2g} of the variance\n", *found.noise_share);
            if (!found.absent.empty()) {
                passage.before += "none: " + found.absent + "\n";
                continue;
            }
            report::Table table({{"key", report::Align::left},
                                 {"first order", report::Align::right},
                                 {"total order", report::Align::right}});
            for (std::size_t k = 0; k < found.factors.size(); ++k) {
                table.add_row(
                    {experiment.axes[k].key, index_cell(found.factors[k].first), index_cell(found.factors[k].total)});
            }
            passage.table = std::move(table);
        }
    }
}

/// The numbers that stand for keys and arms in the tables.
std::string legend_text(const study::Experiment& experiment, const std::vector<study::Summary>& summaries) {
    std::string text;
    for (std::size_t k = 0; k < experiment.axes.size(); ++k) {
        text += fmt::format("[{}] {} [{}]\n", k + 1, experiment.axes[k].key, experiment.axes[k].unit);
    }
    const auto& arms = summaries.front().arms;
    for (std::size_t a = 0; a < arms.size(); ++a) text += fmt::format("({}) {}\n", a + 1, arms[a].name);
    return text;
}

report::Figure design_figure(const study::Experiment& experiment, const std::vector<study::Summary>& summaries) {
    report::Figure figure;
    const bool one_key = experiment.axes.size() == 1;
    const study::Axis& key = experiment.axes.front();
    figure.title = fmt::format("Angle random walk, {} points of {} gyros", experiment.points.size(),
                               experiment.scenario.ensemble.gyros);
    figure.x_label = one_key ? fmt::format("{} [{}]", key.key, key.unit) : "point of the design";
    figure.y_label = "angle random walk [deg/sqrt(h)]";
    figure.whole_x = !one_key;
    figure.log_y = true;
    for (std::size_t a = 0; a < summaries.front().arms.size(); ++a) {
        report::Curve curve{summaries.front().arms[a].name, {}, {}, {}, {}, report::Curve::Style::points};
        for (std::size_t p = 0; p < summaries.size(); ++p) {
            const study::Figure& arw = summaries[p].arms[a].arw_deg_rt_h;
            curve.x.push_back(one_key ? key.values[p] : static_cast<double>(p + 1));
            curve.y.push_back(arw.median.value_or(std::nan("")));
            curve.lo.push_back(arw.median_lo.value_or(std::nan("")));
            curve.hi.push_back(arw.median_hi.value_or(std::nan("")));
        }
        figure.curves.push_back(std::move(curve));
    }
    return figure;
}

}  // namespace

std::vector<report::Passage> design_passages(const study::Experiment& experiment,
                                             const std::vector<study::Summary>& summaries, const DesignLayout& layout) {
    std::vector<Passage> all;
    const auto& arms = summaries.front().arms;
    Passage first{.notes = layout.names ? "" : legend_text(experiment, summaries)};
    if (summaries.size() > layout.most_rows) {
        first.notes += "Only some of the points are shown; all are in the file and in --json.\n";
    }
    if (!first.notes.empty()) all.push_back(std::move(first));
    if (experiment.axes.size() > most_keys_in_table) {
        add_tables("Keys", points_tables(summaries.size(), {}, key_columns(experiment, layout), layout), all);
    }
    const auto add = [&](const char* heading, auto&& cell) {
        add_tables(heading, figure_tables(experiment, summaries, layout, cell), all);
    };
    add("Angle random walk, median of the gyros [deg/sqrt(h)]",
        [](const study::ArmSummary& arm) { return walk_cell(arm.arw_deg_rt_h); });
    add("Mean rate less the input rate [deg/h]", rate_cell);
    if (arms.front().yield) add("Gyros that meet the specification [%]", yield_cell);
    add_sensitivity(experiment, all);
    return all;
}

std::string experiment_text(const study::Experiment& experiment, const std::vector<study::Summary>& summaries,
                            const store::Provenance& provenance) {
    std::string growth;
    if (experiment.growth) {
        growth = wrapped(fmt::format("stopped at {} gyros: {}", experiment.growth->looks.back(),
                                     printable(experiment.growth->why))) +
                 "\n\n";
    }
    return heading(experiment, provenance) + growth +
           (experiment.has_design() ? report::text_of(design_passages(experiment, summaries, DesignLayout{}))
                                    : study_text(experiment.points.front(), summaries.front()));
}

report::Figure experiment_figure(const study::Experiment& experiment, const std::vector<study::Summary>& summaries) {
    return experiment.has_design() ? design_figure(experiment, summaries)
                                   : study_figure(experiment.points.front(), summaries.front());
}

}  // namespace ringlock::app
