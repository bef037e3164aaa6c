#include "app/allan/series.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <span>
#include <string>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/running_deviation.hpp"
#include "analysis/allan_run/run.hpp"
#include "analysis/noise/fit.hpp"
#include "analysis/quantity/declared.hpp"
#include "analysis/record/series/series.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

/// The file's word for the rate against the command line.
void check_rate(const Sampling& sampling, const std::string& file, const record::SeriesInfo& series) {
    if (!series.rate_hz) return;
    if (std::abs(*series.rate_hz - sampling.rate_hz) > 1e-9 * sampling.rate_hz) {
        throw InputError(fmt::format("{}: says rate_hz = {}, which contradicts {}", printable(file), *series.rate_hz,
                                     sampling.said));
    }
}

/// The file's word for the unit of the column, or that of its name, against the command line.
void check_unit(const AllanRequest& request, const std::string& file, const record::SeriesInfo& series) {
    if (!request.unit_is_of_file) return;
    quantity::refuse_contradiction(file, series.column, series.unit, *request.unit, "--unit");
}

Sampling sampling_in(const AllanRequest& request, record::SeriesRequest series, const RepeatedInput& input) {
    if (!request.sampling.from_file) return request.sampling;
    if (series.time && !series.column) {
        throw InputError("--rate file: with --time it needs --column, too");
    }
    series.time = std::nullopt;
    series.time_unit = std::nullopt;
    series.text.quiet = true;
    const record::SeriesInfo info = record::stream_series(series, [](std::span<const double>) {});
    input.rewind();
    return declared_sampling(series.path, info.rate_hz);
}

allan_run::Names message_names(const std::string& file, const std::string& column) {
    const std::string data = printable(file);
    return {.data = data, .series = fmt::format("{}: column {}", data, printable(column))};
}

void from_record(const AllanRequest& request, const record::SeriesRequest& from, const Sampling& sampling,
                 AnalysedSeries& into, bool keep_data) {
    AllanOutput& out = into.out;
    record::Series series = record::read_series(from);
    check_rate(sampling, from.path, series);
    check_unit(request, from.path, series);
    const allan_run::Names names = message_names(from.path, series.column);
    allan_run::prepare(request, names, series, out);
    if (keep_data) {
        into.values = series.values;
        into.counts = series.counts;
    }
    allan_run::evaluate(request, names, series, out);
}

void from_stream(const AllanRequest& request, const record::SeriesRequest& from, const Sampling& sampling,
                 AllanOutput& out) {
    std::vector<allan::RunningDeviation> running;
    for (const allan::Estimator e : request.estimators) {
        running.emplace_back(request.kind, out.tau0_s, e, request.scale());
    }
    const record::SeriesInfo info = record::stream_series(from, [&](std::span<const double> piece) {
        for (allan::RunningDeviation& r : running) r.add(piece);
    });
    check_rate(sampling, from.path, info);
    check_unit(request, from.path, info);
    if (info.rounded) {
        throw InputError(
            fmt::format("{}: counts beyond 2^53 lose their last digits in a stream; without --stream they "
                        "are kept whole",
                        printable(from.path)));
    }
    out.column = info.column;
    out.missing = info.missing;
    out.n = info.n - info.missing;
    out.streamed = true;
    allan_run::check_size(message_names(from.path, info.column), request.kind,
                          static_cast<std::int64_t>(out.n) + (request.kind == allan::Kind::phase ? 0 : 1), out.n);
    for (std::size_t k = 0; k < running.size(); ++k) {
        out.deviations.push_back({request.estimators[k], running[k].points(request.options.confidence), {}});
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

}  // namespace

AnalysedSeries analyse(const AllanRequest& request, const SeriesName& name, const RepeatedInput& input,
                       bool keep_data) {
    input.rewind();
    record::SeriesRequest from = request.series;
    from.path = name.path;
    from.column = name.column;
    from.text.quiet = from.text.quiet || name.read_before;
    const Sampling sampling = sampling_in(request, from, input);
    from.rate_hz = sampling.rate_hz;
    AnalysedSeries into;
    AllanOutput& out = into.out;
    out.data = name.path;
    allan_run::describe(request, sampling.tau0_s, out);
    if (request.stream) {
        from_stream(request, from, sampling, out);
    } else {
        from_record(request, from, sampling, into, keep_data);
    }
    return into;
}

}  // namespace ringlock::app
