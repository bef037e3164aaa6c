#include "app/allan_output.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

namespace ringlock::app {
namespace {

using Json = nlohmann::ordered_json;

Json number(double v) { return std::isfinite(v) ? Json(v) : Json(nullptr); }
Json number(const std::optional<double>& v) { return v ? number(*v) : Json(nullptr); }
Json estimate(const noise::Estimate& e) {
    return {{"value", number(e.value)}, {"lo", number(e.lo)}, {"hi", number(e.hi)}};
}

Json correlated(const noise::NoiseFit& fit) {
    if (!fit.described || !fit.correlated) return nullptr;
    return {{"correlation_time_s", estimate(fit.correlated->correlation_time_s)},
            {"amplitude_deg_h_rt_h", estimate(fit.correlated->amplitude_deg_h_rt_h)},
            {"rms_rate_deg_h", estimate(fit.correlated->rms_rate_deg_h)}};
}

Json sinusoids(const noise::NoiseFit& fit) {
    if (!fit.described) return nullptr;
    Json list = Json::array();
    for (const noise::Sinusoid& line : fit.sinusoids) {
        list.push_back({{"frequency_hz", estimate(line.frequency_hz)},
                        {"rate_amplitude_deg_h", estimate(line.rate_amplitude_deg_h)}});
    }
    return list;
}

struct Line {
    std::string_view key;
    std::string_view name;
    std::string_view unit;
    noise::Coefficient noise::NoiseFit::*member;
};

constexpr std::array<Line, 5> table_lines = {{
    {"quantization_arcsec", "angle white noise Q", "arcsec", &noise::NoiseFit::quantization_arcsec},
    {"arw_deg_rt_h", "angle random walk N", "deg/sqrt(h)", &noise::NoiseFit::arw_deg_rt_h},
    {"bias_instability_deg_h", "bias instability B", "deg/h", &noise::NoiseFit::bias_instability_deg_h},
    {"rrw_deg_h_rt_h", "rate random walk K", "(deg/h)/sqrt(h)", &noise::NoiseFit::rrw_deg_h_rt_h},
    {"rate_ramp_deg_h_h", "rate ramp R", "(deg/h)/h", &noise::NoiseFit::rate_ramp_deg_h_h},
}};

std::string_view noise_name(int alpha) {
    switch (alpha) {
        case 2:
            return "white phase";
        case 1:
            return "flicker phase";
        case 0:
            return "white rate";
        case -1:
            return "flicker rate";
        case -2:
            return "random walk rate";
        case -3:
            return "flicker walk rate";
        default:
            return "random run rate";
    }
}

/// A number in scientific notation, or a dash where there is none.
std::string shown(double v, int digits) { return std::isfinite(v) ? fmt::format("{:.{}e}", v, digits) : "-"; }

}  // namespace

std::string allan_json(const AllanOutput& out) {
    Json json;
    json["n"] = out.n;
    json["missing"] = out.missing;
    json["tau0_s"] = number(out.tau0_s);
    json["kind"] = out.kind;
    json["column"] = out.column;
    json["unit"] = out.gyro ? Json("deg/h") : Json(nullptr);
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
    json["noise"] = nullptr;
    if (out.noise) {
        Json noise = Json::object();
        Json limits = Json::object();
        for (const Line& line : table_lines) {
            const noise::Coefficient& c = (*out.noise).*line.member;
            const bool shown = out.noise->described && c.resolved;
            noise[line.key] =
                shown ? Json({{"value", number(c.value)}, {"lo", number(c.lo)}, {"hi", number(c.hi)}}) : Json(nullptr);
            limits[line.key] = out.noise->described && !c.resolved ? number(c.hi) : Json(nullptr);
        }
        noise["correlated"] = correlated(*out.noise);
        noise["sinusoidal"] = sinusoids(*out.noise);
        json["noise"] = std::move(noise);
        json["noise_upper_limits_95"] = std::move(limits);
        json["noise_fitted_points"] = out.noise_stretch ? Json(*out.noise_stretch) : Json(nullptr);
        json["noise_fitted_every"] = out.noise_thinning ? Json(*out.noise_thinning) : Json(nullptr);
        json["noise_withheld"] = out.noise->described ? Json(nullptr) : Json(out.noise->reason);
    }
    return json.dump() + "\n";
}

std::string allan_text(const AllanOutput& out) {
    std::string text = fmt::format("{}, column {}: {} data ({}{}{}), tau0 = {:.6g} s\n", out.data, out.column, out.n,
                                   out.kind, out.input_unit.empty() ? "" : ", ", out.input_unit, out.tau0_s);
    if (out.missing > 0) {
        text += fmt::format("{} data are missing: terms that need them are left out\n", out.missing);
    }
    if (out.streamed) text += "no record kept: sums with a stride of tau/8\n";
    for (const auto& [estimator, points, without_terms] : out.deviations) {
        const allan::Traits& t = allan::traits(estimator);
        const std::string_view unit = !out.gyro ? "" : t.time ? " [arcsec]" : " [deg/h]";
        const std::string interval =
            t.has_interval ? fmt::format("{:.4g} % interval", 100.0 * out.confidence) : "no interval";
        text += fmt::format("\n{:>9} {:>12} {:>17} {:>27} {:>10} {:>10}  {}\n", "m", "tau [s]",
                            fmt::format("{}{}", t.name, unit), interval, "edf", "terms", "noise");
        for (const allan::Point& p : points) {
            text +=
                fmt::format("{:>9} {:>12.6g} {:>17.6e} {:>13} {:>13} {:>10} {:>10}  {}\n", p.m, p.tau_s, p.dev,
                            shown(p.lo, 5), shown(p.hi, 5), std::isfinite(p.edf) ? fmt::format("{:.4g}", p.edf) : "-",
                            p.terms, t.has_interval ? noise_name(p.alpha) : "");
        }
        if (!without_terms.empty()) {
            text += fmt::format("gaps leave no term to m = {}\n", fmt::join(without_terms, ", "));
        } else if (points.empty()) {
            text += "the record is too short for a term\n";
        }
    }
    if (!out.noise) {
        text += "\nNo gyro coefficients: say the unit of the data with --unit to have them.\n";
        return text;
    }
    if (out.noise_stretch) {
        text += fmt::format("\nCoefficients from the longest part without gaps, {} points.\n", *out.noise_stretch);
    }
    if (out.noise_thinning) {
        text += fmt::format("\nCoefficients from every {}th point, which was kept.\n", *out.noise_thinning);
    }
    if (!out.noise->described) {
        text += fmt::format(
            "\nGyro coefficients withheld: {}.\nQ, N, B, K and R would not describe this record; find and remove the "
            "cause "
            "before quoting any.\n",
            out.noise->reason);
        return text;
    }
    text += "\nGyro coefficients (68.27 % interval; limits 95 %)\n";
    for (const Line& line : table_lines) {
        const noise::Coefficient& c = (*out.noise).*line.member;
        if (c.resolved) {
            text += fmt::format("  {:<20} {:>11.5g}  ({:.5g} to {:.5g}) {}\n", line.name, *c.value, *c.lo, *c.hi,
                                line.unit);
        } else if (c.hi) {
            text += fmt::format("  {:<20} not resolved, < {:.3g} {}\n", line.name, *c.hi, line.unit);
        } else {
            text += fmt::format("  {:<20} not resolved\n", line.name);
        }
    }
    const auto add = [&](const std::string& name, const noise::Estimate& e, const char* unit) {
        text += fmt::format("  {:<20} {:>11.5g}  ({:.5g} to {:.5g}) {}\n", name, e.value, e.lo, e.hi, unit);
    };
    if (out.noise->correlated) {
        add("correlated noise q_c", out.noise->correlated->amplitude_deg_h_rt_h, "(deg/h)/sqrt(h)");
        add("  correlation time", out.noise->correlated->correlation_time_s, "s");
        add("  rms rate", out.noise->correlated->rms_rate_deg_h, "deg/h");
    }
    for (const noise::Sinusoid& line : out.noise->sinusoids) {
        add("sinusoidal rate", line.rate_amplitude_deg_h, "deg/h");
        const noise::Estimate& f = line.frequency_hz;
        text += fmt::format("  {:<20} {:>11.8g}  ({:.8g} to {:.8g}) Hz\n", "  frequency", f.value, f.lo, f.hi);
    }
    return text;
}

}  // namespace ringlock::app
