#include "app/allan/output/read_allan.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "analysis/allan/estimator.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/read_json.hpp"

namespace ringlock::app {

namespace {

using nlohmann::json;

std::optional<double> number_in(const json& value) {
    return value.is_null() ? std::nullopt : std::optional(value.get<double>());
}

noise::Estimate estimate_in(const json& object, double factor = 1.0) {
    return {number_or_nan(object.at("value")) / factor, number_or_nan(object.at("lo")) / factor,
            number_or_nan(object.at("hi")) / factor};
}

quantity::Instrument instrument_named(const std::string& name) {
    for (const quantity::Instrument instrument :
         {quantity::Instrument::gyro, quantity::Instrument::accelerometer, quantity::Instrument::clock}) {
        if (names_of(instrument).name == name) return instrument;
    }
    throw InputError(fmt::format("instrument: \"{}\" is none; it must be \"gyro\", \"accelerometer\" or \"clock\"",
                                 printable(name)));
}

findings::Kind kind_named(const std::string& name) {
    using findings::Kind;
    for (const Kind kind :
         {Kind::outlier, Kind::jump, Kind::variance, Kind::wrap, Kind::repeated, Kind::clipped, Kind::gap}) {
        if (findings::name_of(kind) == name) return kind;
    }
    throw InputError(fmt::format("findings: \"{}\" is no kind of finding that this program knows", printable(name)));
}

findings::Finding finding_in(const json& object) {
    findings::Finding found;
    found.kind = kind_named(object.at("kind").get<std::string>());
    const auto row = object.at("row").get<std::int64_t>();
    const auto rows = object.at("rows").get<std::int64_t>();
    if (row < 1 || rows < 0) throw InputError(fmt::format("findings: row {} is none; rows count from 1", row));
    found.row = static_cast<std::size_t>(row - 1);
    found.length = static_cast<std::size_t>(rows);
    found.size = number_or_nan(object.at("size"));
    found.size_sigma = number_or_nan(object.at("size_sigma"));
    found.of_angle = object.value("of", "") == "angle";
    return found;
}

DeviationOutput deviation_in(const std::string& name, const json& list) {
    const auto estimator = allan::estimator_named(name);
    if (!estimator) {
        throw InputError(fmt::format("deviations: \"{}\" is none that this program knows", printable(name)));
    }
    DeviationOutput deviation{*estimator, {}, {}};
    for (const json& one : list) {
        allan::Point point;
        point.m = one.at("m").get<std::int64_t>();
        point.tau_s = number_or_nan(one.at("tau_s"));
        point.dev = number_or_nan(one.at("dev"));
        point.terms = one.at("terms").get<std::int64_t>();
        point.alpha = one.at("alpha").is_null() ? 0 : one.at("alpha").get<int>();
        point.edf = number_or_nan(one.at("edf"));
        point.lo = number_or_nan(one.at("lo"));
        point.hi = number_or_nan(one.at("hi"));
        if (!(point.tau_s > 0.0)) throw InputError(fmt::format("deviations: {}: a tau_s is not above zero", name));
        deviation.points.push_back(point);
    }
    return deviation;
}

noise::NoiseFit noise_in(const json& object, const InstrumentNames& names) {
    noise::NoiseFit fit;
    fit.described = object.at("noise_withheld").is_null();
    if (!fit.described) {
        fit.reason = object.at("noise_withheld").get<std::string>();
        return fit;
    }
    const json& values = object.at("noise");
    const json& limits = object.at("noise_upper_limits_95");
    for (const CoefficientName& name : names.coefficients) {
        const std::string key(name.key);
        noise::Coefficient& coefficient = fit.*name.member;
        if (const json& value = values.at(key); !value.is_null()) {
            const noise::Estimate e = estimate_in(value, name.factor);
            coefficient = {true, e.value, e.lo, e.hi};
        } else if (const auto limit = number_in(limits.at(key))) {
            coefficient.hi = *limit / name.factor;
        }
    }
    if (const json& correlated = values.at("correlated"); !correlated.is_null()) {
        noise::Correlated term;
        term.correlation_time_s = estimate_in(correlated.at("correlation_time_s"));
        term.amplitude_deg_h_rt_h = estimate_in(correlated.at(std::string(names.driving_key)), names.driving_factor);
        term.rms_rate_deg_h = estimate_in(correlated.at(std::string(names.rms_key)));
        fit.correlated = term;
    }
    for (const json& line : values.at("sinusoidal")) {
        noise::Sinusoid sinusoid;
        sinusoid.frequency_hz = estimate_in(line.at("frequency_hz"));
        sinusoid.rate_amplitude_deg_h = estimate_in(line.at(std::string(names.amplitude_key)));
        fit.sinusoids.push_back(sinusoid);
    }
    return fit;
}

template <class T>
std::optional<T> optional_in(const json& object, const char* key) {
    return object.at(key).is_null() ? std::nullopt : std::optional(object.at(key).get<T>());
}

AllanOutput output_of(const json& object) {
    AllanOutput out;
    out.data = object.value("data", "");
    out.column = object.at("column").get<std::string>();
    out.kind = object.at("kind").get<std::string>();
    out.n = object.at("n").get<std::size_t>();
    out.missing = object.at("missing").get<std::size_t>();
    out.tau0_s = number_or_nan(object.at("tau0_s"));
    out.confidence = number_or_nan(object.at("confidence"));
    out.streamed = object.at("stride").get<std::string>() == "tau/8";
    if (const auto instrument = optional_in<std::string>(object, "instrument")) {
        out.instrument = instrument_named(*instrument);
    }
    for (const auto& [name, list] : object.at("deviations").get_ref<const json::object_t&>()) {
        out.deviations.push_back(deviation_in(name, list));
    }
    for (const json& one : object.at("findings")) {
        out.findings.push_back(finding_in(one));
        out.finding_lines.push_back(optional_in<std::size_t>(one, "line").value_or(0));
    }
    out.wraps_undone = object.at("wraps_undone").get<std::size_t>();
    if (const json& cleaned = object.at("cleaned"); !cleaned.is_null()) {
        out.cleaned.emplace();
        out.cleaned->corrected = cleaned.at("outliers").get<std::size_t>();
        out.cleaned->jumps = cleaned.at("jumps").get<std::size_t>();
        out.cleaned->left_out = cleaned.at("left_out").get<std::size_t>();
    }
    if (out.instrument && !(object.at("noise").is_null() && object.at("noise_withheld").is_null())) {
        out.noise = noise_in(object, names_of(*out.instrument));
    }
    if (const json& jump = object.at("jump_instead_of_random_walk"); !jump.is_null()) {
        out.jump_instead_of_walk = finding_in(jump);
    }
    out.noise_stretch = optional_in<std::size_t>(object, "noise_fitted_points");
    out.noise_filled_in = optional_in<std::size_t>(object, "noise_filled_in");
    out.noise_thinning = optional_in<std::int64_t>(object, "noise_fitted_every");
    return out;
}

}  // namespace

bool is_allan_object(const nlohmann::json& object) {
    if (!object.is_object()) return false;
    return object.contains("deviations") || (object.contains("series") && object.at("series").is_array());
}

std::vector<AllanOutput> allan_outputs_of(const nlohmann::json& object) {
    std::vector<AllanOutput> series;
    if (!object.contains("series")) {
        series.push_back(output_of(object));
        return series;
    }
    for (const json& one : object.at("series")) series.push_back(output_of(one));
    if (series.empty()) throw InputError("series: is empty; ringlock allan --json prints one object for each series");
    return series;
}

}  // namespace ringlock::app
