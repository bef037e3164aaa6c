#include "analysis/allan/allan.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "analysis/allan/running_deviation.hpp"
#include "analysis/noise/fit.hpp"
#include "analysis/quantity/declared.hpp"
#include "analysis/quantity/scale.hpp"
#include "analysis/quantity/unit.hpp"
#include "analysis/record/series.hpp"
#include "analysis/report/plot.hpp"
#include "app/allan_figure.hpp"
#include "app/allan_noise.hpp"
#include "app/allan_output.hpp"
#include "app/arguments.hpp"
#include "app/coefficient_table.hpp"
#include "app/command.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/text_arguments.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

struct AllanArguments {
    std::string data;
    double rate_hz = 0.0;
    std::string kind;
    std::string unit;
    std::string scale;
    std::string arw_unit;
    std::string column;
    std::string dev = "oadev";
    std::string tau = "octave";
    double confidence = allan::Options{}.confidence;
    std::string bias = "published";
    std::string time;
    TextArguments text;
    std::string plot;
    bool follow_links = false;
    bool stream = false;
    bool json = false;
};

allan::Kind parse_kind(const std::string& kind) {
    if (kind == "phase") return allan::Kind::phase;
    if (kind == "increment") return allan::Kind::increment;
    if (kind == "rate") return allan::Kind::rate;
    const std::string found = kind.empty() ? "is missing" : fmt::format("'{}'", kind);
    throw InputError(
        fmt::format("--kind {}: say phase (accumulated angle), increment (angle gained in each sample) or rate. It is "
                    "never guessed: "
                    "the same numbers give a different, plausible-looking deviation for each",
                    found));
}

std::optional<quantity::Unit> parse_unit(const AllanArguments& a, allan::Kind kind) {
    const bool is_rate = kind == allan::Kind::rate;
    if (a.unit == "counts") return quantity::unit_of_counts(a.scale, is_rate);
    if (a.unit.empty()) {
        if (a.scale.empty()) return std::nullopt;
        throw InputError(fmt::format(
            "--scale {}: needs --unit: counts, where the scale has a unit, or the unit of the scaled numbers",
            a.scale));
    }
    const quantity::Unit unit = quantity::unit_for(a.unit, is_rate, "--unit");
    return a.scale.empty() ? unit : quantity::scaled(unit, a.scale);
}

/// The file's word for the unit of the column, or that of its name, against the command line.
void check_unit(const AllanArguments& a, const record::SeriesInfo& series) {
    if (a.unit.empty() || a.unit == "counts" || !a.scale.empty()) return;
    const bool is_rate = parse_kind(a.kind) == allan::Kind::rate;
    quantity::refuse_contradiction(a.data, series.column, series.unit, quantity::unit_for(a.unit, is_rate, "--unit"),
                                   "--unit");
}

allan::Bias parse_bias(const std::string& bias) {
    if (bias == "exact") return allan::Bias::exact;
    return bias == "raw" ? allan::Bias::none : allan::Bias::published;
}

/// What --tau asks for: one of the words, or a list.
struct TauChoice {
    std::string word;
    std::vector<std::int64_t> list;  ///< ascending, each once; empty where a word was given
};

TauChoice parse_tau(const std::string& tau) {
    if (tau == "octave" || tau == "decade" || tau == "all") return {tau, {}};
    TauChoice out;
    for (const std::string& part : split(tau)) {
        std::int64_t m = 0;
        const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), m);
        if (error != std::errc() || end != part.data() + part.size() || m < 1) {
            throw InputError(
                fmt::format("--tau '{}': must be octave, decade, all or averaging factors from 1 (whole numbers of "
                            "samples, not seconds)",
                            part));
        }
        out.list.push_back(m);
    }
    std::sort(out.list.begin(), out.list.end());
    out.list.erase(std::unique(out.list.begin(), out.list.end()), out.list.end());
    return out;
}

std::vector<std::int64_t> factors_for(const TauChoice& choice, allan::Estimator estimator, std::int64_t points) {
    const std::int64_t largest = allan::largest_factor(estimator, points);
    if (choice.word == "octave") return allan::octave_factors(largest);
    if (choice.word == "decade") return allan::decade_factors(largest);
    if (choice.word == "all") return allan::all_factors(largest);
    if (choice.list.back() > largest) {
        throw InputError(fmt::format("--tau {}: for {} this record allows averaging factors 1 to {}",
                                     choice.list.back(), allan::name(estimator), largest));
    }
    return choice.list;
}

