#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/allan_run/deviations.hpp"
#include "analysis/text/words.hpp"
#include "app/allan/output/hat_output.hpp"
#include "app/allan/output/outputs.hpp"
#include "app/allan/repeated_input.hpp"
#include "app/allan/request.hpp"
#include "app/allan/series.hpp"
#include "app/allan/series_names.hpp"
#include "app/allan/several.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/output.hpp"
#include "app/text_arguments.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

bool are_equal(const AllanOutput& a, const AllanOutput& b) {
    if (a.data != b.data || a.column != b.column) return false;
    return std::equal(a.deviations.begin(), a.deviations.end(), b.deviations.begin(), b.deviations.end(),
                      [](const DeviationOutput& l, const DeviationOutput& r) {
                          return std::equal(l.points.begin(), l.points.end(), r.points.begin(), r.points.end(),
                                            [](const auto& p, const auto& q) { return p.dev == q.dev; });
                      });
}

/// A column may be named by its name and by its number; two columns of one name differ in their values.
void refuse_the_same(const std::vector<AnalysedSeries>& before, const AnalysedSeries& series,
                     const std::vector<SeriesName>& names) {
    for (std::size_t i = 0; i < before.size(); ++i) {
        if (!are_equal(before[i].out, series.out)) continue;
        throw InputError(fmt::format("--column: {} and {} are the same column of {}; name it once",
                                     printable(names[i].column.value_or("")),
                                     printable(names[before.size()].column.value_or("")), printable(series.out.data)));
    }
}

std::vector<AnalysedSeries> analyse_all(const AllanArguments& a, const AllanRequest& request, bool keep_data) {
    const bool from_input = std::find(a.data.begin(), a.data.end(), "-") != a.data.end();
    const bool several_columns = a.column.find(',') != std::string::npos;
    const RepeatedInput input(from_input && (several_columns || request.sampling.from_file));
    std::vector<AnalysedSeries> series;
    const std::vector<SeriesName> names = series_names(a.data, a.column, request.series, input);
    for (const SeriesName& name : names) {
        name_file_of_failure(text::name_of_file(name.path), [&] {
            AnalysedSeries next = analyse(request, name, input, keep_data);
            refuse_the_same(series, next, names);
            series.push_back(std::move(next));
        });
    }
    return series;
}

void add_output_options(CLI::App& sub, AllanArguments& a) {
    sub.add_option("--plot", a.plot,
                   "Also draw the figure into this file: .svg, or .png and .pdf where librsvg is installed");
    sub.add_option("--csv", a.csv, "Also write the deviations of all series into this table");
    sub.add_option("--psd", a.psd, "Also write the power spectral density of the rate: a table (.csv) or a figure")
        ->allow_extra_args(false);
    sub.add_option("--psd-method", a.psd_method, "welch (Hann window) | cosine (the spectrum of the noise fit)")
        ->capture_default_str();
    sub.add_option("--psd-sides", a.psd_sides, "two (white noise is at N^2) | one (twice that)")->capture_default_str();
    sub.add_option("--dynamic", a.dynamic, "Length of time windows, as 10min, whose deviations --map shows");
    sub.add_option("--map", a.maps, "Also write the first deviation over time windows: a table (.csv) or a figure")
        ->allow_extra_args(false);
    sub.add_flag("--hat", a.hat, "Three-cornered hat: deviations of each of three series from their differences");
    sub.add_option("--export", a.exports, "kalibr | matlab | toml and a file: also write the coefficients for it")
        ->type_name("FORMAT FILE")
        ->allow_extra_args(false);
    sub.add_flag("--explain", a.explain, "Also say the result in sentences");
}

