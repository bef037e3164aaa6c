#include "analysis/allan_run/run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "analysis/allan_run/search_and_fit.hpp"
#include "analysis/findings/cleaned.hpp"
#include "analysis/findings/values.hpp"
#include "engine/core/error.hpp"

namespace ringlock::allan_run {
namespace {

DeviationOutput deviation_of(const Request& request, const Names& names, const allan::Phase& phase,
                             allan::Estimator estimator, double tau0_s) {
    const auto points = static_cast<std::int64_t>(phase.x.size());
    const std::vector<std::int64_t> factors = factors_for(request.taus, estimator, points, tau0_s, names.taus);
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

/// Undoes wraps where that is asked for: values continue beyond the range of the counter.
void undo_wraps(const Request& request, const Names& names, record::Series& series, AllanOutput& out) {
    if (!request.wrap.undo) return;
    if (!series.counts.empty()) {
        throw InputError(fmt::format(
            "{}: {}: has counts beyond 2^53, whose wraps are not searched for; subtract a constant from them",
            names.series, names.wrap));
    }
    std::optional<findings::Wraps> wraps;
    try {
        wraps = request.wrap.modulus ? findings::wraps_of(*request.wrap.modulus, series.values)
                                     : findings::find_wraps(series.values);
    } catch (const InputError& error) {
        throw InputError(fmt::format("{}: {}: {}", names.series, names.wrap, error.what()));
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
           found.kind == findings::Kind::variance || found.kind == findings::Kind::repeated;
}

/// Searches the data, takes the findings from them and fits the rest. Where stretches are left out the rest is searched
/// again, since nothing else is searched for next to a disturbed stretch.
class Cleaning {
   public:
    Cleaning(const Request& request, const Names& names, record::Series& series, AllanOutput& out)
        : request_(request), names_(names), series_(series), out_(out) {}

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
        search_and_fit(series_.values, series_.counts, phase_of(request_, series_, out_.tau0_s), request_.kind,
                       request_.scale(), into);
    }
    void take_off(const std::vector<findings::Finding>& found) {
        const findings::Cleaned now = findings::clean(found, request_.kind, out_.tau0_s, series_.values);
        cleaned_.left_out += now.left_out;
        cleaned_.corrected += now.corrected;
        cleaned_.jumps += now.jumps;
        if (2 * cleaned_.left_out <= out_.n) return;
        throw InputError(
            fmt::format("{}: {} would leave out {} of {} data, more than half of them, because their noise differs "
                        "from that of the others or they repeat one value; analyse the parts of the record one by one",
                        names_.series, names_.clean, cleaned_.left_out, out_.n));
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

    const Request& request_;
    const Names& names_;
    record::Series& series_;
    AllanOutput& out_;
    findings::Cleaned cleaned_;
};

}  // namespace

std::string_view name_of(allan::Kind kind) {
    switch (kind) {
        case allan::Kind::increment:
            return "increment";
        case allan::Kind::rate:
            return "rate";
        case allan::Kind::phase:
            break;
    }
    return "phase";
}

allan::Phase phase_of(const Request& request, const record::Series& series, double tau0_s) {
    return series.counts.empty() ? allan::phase_of(series.values, request.kind, tau0_s, request.scale())
                                 : allan::phase_of(series.counts, series.values, request.kind, tau0_s, request.scale());
}

void describe(const Request& request, double tau0_s, AllanOutput& out) {
    out.kind = request.kind_name;
    if (request.unit) {
        out.input_unit = request.unit->name;
        out.instrument = request.unit->instrument;
        out.walk_unit = request.walk_unit;
    }
    out.tau0_s = tau0_s;
    out.confidence = request.options.confidence;
}

void prepare(const Request& request, const Names& names, record::Series& series, AllanOutput& out) {
    out.column = series.column;
    out.missing = series.missing;
    out.n = series.n - series.missing;
    undo_wraps(request, names, series, out);
    if (request.clean) Cleaning(request, names, series, out).run();
}

void evaluate(const Request& request, const Names& names, record::Series& series, AllanOutput& out) {
    const allan::Phase phase = phase_of(request, series, out.tau0_s);
    check_size(names, request.kind, static_cast<std::int64_t>(phase.x.size()), out.n);
    std::vector<double> values = request.unit && !request.clean ? std::move(series.values) : std::vector<double>();
    const std::vector<std::int64_t> counts = std::move(series.counts);
    series.values = {};
    series.counts = {};
    for (const allan::Estimator estimator : request.estimators) {
        out.deviations.push_back(deviation_of(request, names, phase, estimator, out.tau0_s));
    }
    if (request.unit && !request.clean) {
        search_and_fit(std::move(values), counts, phase, request.kind, request.scale(), out);
    }
    for (const findings::Finding& found : out.findings) {
        if (!series.lines.empty()) out.finding_lines.push_back(series.line_of(found.row).value_or(0));
    }
}

void check_size(const Names& names, allan::Kind kind, std::int64_t points, std::size_t data) {
    if (points >= 3) return;
    throw InputError(fmt::format("{}: {} data; a deviation needs at least {}", names.data, data,
                                 kind == allan::Kind::phase ? 3 : 2));
}

}  // namespace ringlock::allan_run