void check_rate(const AllanArguments& a, const record::SeriesInfo& series) {
    if (!series.rate_hz) return;
    if (std::abs(*series.rate_hz - a.rate_hz) > 1e-9 * a.rate_hz) {
        throw InputError(fmt::format("{}: says rate_hz = {}, which contradicts --rate {}", printable(a.data),
                                     *series.rate_hz, a.rate_hz));
    }
}

/// The command line, checked.
struct Request {
    allan::Kind kind;
    std::optional<quantity::Unit> unit;
    const WalkUnit* walk_unit = nullptr;
    std::vector<allan::Estimator> estimators;
    TauChoice taus;
    record::SeriesRequest series;

    double scale() const { return unit ? unit->factor : 1.0; }
};

Request checked(const AllanArguments& a) {
    Request out{parse_kind(a.kind), {}, nullptr, parse_deviations(a.dev), {}, {}};
    out.unit = parse_unit(a, out.kind);
    if (!a.arw_unit.empty()) {
        if (!out.unit) throw InputError(fmt::format("--arw-unit {}: needs --unit, the unit of the data", a.arw_unit));
        out.walk_unit = &walk_unit(a.arw_unit, out.unit->instrument);
    }
    if (!(a.rate_hz > 0.0) || !std::isfinite(a.rate_hz)) {
        throw InputError(fmt::format("--rate {}: must be a positive number of samples a second", a.rate_hz));
    }
    if (!(a.confidence > 0.0 && a.confidence < 1.0)) {
        throw InputError(fmt::format("--confidence {}: must lie between 0 and 1, such as 0.6827", a.confidence));
    }
    out.taus = parse_tau(a.tau);
    const auto named = [](const std::string& name) {
        return name.empty() ? std::nullopt : std::optional<std::string>(name);
    };
    out.series = {.path = a.data,
                  .column = named(a.column),
                  .time = named(a.time),
                  .rate_hz = a.rate_hz,
                  .follow_links = a.follow_links};
    out.series.time_unit = time_unit_of(a.text, out.series.time.has_value());
    out.series.text = text_options(a.text);
    if (!a.stream) return out;
    if (out.taus.word != "octave") {
        throw InputError(fmt::format("--tau {}: a record that is not kept (--stream) has octaves only", a.tau));
    }
    for (const allan::Estimator e : out.estimators) {
        if (e == allan::Estimator::oadev || e == allan::Estimator::ohdev) continue;
        throw InputError(
            fmt::format("--dev {}: a record that is not kept (--stream) has oadev and ohdev only", allan::name(e)));
    }
    return out;
}

void check_size(const AllanArguments& a, allan::Kind kind, std::int64_t points, std::size_t data) {
    if (points >= 3) return;
    throw InputError(fmt::format("{}: {} data; a deviation needs at least {}", printable(a.data), data,
                                 kind == allan::Kind::phase ? 3 : 2));
}

void from_record(const AllanArguments& a, const Request& request, AllanOutput& out) {
    record::Series series = record::read_series(request.series);
    check_rate(a, series);
    check_unit(a, series);
    const allan::Phase phase =
        series.counts.empty()
            ? allan::phase_of(series.values, request.kind, out.tau0_s, request.scale())
            : allan::phase_of(series.counts, series.values, request.kind, out.tau0_s, request.scale());
    out.column = series.column;
    out.missing = series.missing;
    out.n = series.n - series.missing;
    const auto points = static_cast<std::int64_t>(phase.x.size());
    check_size(a, request.kind, points, out.n);
    std::vector<double> values = request.unit ? std::move(series.values) : std::vector<double>();
    series = {};
    for (const allan::Estimator estimator : request.estimators) {
        const std::vector<std::int64_t> factors = factors_for(request.taus, estimator, points);
        DeviationOutput deviation{estimator, {}, {}};
        deviation.points = allan::deviation(estimator, phase, out.tau0_s, factors,
                                            {.confidence = a.confidence, .bias = parse_bias(a.bias)});
        std::size_t there = 0;
        for (const std::int64_t m : factors) {
            if (there < deviation.points.size() && deviation.points[there].m == m) {
                ++there;
            } else {
                deviation.without_terms.push_back(m);
            }
        }
        out.deviations.push_back(std::move(deviation));
    }
    if (request.unit) search_and_fit(std::move(values), phase, request.kind, request.scale(), out);
}