void run(const AllanArguments& a) {
    const AllanRequest request = allan_request(a);
    const AllanFiles files(a);
    const std::vector<AnalysedSeries> series = analyse_all(a, request, a.hat || files.need_data());
    std::optional<HatOutput> hat;
    if (a.hat) hat = hat_of(request, series);
    files.write(request, series);
    std::vector<AllanOutput> outputs;
    for (const AnalysedSeries& s : series) outputs.push_back(s.out);
    put(a.json ? series_json(outputs, a.explain, hat) : series_text(outputs, a.explain, hat));
}

}  // namespace

void add_allan(CLI::App& root) {
    auto a = std::make_shared<AllanArguments>();
    CLI::App* sub =
        root.add_subcommand("allan", "Allan deviation with intervals, and gyro noise coefficients, of a data file");
    sub->add_option("DATA", a->data,
                    "Text, packed or not, HDF5 or rlg-record, one or several; - for text from standard input. Example: "
                    "ringlock allan log.csv --rate 200 --kind rate --unit rad/s --column gx --time t --time-unit ns")
        ->required();
    sub->add_option("--rate", a->rate,
                    "Samples a second [Hz], a fraction such as 1/300, or file: each file declares its rate_hz");
    sub->add_option("--tau0", a->tau0, "Sampling interval in place of --rate: seconds, or with a unit as 5ms");
    sub->add_option("--kind", a->kind, "phase | increment | rate: what the numbers are (never guessed)");
    sub->add_option("--unit", a->unit,
                    "Unit of the data. Gyro: arcsec, deg, rad (phase, increment), deg/h, deg/s, rad/s (rate); "
                    "accelerometer: m/s, m/s^2, mg; clock: s, ns; counts, with --scale. Without it no noise "
                    "coefficients are estimated");
    sub->add_option("--scale", a->scale,
                    "Size of one number of the data: with --unit counts a number and a unit (0.25arcsec), with another "
                    "unit a plain factor");
    sub->add_option("--arw-unit", a->arw_unit,
                    "Also print the random walk in deg/sqrt(h), deg/h/sqrt(Hz), deg/s/sqrt(Hz), rad/s/sqrt(Hz), "
                    "m/s/sqrt(h), m/s^2/sqrt(Hz), ug/sqrt(Hz)");
    sub->add_option("--column", a->column,
                    "Name or number (from 1) of the column, or path of an HDF5 dataset; of a two-dimensional one "
                    "'PATH[I,:]' is row I, 'PATH[:,J]' column J (from 0). Several with commas between: x,y,z");
    sub->add_option("--time", a->time,
                    "Column or dataset, named alike, of the times of the samples: rows left out become gaps; of text "
                    "two columns, as in sec,nsec or date,time");
    add_text_options(*sub, a->text);
    sub->add_option("--dev", a->dev, "Deviations, comma between: " + allan_run::known_deviations())
        ->capture_default_str();
    sub->add_option("--tau", a->tau, "octave | decade | all | averaging factors M,M,... | times with a unit 0.5s,10min")
        ->capture_default_str();
    sub->add_option("--confidence", a->confidence, "Level of the intervals of the deviation")->capture_default_str();
    sub->add_option("--bias", a->bias,
                    "published | exact | raw: by what the variances of the total family are divided (docs/allan.md)")
        ->check(CLI::IsMember({"published", "exact", "raw"}))
        ->capture_default_str();
    add_follow_links(*sub, a->follow_links);
    sub->add_option(
           "--wrap", a->wrap,
           "off | auto | a modulus such as 2^16 or 360, in the unit of the data: undo the wraps of a counter or "
           "an angle; off undoes those that are found for the coefficients alone")
        ->capture_default_str();
    sub->add_flag("--clean", a->clean,
                  "Take outliers, jumps and wraps from the deviations too, and leave disturbed stretches and repeated "
                  "values out");
    sub->add_flag("--stream", a->stream, "Keep no record: octaves of oadev and ohdev in little memory");
    add_output_options(*sub, *a);
    sub->add_flag("--json", a->json, "One JSON object on standard output");
    sub->callback([a] { run(*a); });
}

}  // namespace ringlock::app
