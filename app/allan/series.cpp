#include "app/allan/series.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/running_deviation.hpp"
#include "analysis/findings/cleaned.hpp"
#include "analysis/findings/values.hpp"
#include "analysis/noise/fit.hpp"
#include "analysis/quantity/declared.hpp"
#include "analysis/record/series/series.hpp"
#include "app/allan/allan_noise.hpp"
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

void check_size(const std::string& file, allan::Kind kind, std::int64_t points, std::size_t data) {
    if (points >= 3) return;
    throw InputError(fmt::format("{}: {} data; a deviation needs at least {}", printable(file), data,
                                 kind == allan::Kind::phase ? 3 : 2));
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

DeviationOutput deviation_of(const AllanRequest& request, const allan::Phase& phase, allan::Estimator estimator,
                             double tau0_s) {
    const auto points = static_cast<std::int64_t>(phase.x.size());
    const std::vector<std::int64_t> factors = factors_for(request.taus, estimator, points, tau0_s);
    DeviationOutput out{estimator, allan::deviation(estimator, phase, tau0_s, factors, request.options), {}};
    std::size_t there = 0;
    for (const std::int64_t m : factors) {
        if (there < out.points.size() && out.points[there].m == m) {
            ++there;
        } else {
            out.without_terms.push_back(m);
        }
    }
    return out;
}

allan::Phase phase_of(const AllanRequest& request, const record::Series& series, double tau0_s) {
    return series.counts.empty() ? allan::phase_of(series.values, request.kind, tau0_s, request.scale())
                                 : allan::phase_of(series.counts, series.values, request.kind, tau0_s, request.scale());
}

/// Undoes wraps where --wrap asks for it: values continue beyond the range of the counter.
void undo_wraps(const AllanRequest& request, const std::string& file, record::Series& series, AllanOutput& out) {
    if (!request.wrap.undo) return;
    if (!series.counts.empty()) {
        throw InputError(
            fmt::format("{}: column {}: --wrap: has counts beyond 2^53, whose wraps are not searched for; subtract a "
                        "constant from them",
                        printable(file), printable(series.column)));
    }
    std::optional<findings::Wraps> wraps;
    try {
        wraps = request.wrap.modulus ? findings::wraps_of(*request.wrap.modulus, series.values)
                                     : findings::find_wraps(series.values);
    } catch (const InputError& error) {
        throw InputError(
            fmt::format("{}: column {}: --wrap: {}", printable(file), printable(series.column), error.what()));
    }
    if (!wraps) return;
    for (const std::size_t at : wraps->at) {
        out.findings.push_back({.kind = findings::Kind::wrap, .row = at, .size = wraps->modulus});
    }
    out.wraps_undone = wraps->at.size();
    findings::unwrap(*wraps, series.values);
}

bool is_event(const findings::Finding& found) {
    return found.kind == findings::Kind::outlier || found.kind == findings::Kind::jump ||
           found.kind == findings::Kind::variance;
}

/// Searches the data, takes the findings from them and fits the rest. Where stretches are left out the rest is searched
/// again, since nothing else is searched for next to a disturbed stretch.
class Cleaning {
   public:
    Cleaning(const AllanRequest& request, std::string file, record::Series& series, AllanOutput& out)
        : request_(request), file_(std::move(file)), series_(series), out_(out) {}

    void run() {
        search(out_);
        take_off(out_.findings);
        if (cleaned_.left_out > 0) {
            AllanOutput rest;
            rest.tau0_s = out_.tau0_s;
            rest.missing = out_.missing + cleaned_.left_out;
            rest.n = out_.n - cleaned_.left_out;
            search(rest);
            std::erase_if(rest.findings, [](const findings::Finding& f) { return !is_event(f); });
            take_off(rest.findings);
            join(rest);
        }
        out_.n -= cleaned_.left_out;
        out_.cleaned = cleaned_;
    }

   private:
    void search(AllanOutput& into) const {
        search_and_fit(series_.values, phase_of(request_, series_, out_.tau0_s), request_.kind, request_.scale(), into);
    }
    void take_off(const std::vector<findings::Finding>& found) {
        const findings::Cleaned now = findings::clean(found, request_.kind, out_.tau0_s, series_.values);
        cleaned_.left_out += now.left_out;
        cleaned_.corrected += now.corrected;
        cleaned_.jumps += now.jumps;
        if (2 * cleaned_.left_out <= out_.n) return;
        throw InputError(fmt::format(
            "{}: column {}: --clean would leave out {} of {} data, more than half of them, because their noise differs "
            "from that of the others; analyse the parts of the record one by one",
            printable(file_), printable(series_.column), cleaned_.left_out, out_.n));
    }
    void join(AllanOutput& rest) {
        out_.findings.insert(out_.findings.end(), rest.findings.begin(), rest.findings.end());
        std::stable_sort(out_.findings.begin(), out_.findings.end(),
                         [](const findings::Finding& a, const findings::Finding& b) { return a.row < b.row; });
        out_.noise = std::move(rest.noise);
        out_.jump_instead_of_walk = rest.jump_instead_of_walk;
        out_.noise_stretch = rest.noise_stretch;
        out_.noise_filled_in = rest.noise_filled_in;
    }

    const AllanRequest& request_;
    std::string file_;
    record::Series& series_;
    AllanOutput& out_;
    findings::Cleaned cleaned_;
};

void from_record(const AllanRequest& request, const record::SeriesRequest& from, const Sampling& sampling,
                 AnalysedSeries& into, bool keep_data) {
    AllanOutput& out = into.out;
    record::Series series = record::read_series(from);
    check_rate(sampling, from.path, series);
    check_unit(request, from.path, series);
    out.column = series.column;
    out.missing = series.missing;
    out.n = series.n - series.missing;
    undo_wraps(request, from.path, series, out);
    if (request.clean) Cleaning(request, from.path, series, out).run();
    const allan::Phase phase = phase_of(request, series, out.tau0_s);
    check_size(from.path, request.kind, static_cast<std::int64_t>(phase.x.size()), out.n);
    if (keep_data) {
        into.values = series.values;
        into.counts = std::move(series.counts);
    }
    std::vector<double> values = request.unit && !request.clean ? std::move(series.values) : std::vector<double>();
    series.values = {};
    series.counts = {};
    for (const allan::Estimator estimator : request.estimators) {
        out.deviations.push_back(deviation_of(request, phase, estimator, out.tau0_s));
    }
    if (request.unit && !request.clean) search_and_fit(std::move(values), phase, request.kind, request.scale(), out);
    for (const findings::Finding& found : out.findings) {
        if (!series.lines.empty()) out.finding_lines.push_back(series.line_of(found.row).value_or(0));
    }
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
    check_size(from.path, request.kind, static_cast<std::int64_t>(out.n) + (request.kind == allan::Kind::phase ? 0 : 1),
               out.n);
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
    out.kind = request.kind_name;
    if (request.unit) {
        out.input_unit = request.unit->name;
        out.instrument = request.unit->instrument;
        out.walk_unit = request.walk_unit;
    }
    out.tau0_s = sampling.tau0_s;
    out.confidence = request.options.confidence;
    if (request.stream) {
        from_stream(request, from, sampling, out);
    } else {
        from_record(request, from, sampling, into, keep_data);
    }
    return into;
}

}  // namespace ringlock::app
