#include "app/allan/output/csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "analysis/export/csv.hpp"

namespace ringlock::app {
namespace {

/// Units that the deviations have, each once, in the order in which they come.
std::vector<std::string> suffixes_of(const std::vector<AllanOutput>& series) {
    std::vector<std::string> out;
    for (const AllanOutput& s : series) {
        for (const DeviationOutput& d : s.deviations) {
            const std::string suffix = unit_suffix(s, allan::traits(d.estimator).time);
            if (std::find(out.begin(), out.end(), suffix) == out.end()) out.push_back(suffix);
        }
    }
    return out;
}

std::string row_of(const AllanOutput& s, allan::Estimator estimator, const allan::Point& p,
                   const std::vector<std::string>& suffixes) {
    std::vector<std::string> cells = {csv_cell(s.data), csv_cell(s.column), std::string(allan::name(estimator)),
                                      std::to_string(p.m), csv_cell(p.tau_s)};
    const std::string own = unit_suffix(s, allan::traits(estimator).time);
    for (const std::string& suffix : suffixes) {
        for (const double value : {p.dev, p.lo, p.hi}) cells.push_back(suffix == own ? csv_cell(value) : "");
    }
    cells.push_back(std::to_string(p.terms));
    cells.push_back(std::isfinite(p.edf) ? std::to_string(p.alpha) : "");
    cells.push_back(csv_cell(p.edf));
    cells.push_back(csv_cell(p.bias));
    return csv_line(cells);
}

}  // namespace

std::string csv_cell(std::string_view text) { return exports::cell_of(text); }

std::string csv_cell(double value) { return std::isfinite(value) ? fmt::format("{}", value) : ""; }

std::string csv_line(const std::vector<std::string>& cells) { return fmt::format("{}\n", fmt::join(cells, ",")); }

std::string unit_suffix(const AllanOutput& out, bool integral) {
    if (!out.instrument) return "";
    switch (*out.instrument) {
        case quantity::Instrument::accelerometer:
            return integral ? "_m_s" : "_m_s2";
        case quantity::Instrument::clock:
            return integral ? "_s" : "";
        case quantity::Instrument::gyro:
            break;
    }
    return integral ? "_arcsec" : "_deg_h";
}

std::string deviations_csv(const std::vector<AllanOutput>& series) {
    const std::vector<std::string> suffixes = suffixes_of(series);
    std::vector<std::string> header = {"file", "column", "deviation", "m", "tau_s"};
    for (const std::string& suffix : suffixes) {
        for (const char* name : {"dev", "lo", "hi"}) header.push_back(name + suffix);
    }
    header.insert(header.end(), {"terms", "alpha", "edf", "bias"});
    std::string text = csv_line(header);
    for (const AllanOutput& s : series) {
        for (const DeviationOutput& d : s.deviations) {
            for (const allan::Point& p : d.points) text += row_of(s, d.estimator, p, suffixes);
        }
    }
    return text;
}

}  // namespace ringlock::app