void from_stream(const AllanArguments& a, const Request& request, AllanOutput& out) {
    std::vector<allan::RunningDeviation> running;
    for (const allan::Estimator e : request.estimators) {
        running.emplace_back(request.kind, out.tau0_s, e, request.scale());
    }
    const record::SeriesInfo info = record::stream_series(request.series, [&](std::span<const double> piece) {
        for (allan::RunningDeviation& r : running) r.add(piece);
    });
    check_rate(a, info);
    check_unit(a, info);
    if (info.rounded) {
        throw InputError(
            fmt::format("{}: counts beyond 2^53 lose their last digits in a stream; without --stream they "
                        "are kept whole",
                        printable(a.data)));
    }
    out.column = info.column;
    out.missing = info.missing;
    out.n = info.n - info.missing;
    out.streamed = true;
    check_size(a, request.kind, static_cast<std::int64_t>(out.n) + (request.kind == allan::Kind::phase ? 0 : 1), out.n);
    for (std::size_t k = 0; k < running.size(); ++k) {
        out.deviations.push_back({request.estimators[k], running[k].points(a.confidence), {}});
    }
    if (!request.unit) return;
    const std::vector<double> thin = running.front().thinned_phase();
    if (thin.empty()) {
        out.noise.emplace();
        out.noise->reason = "values are missing, and a stream keeps no part of the record to be fitted by itself";
        return;
    }
    const auto every = running.front().thinning();
    out.noise = noise::fit_noise(thin, out.tau0_s * static_cast<double>(every));
    if (every > 1) out.noise_thinning = every;
}

void run(const AllanArguments& a) {
    const Request request = checked(a);
    refuse_same_files({{"DATA", a.data, NamedFile::Use::input}, {"--plot", a.plot, NamedFile::Use::output}});
    const std::unique_ptr<AtomicPath> figure = claim_figure(a.plot);
    AllanOutput out;
    out.data = a.data;
    out.kind = a.kind;
    if (request.unit) {
        out.input_unit = request.unit->name;
        out.instrument = request.unit->instrument;
        out.walk_unit = request.walk_unit;
    }
    out.tau0_s = 1.0 / a.rate_hz;
    out.confidence = a.confidence;
    a.stream ? from_stream(a, request, out) : from_record(a, request, out);
    if (figure) report::write_svg(*figure, allan_figure(out));
    put(a.json ? allan_json(out) : allan_text(out));
}

}  // namespace

void add_allan(CLI::App& root) {
    auto a = std::make_shared<AllanArguments>();
    CLI::App* sub =
        root.add_subcommand("allan", "Allan deviation with intervals, and gyro noise coefficients, of a data file");
    sub->add_option("DATA", a->data,
                    "Text, packed or not, HDF5 or rlg-record; - for text from standard input. Example: ringlock allan "
                    "log.csv --rate 200 --kind rate --unit rad/s --column gx --time t --time-unit ns")
        ->required();
    sub->add_option("--rate", a->rate_hz, "Samples a second [Hz]")->required();
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
                    "'PATH[I,:]' is row I, 'PATH[:,J]' column J (from 0)");
    sub->add_option("--time", a->time,
                    "Column or dataset, named alike, of the times of the samples: rows left out become gaps; of text "
                    "two columns, as in sec,nsec or date,time");
    add_text_options(*sub, a->text);
    sub->add_option("--dev", a->dev, "Deviations, comma between: " + known_deviations())->capture_default_str();
    sub->add_option("--tau", a->tau, "octave | decade | all | averaging factors M,M,...")->capture_default_str();
    sub->add_option("--confidence", a->confidence, "Level of the intervals of the deviation")->capture_default_str();
    sub->add_option("--bias", a->bias,
                    "published | exact | raw: by what the variances of the total family are divided (docs/allan.md)")
        ->check(CLI::IsMember({"published", "exact", "raw"}))
        ->capture_default_str();
    add_follow_links(*sub, a->follow_links);
    sub->add_flag("--stream", a->stream, "Keep no record: octaves of oadev and ohdev in little memory");
    sub->add_option("--plot", a->plot, "also draw the figure into this SVG file");
    sub->add_flag("--json", a->json, "One JSON object on standard output");
    sub->callback([a] { run(*a); });
}

}  // namespace ringlock::app
