#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/allan_run/deviations.hpp"
#include "analysis/allan_run/outcome.hpp"
#include "analysis/allan_run/run.hpp"
#include "analysis/quantity/unit.hpp"
#include "analysis/record/series/series.hpp"
#include "engine/core/error.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"

// The library has a function of the name of a room.
namespace ringlock::library {
namespace family = ringlock::allan;
}

#include "library/include/ringlock/allan.hpp"

namespace ringlock {
inline namespace v1 {
namespace {

namespace family = library::family;
using allan_run::AllanOutput;
using allan_run::Request;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

family::Kind kind_of(Kind kind) {
    switch (kind) {
        case Kind::increment:
            return family::Kind::increment;
        case Kind::rate:
            return family::Kind::rate;
        case Kind::phase:
            break;
    }
    return family::Kind::phase;
}

family::Bias bias_of(Bias bias) {
    switch (bias) {
        case Bias::exact:
            return family::Bias::exact;
        case Bias::raw:
            return family::Bias::none;
        case Bias::published:
            break;
    }
    return family::Bias::published;
}

double tau0_of(const AllanOptions& options) {
    const bool by_rate = options.rate_hz != 0.0;
    if (by_rate == (options.tau0_s != 0.0)) {
        throw InputError(by_rate ? "rate_hz and tau0_s: both say how far samples are apart; give one of them"
                                 : "rate_hz: is required, the samples a second; tau0_s gives the sampling interval "
                                   "instead");
    }
    const double tau0_s = by_rate ? 1.0 / options.rate_hz : options.tau0_s;
    if (tau0_s > 0.0 && std::isfinite(tau0_s) && std::isfinite(1.0 / tau0_s)) return tau0_s;
    throw InputError(by_rate
                         ? fmt::format("rate_hz = {}: must be a positive number of samples a second", options.rate_hz)
                         : fmt::format("tau0_s = {}: must be a positive number of seconds", options.tau0_s));
}

void set_unit(const AllanOptions& options, Request& request) {
    if (!(options.scale > 0.0) || !std::isfinite(options.scale)) {
        throw InputError(fmt::format("scale = {}: must be a positive number", options.scale));
    }
    if (options.unit.empty()) {
        if (options.scale != 1.0) throw InputError("scale: needs unit, the unit of the scaled numbers");
        if (options.clean) {
            throw InputError("clean: needs unit, the unit of the data: faults are searched for with the coefficients");
        }
        if (!options.arw_unit.empty()) throw InputError("arw_unit: needs unit, the unit of the data");
        return;
    }
    request.unit = quantity::unit_for(options.unit, request.kind == family::Kind::rate, "unit");
    if (options.scale != 1.0) {
        request.unit->factor *= options.scale;
        request.unit->name = fmt::format("{:g} {}", options.scale, request.unit->name);
    }
    if (!options.arw_unit.empty()) {
        request.walk_unit = &allan_run::walk_unit(options.arw_unit, request.unit->instrument, "arw_unit");
    }
}

Request request_of(const AllanOptions& options) {
    if (!options.kind) {
        throw InputError(
            "kind: is required: phase (accumulated angle), increment (angle gained in each sample) or rate. It is "
            "never "
            "guessed: the same numbers give a different, plausible-looking deviation for each");
    }
    if (!(options.confidence > 0.0 && options.confidence < 1.0)) {
        throw InputError(fmt::format("confidence = {}: must lie between 0 and 1, such as 0.6827", options.confidence));
    }
    Request request;
    request.kind = kind_of(*options.kind);
    request.kind_name = allan_run::name_of(request.kind);
    request.estimators = allan_run::deviations_named(options.deviations, "deviations:");
    if (request.estimators.empty()) {
        throw InputError(fmt::format("deviations: is empty; there are {}", allan_run::known_deviations()));
    }
    request.taus = allan_run::parse_tau(options.taus, "taus");
    request.options = {.confidence = options.confidence, .bias = bias_of(options.bias)};
    request.wrap = allan_run::parse_wrap(options.wrap, "wrap");
    request.clean = options.clean;
    if (request.clean) request.wrap.undo = true;
    set_unit(options, request);
    return request;
}

void refuse_infinite(std::span<const double> data) {
    const auto infinite = std::find_if(data.begin(), data.end(), [](double v) { return std::isinf(v); });
    if (infinite == data.end()) return;
    throw InputError(
        fmt::format("data: row {} (counted from 0) is infinite; a missing value is NaN", infinite - data.begin()));
}

record::Series series_of(std::span<const double> data, const AllanOptions& options) {
    refuse_infinite(data);
    record::Series series;
    series.column = options.column;
    series.n = data.size();
    series.values.assign(data.begin(), data.end());
    series.missing =
        static_cast<std::size_t>(std::count_if(data.begin(), data.end(), [](double v) { return std::isnan(v); }));
    if (series.missing == series.n) throw InputError(fmt::format("data: {} values, and none is there", series.n));
    return series;
}

record::Series series_of(std::span<const std::int64_t> data, const AllanOptions& options) {
    constexpr std::int64_t exact = std::int64_t{1} << 53;
    const std::vector<double> values(data.begin(), data.end());
    record::Series series = series_of(std::span<const double>(values), options);
    series.rounded = std::any_of(data.begin(), data.end(), [](std::int64_t v) { return v > exact || v < -exact; });
    if (series.rounded) series.counts.assign(data.begin(), data.end());
    return series;
}

std::vector<Deviation> deviations_of(const AllanOutput& out) {
    std::vector<Deviation> list;
    for (const allan_run::DeviationOutput& d : out.deviations) {
        Deviation deviation{std::string(family::name(d.estimator)), {}, d.without_terms};
        for (const family::Point& p : d.points) {
            deviation.points.push_back({p.m, p.tau_s, p.dev, p.lo, p.hi, p.edf, p.bias, p.terms, p.alpha});
        }
        list.push_back(std::move(deviation));
    }
    return list;
}

std::vector<NoiseCoefficient> noise_of(const AllanOutput& out) {
    std::vector<NoiseCoefficient> list;
    if (!out.noise || !out.noise->described) return list;
    for (const allan_run::CoefficientName& name : allan_run::names_of(*out.instrument).coefficients) {
        const noise::Coefficient c = allan_run::times((*out.noise).*name.member, name.factor);
        NoiseCoefficient coefficient{
            std::string(name.key), std::string(name.name), std::string(name.unit), {}, {}, {}, {}};
        if (c.resolved) {
            coefficient.value = c.value;
            coefficient.lo = c.lo;
            coefficient.hi = c.hi;
        } else {
            coefficient.upper_limit_95 = c.hi;
        }
        list.push_back(std::move(coefficient));
    }
    return list;
}

Allan result_of(const AllanOutput& out) {
    Allan result;
    result.n = out.n;
    result.missing = out.missing;
    result.tau0_s = out.tau0_s;
    if (out.instrument) result.unit = allan_run::names_of(*out.instrument).rate_unit;
    result.deviations = deviations_of(out);
    for (const findings::Finding& found : out.findings) {
        const bool is_wrap = found.kind == findings::Kind::wrap;
        result.findings.push_back(
            {findings::name_of(found.kind), found.row, found.length, found.size, is_wrap ? nan : found.size_sigma});
    }
    result.wraps_undone = out.wraps_undone;
    result.noise = noise_of(out);
    if (out.noise && !out.noise->described) result.noise_withheld = out.noise->reason;
    result.json = json_text(allan_run::allan_object(out));
    return result;
}

template <class T>
Allan analysed(std::span<const T> data, const AllanOptions& options) {
    const Request request = request_of(options);
    const double tau0_s = tau0_of(options);
    record::Series series = series_of(data, options);
    const allan_run::Names names{.data = "data",
                                 .series = fmt::format("data: column {}", printable(options.column)),
                                 .taus = "taus",
                                 .wrap = "wrap",
                                 .clean = "clean"};
    AllanOutput out;
    out.data = "data";
    allan_run::describe(request, tau0_s, out);
    allan_run::prepare(request, names, series, out);
    allan_run::evaluate(request, names, series, out);
    return result_of(out);
}

}  // namespace

const Deviation& Allan::deviation(std::string_view name) const {
    std::vector<std::string> names;
    for (const Deviation& deviation : deviations) {
        if (deviation.name == name) return deviation;
        names.push_back(deviation.name);
    }
    throw InputError(
        fmt::format("deviation \"{}\": is not in the analysis, which has {}", printable(name), fmt::join(names, ", ")));
}

const NoiseCoefficient* Allan::coefficient(std::string_view key) const {
    const auto found = std::find_if(noise.begin(), noise.end(), [&](const auto& c) { return c.key == key; });
    return found == noise.end() ? nullptr : &*found;
}

Allan allan(std::span<const double> data, const AllanOptions& options) { return analysed(data, options); }

Allan allan(std::span<const std::int64_t> data, const AllanOptions& options) { return analysed(data, options); }

}  // namespace v1
}  // namespace ringlock
