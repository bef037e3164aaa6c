#include "app/allan/output/outputs.hpp"

#include <fmt/format.h>

#include "analysis/report/map.hpp"
#include "analysis/report/plot.hpp"
#include "analysis/report/render.hpp"
#include "app/allan/output/csv.hpp"
#include "app/allan/output/dynamic_output.hpp"
#include "app/allan/several.hpp"
#include "app/output.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

bool is_table(const std::filesystem::path& path) { return path.extension() == ".csv"; }

/// A table (.csv) or a figure.
std::unique_ptr<AtomicPath> claim_table_or_figure(const std::string& path, const char* option) {
    if (!is_table(path)) {
        try {
            report::picture_of(path, option);
        } catch (const InputError& error) {
            throw InputError(fmt::format("{}; a table ends in .csv", error.what()));
        }
    }
    return std::make_unique<AtomicPath>(path);
}

void refuse_overwriting(const AllanArguments& a) {
    using Use = NamedFile::Use;
    std::vector<NamedFile> files;
    for (const std::string& data : a.data) files.push_back({"DATA", data, Use::input});
    files.push_back({"--plot", a.plot, Use::output});
    files.push_back({"--csv", a.csv, Use::output});
    for (const std::string& psd : a.psd) files.push_back({"--psd", psd, Use::output});
    for (const std::string& map : a.maps) files.push_back({"--map", map, Use::output});
    for (const auto& [format, file] : a.exports) files.push_back({"--export " + format, file, Use::output});
    refuse_same_files(files);
}

void check_options(const AllanArguments& a) {
    if (a.dynamic.empty() && !a.maps.empty()) {
        throw InputError(fmt::format("--map {}: needs --dynamic, the length of the windows, as --dynamic 10min",
                                     printable(a.maps.front())));
    }
    if (!a.dynamic.empty() && a.maps.empty()) {
        throw InputError(
            fmt::format("--dynamic {}: needs --map FILE, a table (.csv) or a figure (.svg)", printable(a.dynamic)));
    }
    if (a.stream && (!a.psd.empty() || !a.maps.empty() || a.hat)) {
        throw InputError(fmt::format("{}: needs the whole record, which --stream does not keep", a.hat ? "--hat"
                                                                                                 : a.psd.empty()
                                                                                                     ? "--dynamic"
                                                                                                     : "--psd"));
    }
}

}  // namespace

AllanFiles::AllanFiles(const AllanArguments& a)
    : density_choice_(density_choice(a.psd_method, a.psd_sides)), window_(a.dynamic) {
    check_options(a);
    refuse_overwriting(a);
    figure_ = claim_figure(a.plot);
    if (!a.csv.empty()) table_ = std::make_unique<AtomicPath>(a.csv);
    for (const std::string& psd : a.psd) densities_.push_back(claim_table_or_figure(psd, "--psd"));
    for (const std::string& map : a.maps) maps_.push_back(claim_table_or_figure(map, "--map"));
    for (const auto& [format, file] : a.exports) {
        exports_.emplace_back(export_format(format), std::make_unique<AtomicPath>(file));
    }
}

void AllanFiles::write(const AllanRequest& request, const std::vector<AnalysedSeries>& series) const {
    std::vector<AllanOutput> outputs;
    for (const AnalysedSeries& s : series) outputs.push_back(s.out);
    // Texts that may be refused are made first, so that nothing is written then.
    std::vector<std::string> exported_texts;
    for (const auto& [format, file] : exports_) exported_texts.push_back(exported(format, outputs));
    write_densities(request, series, outputs);
    write_maps(request, series, outputs);
    for (std::size_t i = 0; i < exports_.size(); ++i) write_text(*exports_[i].second, exported_texts[i]);
    if (table_) write_text(*table_, deviations_csv(outputs));
    if (figure_) report::write_figure(*figure_, series_figure(outputs));
}

void AllanFiles::write_densities(const AllanRequest& request, const std::vector<AnalysedSeries>& series,
                                 const std::vector<AllanOutput>& outputs) const {
    if (densities_.empty()) return;
    std::vector<SeriesDensity> densities;
    for (const AnalysedSeries& s : series) densities.push_back(density_of(request, s, density_choice_));
    for (const Claimed& file : densities_) {
        if (is_table(file->target())) {
            write_text(*file, density_csv(outputs, densities, density_choice_));
        } else {
            report::write_figure(*file, density_figure(outputs, densities, density_choice_));
        }
    }
}

void AllanFiles::write_maps(const AllanRequest& request, const std::vector<AnalysedSeries>& series,
                            const std::vector<AllanOutput>& outputs) const {
    if (maps_.empty()) return;
    std::vector<DynamicOutput> dynamic;
    for (const AnalysedSeries& s : series) dynamic.push_back(dynamic_of(request, s, window_));
    for (const Claimed& file : maps_) {
        if (is_table(file->target())) {
            write_text(*file, dynamic_csv(outputs, dynamic));
        } else {
            report::write_drawing(*file, report::draw_map(dynamic_map(outputs, dynamic), file->target().string()));
        }
    }
}

}  // namespace ringlock::app
