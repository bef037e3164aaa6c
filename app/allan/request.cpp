#include "app/allan/request.hpp"

#include <fmt/format.h>

#include "analysis/quantity/scale.hpp"
#include "app/arguments.hpp"
#include "engine/core/error.hpp"

namespace ringlock::app {
namespace {

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

allan::Bias parse_bias(const std::string& bias) {
    if (bias == "exact") return allan::Bias::exact;
    return bias == "raw" ? allan::Bias::none : allan::Bias::published;
}

void check_streamed(const AllanRequest& request, const std::string& tau) {
    if (request.clean || request.wrap.undo) {
        throw InputError(fmt::format("{}: a record that is not kept (--stream) is not searched for faults",
                                     request.clean ? "--clean" : "--wrap"));
    }
    if (request.taus.word != "octave") {
        throw InputError(fmt::format("--tau {}: a record that is not kept (--stream) has octaves only", tau));
    }
    for (const allan::Estimator e : request.estimators) {
        if (e == allan::Estimator::oadev || e == allan::Estimator::ohdev) continue;
        throw InputError(
            fmt::format("--dev {}: a record that is not kept (--stream) has oadev and ohdev only", allan::name(e)));
    }
}

}  // namespace

AllanRequest allan_request(const AllanArguments& a) {
    AllanRequest out;
    out.kind = parse_kind(a.kind);
    out.kind_name = a.kind;
    out.estimators = parse_deviations(a.dev);
    out.unit = parse_unit(a, out.kind);
    out.unit_is_of_file = out.unit && a.unit != "counts" && a.scale.empty();
    if (!a.arw_unit.empty()) {
        if (!out.unit) throw InputError(fmt::format("--arw-unit {}: needs --unit, the unit of the data", a.arw_unit));
        out.walk_unit = &allan_run::walk_unit(a.arw_unit, out.unit->instrument, "--arw-unit");
    }
    out.sampling = sampling_of(a.rate, a.tau0);
    if (!(a.confidence > 0.0 && a.confidence < 1.0)) {
        throw InputError(fmt::format("--confidence {}: must lie between 0 and 1, such as 0.6827", a.confidence));
    }
    out.options = {.confidence = a.confidence, .bias = parse_bias(a.bias)};
    out.taus = allan_run::parse_tau(a.tau, "--tau");
    out.series.follow_links = a.follow_links;
    if (!a.time.empty()) out.series.time = a.time;
    out.series.time_unit = time_unit_of(a.text, out.series.time.has_value());
    out.series.text = text_options(a.text);
    out.wrap = allan_run::parse_wrap(a.wrap, "--wrap");
    out.clean = a.clean;
    if (out.clean && !out.unit) {
        throw InputError("--clean: needs --unit, the unit of the data: faults are searched for with the coefficients");
    }
    if (out.clean) out.wrap.undo = true;
    out.stream = a.stream;
    if (out.stream) check_streamed(out, a.tau);
    return out;
}

}  // namespace ringlock::app
