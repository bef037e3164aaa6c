#include "analysis/allan_run/outcome.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

namespace ringlock::allan_run {

noise::Estimate times(const noise::Estimate& e, double factor) {
    return {factor * e.value, factor * e.lo, factor * e.hi};
}

noise::Coefficient times(noise::Coefficient c, double factor) {
    for (std::optional<double>* v : {&c.value, &c.lo, &c.hi}) {
        if (*v) **v *= factor;
    }
    return c;
}

noise::Coefficient walk_in(const WalkUnit& unit, const noise::NoiseFit& fit) {
    for (const CoefficientName& name : names_of(unit.instrument).coefficients) {
        if (name.member == &noise::NoiseFit::arw_deg_rt_h) {
            return times(fit.arw_deg_rt_h, name.factor * unit.factor);
        }
    }
    return {};
}

std::size_t line_of(const AllanOutput& out, std::size_t i) {
    return i < out.finding_lines.size() ? out.finding_lines[i] : 0;
}

namespace {

using Json = nlohmann::ordered_json;

Json number(double v) { return std::isfinite(v) ? Json(v) : Json(nullptr); }
Json number(const std::optional<double>& v) { return v ? number(*v) : Json(nullptr); }
Json estimate(const noise::Estimate& e) {
    return {{"value", number(e.value)}, {"lo", number(e.lo)}, {"hi", number(e.hi)}};
}

Json correlated(const noise::NoiseFit& fit, const InstrumentNames& names) {
    if (!fit.described || !fit.correlated) return nullptr;
    const noise::Estimate driving = times(fit.correlated->amplitude_deg_h_rt_h, names.driving_factor);
    return {{"correlation_time_s", estimate(fit.correlated->correlation_time_s)},
            {std::string(names.driving_key), estimate(driving)},
            {std::string(names.rms_key), estimate(fit.correlated->rms_rate_deg_h)}};
}

Json sinusoids(const noise::NoiseFit& fit, const InstrumentNames& names) {
    if (!fit.described) return nullptr;
    Json list = Json::array();
    for (const noise::Sinusoid& line : fit.sinusoids) {
        list.push_back({{"frequency_hz", estimate(line.frequency_hz)},
                        {std::string(names.amplitude_key), estimate(line.rate_amplitude_deg_h)}});
    }
    return list;
}

/// Rows count data from 1.
Json finding_json(const findings::Finding& found, double tau0_s, std::size_t line) {
    Json json = {{"kind", findings::name_of(found.kind)},
                 {"row", found.row + 1},
                 {"line", line == 0 ? Json(nullptr) : Json(line)},
                 {"rows", found.length},
                 {"time_s", number(static_cast<double>(found.row) * tau0_s)},
                 {"size", number(found.size)},
                 {"size_sigma", found.kind == findings::Kind::wrap ? Json(nullptr) : number(found.size_sigma)}};
    if (found.kind == findings::Kind::jump) json["of"] = found.of_angle ? "angle" : "rate";
    return json;
}

Json coefficient_json(const noise::Coefficient& c, bool described) {
    if (!described || !c.resolved) return nullptr;
    return {{"value", number(c.value)}, {"lo", number(c.lo)}, {"hi", number(c.hi)}};
}

Json noise_json(const AllanOutput& out, Json& limits) {
    Json noise = Json::object();
    const InstrumentNames& names = names_of(*out.instrument);
    for (const CoefficientName& name : names.coefficients) {
        const std::string key(name.key);
        const noise::Coefficient c = times((*out.noise).*name.member, name.factor);
        noise[key] = coefficient_json(c, out.noise->described);
        limits[key] = out.noise->described && !c.resolved ? number(c.hi) : Json(nullptr);
    }
    noise["correlated"] = correlated(*out.noise, names);
    noise["sinusoidal"] = sinusoids(*out.noise, names);
    if (out.walk_unit != nullptr) {
        const noise::Coefficient c = walk_in(*out.walk_unit, *out.noise);
        noise["arw_unit"] = out.walk_unit->name;
        noise["arw"] = coefficient_json(c, out.noise->described);
    }
    return noise;
}

}  // namespace

nlohmann::ordered_json allan_object(const AllanOutput& out) {
    Json json;
    json["n"] = out.n;
    json["missing"] = out.missing;
    json["tau0_s"] = number(out.tau0_s);
    json["kind"] = out.kind;
    json["column"] = out.column;
    const std::string_view unit = out.instrument ? names_of(*out.instrument).rate_unit : "";
    json["unit"] = unit.empty() ? Json(nullptr) : Json(unit);
    json["instrument"] = out.instrument ? Json(names_of(*out.instrument).name) : Json(nullptr);
    json["confidence"] = number(out.confidence);
    json["stride"] = out.streamed ? "tau/8" : "tau0";
    json["deviations"] = Json::object();
    for (const DeviationOutput& d : out.deviations) {
        Json list = Json::array();
        for (const allan::Point& p : d.points) {
            list.push_back({{"m", p.m},
                            {"tau_s", number(p.tau_s)},
                            {"dev", number(p.dev)},
                            {"terms", p.terms},
                            {"alpha", std::isfinite(p.edf) ? Json(p.alpha) : Json(nullptr)},
                            {"bias", number(p.bias)},
                            {"edf", number(p.edf)},
                            {"lo", number(p.lo)},
                            {"hi", number(p.hi)}});
        }
        json["deviations"][std::string(allan::name(d.estimator))] = std::move(list);
    }
    json["factors_without_terms"] = Json::object();
    for (const DeviationOutput& d : out.deviations) {
        if (!d.without_terms.empty())
            json["factors_without_terms"][std::string(allan::name(d.estimator))] = d.without_terms;
    }
    json["findings"] = Json::array();
    for (std::size_t i = 0; i < out.findings.size(); ++i) {
        json["findings"].push_back(finding_json(out.findings[i], out.tau0_s, line_of(out, i)));
    }
    json["wraps_undone"] = out.wraps_undone;
    json["cleaned"] = nullptr;
    if (out.cleaned) {
        json["cleaned"] = {
            {"outliers", out.cleaned->corrected}, {"jumps", out.cleaned->jumps}, {"left_out", out.cleaned->left_out}};
    }
    // All keys are always there, null where there is nothing to say.
    json["noise"] = nullptr;
    json["noise_upper_limits_95"] = nullptr;
    if (out.noise) {
        Json limits = Json::object();
        json["noise"] = noise_json(out, limits);
        json["noise_upper_limits_95"] = std::move(limits);
    }
    json["noise_fitted_points"] = out.noise_stretch ? Json(*out.noise_stretch) : Json(nullptr);
    json["noise_filled_in"] = out.noise_filled_in ? Json(*out.noise_filled_in) : Json(nullptr);
    json["noise_fitted_every"] = out.noise_thinning ? Json(*out.noise_thinning) : Json(nullptr);
    json["jump_instead_of_random_walk"] =
        out.jump_instead_of_walk ? finding_json(*out.jump_instead_of_walk, out.tau0_s, 0) : Json(nullptr);
    json["noise_withheld"] = out.noise && !out.noise->described ? Json(out.noise->reason) : Json(nullptr);
    return json;
}

}  // namespace ringlock::allan_run
