#include "app/allan/output/allan_output.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "analysis/noise/losses/fit.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

using Json = nlohmann::ordered_json;

Json number(double v) { return std::isfinite(v) ? Json(v) : Json(nullptr); }
Json number(const std::optional<double>& v) { return v ? number(*v) : Json(nullptr); }
Json estimate(const noise::Estimate& e) {
    return {{"value", number(e.value)}, {"lo", number(e.lo)}, {"hi", number(e.hi)}};
}

noise::Estimate times(const noise::Estimate& e, double factor) {
    return {factor * e.value, factor * e.lo, factor * e.hi};
}

noise::Coefficient times(noise::Coefficient c, double factor) {
    for (std::optional<double>* v : {&c.value, &c.lo, &c.hi}) {
        if (*v) **v *= factor;
    }
    return c;
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

/// The random walk of the fit in the unit that was asked for.
noise::Coefficient walk_in(const WalkUnit& unit, const noise::NoiseFit& fit) {
    for (const CoefficientName& name : names_of(unit.instrument).coefficients) {
        if (name.member == &noise::NoiseFit::arw_deg_rt_h) {
            return times(fit.arw_deg_rt_h, name.factor * unit.factor);
        }
    }
    return {};
}

/// Line of the file of finding `i`; 0 where it has none.
std::size_t line_of(const AllanOutput& out, std::size_t i) {
    return i < out.finding_lines.size() ? out.finding_lines[i] : 0;
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

std::string coefficient_line(std::string_view name, const noise::Coefficient& c, std::string_view unit) {
    if (c.resolved) {
        return fmt::format("  {:<22} {:>11.5g}  ({:.5g} to {:.5g}) {}\n", name, *c.value, *c.lo, *c.hi, unit);
    }
    if (c.hi) return fmt::format("  {:<22} not resolved, < {:.3g} {}\n", name, *c.hi, unit);
    return fmt::format("  {:<22} not resolved\n", name);
}

std::string estimate_line(std::string_view name, const noise::Estimate& e, std::string_view unit) {
    return fmt::format("  {:<22} {:>11.5g}  ({:.5g} to {:.5g}) {}\n", name, e.value, e.lo, e.hi, unit);
}

std::string finding_line(const findings::Finding& found, const AllanOutput& out, std::size_t line) {
    const std::string place =
        line == 0 ? fmt::format("row {}", found.row + 1) : fmt::format("row {} (line {})", found.row + 1, line);
    const std::string row = fmt::format("  {:<22} {:<9}", place, findings::name_of(found.kind));
    switch (found.kind) {
        case findings::Kind::outlier:
            return fmt::format("{} off by {:.4g} {}, {:.3g} standard errors\n", row, found.size, out.input_unit,
                               found.size_sigma);
        case findings::Kind::jump: {
            const std::string per = !found.of_angle && out.kind == "phase" ? "/s" : "";
            return fmt::format("{} of the {} by {:.4g} {}{} at {:.6g} s, {:.3g} standard errors\n", row,
                               found.of_angle ? "angle" : "rate", found.size, out.input_unit, per,
                               static_cast<double>(found.row) * out.tau0_s, found.size_sigma);
        }
        case findings::Kind::variance:
            return fmt::format("{} of {} data is {:.3g} times that of the rest\n", row, found.length, found.size);
        case findings::Kind::wrap:
            return fmt::format("{} by {:.10g} {}\n", row, found.size, out.input_unit);
        case findings::Kind::repeated:
            return fmt::format("{} {} times {:.6g}\n", row, found.length, found.size);
        case findings::Kind::clipped:
            break;
    }
    return fmt::format("{} {} data at {:.6g}, an end of their range\n", row, found.length, found.size);
}

/// What the record has beside noise, the first of each kind where there are many.
std::string findings_text(const AllanOutput& out) {
    if (out.findings.empty()) return "";
    constexpr std::size_t most = 20;
    std::string text = "\nFound in the data (rows counted from 1; missing data count):\n";
    for (std::size_t i = 0; i < std::min(most, out.findings.size()); ++i) {
        text += finding_line(out.findings[i], out, line_of(out, i));
    }
    if (out.findings.size() > most) text += fmt::format("  and {} more\n", out.findings.size() - most);
    if (out.cleaned) {
        return text + fmt::format(
                          "Deviations and coefficients are of the data without {} outliers and {} jumps, which are "
                          "taken off by their sizes, and without {} data of disturbed stretches.\n",
                          out.cleaned->corrected, out.cleaned->jumps, out.cleaned->left_out);
    }
    const bool estimated = out.noise && out.noise->described;
    text += fmt::format("The deviations are of the data as they are{}{}.\n",
                        out.wraps_undone > 0 ? fmt::format(" with {} wraps undone", out.wraps_undone) : "",
                        estimated ? ", the coefficients of them without outliers, jumps and wraps" : "");
    return text;
}

/// The coefficients, or why they are withheld.
std::string noise_text(const AllanOutput& out) {
    const InstrumentNames& names = names_of(*out.instrument);
    std::string text;
    if (out.noise_filled_in) {
        text += fmt::format("\nCoefficients from all {} data; the {} that are missing are allowed for.\n",
                            *out.noise_stretch, *out.noise_filled_in);
    } else if (out.noise_stretch) {
        text += fmt::format(
            "\nCoefficients from the longest part without gaps, {} points: a record with gaps is not fitted as a whole "
            "where it has more than {} intervals, less than a quarter of its data, or gaps that take too long.\n",
            *out.noise_stretch, noise::most_lossy_rates);
    }
    if (out.noise_thinning) {
        text += fmt::format("\nCoefficients from every {}th point, which was kept.\n", *out.noise_thinning);
    }
    if (!out.noise->described) {
        return text + fmt::format(
                          "\nNoise coefficients withheld: {}.\nQ, N, B, K and R would not describe this record; find "
                          "and remove the cause before quoting any.\n",
                          out.noise->reason);
    }
    text += fmt::format("\nNoise coefficients of the {} (68.27 % interval; limits 95 %)\n", names.name);
    for (const CoefficientName& name : names.coefficients) {
        text += coefficient_line(name.name, times((*out.noise).*name.member, name.factor), name.unit);
        if (out.walk_unit != nullptr && name.member == &noise::NoiseFit::arw_deg_rt_h) {
            text += coefficient_line("", walk_in(*out.walk_unit, *out.noise), out.walk_unit->name);
        }
    }
    if (out.jump_instead_of_walk) {
        text += "    a jump explains the record as well as a random walk of the rate does:\n" +
                finding_line(*out.jump_instead_of_walk, out, 0);
    }
    if (out.noise->correlated) {
        const noise::Estimate driving = times(out.noise->correlated->amplitude_deg_h_rt_h, names.driving_factor);
        text += estimate_line("correlated noise q_c", driving, names.driving_unit);
        text += estimate_line("  correlation time", out.noise->correlated->correlation_time_s, "s");
        text += estimate_line("  rms", out.noise->correlated->rms_rate_deg_h, names.rate_unit);
    }
    for (const noise::Sinusoid& line : out.noise->sinusoids) {
        text += estimate_line("sinusoid", line.rate_amplitude_deg_h, names.rate_unit);
        const noise::Estimate& f = line.frequency_hz;
        text += fmt::format("  {:<22} {:>11.8g}  ({:.8g} to {:.8g}) Hz\n", "  frequency", f.value, f.lo, f.hi);
    }
    return text;
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

std::string allan_text(const AllanOutput& out) {
    std::string text =
        fmt::format("{}, column {}: {} data ({}{}{}), tau0 = {:.6g} s\n", printable(out.data), printable(out.column),
                    out.n, out.kind, out.input_unit.empty() ? "" : ", ", out.input_unit, out.tau0_s);
    if (out.missing > 0) {
        text += fmt::format("{} data are missing: terms that need them are left out\n", out.missing);
    }
    if (out.streamed) text += "no record kept: sums with a stride of tau/8\n";
    for (const auto& [estimator, points, without_terms] : out.deviations) {
        const allan::Traits& t = allan::traits(estimator);
        std::string unit;
        if (out.instrument) {
            const InstrumentNames& names = names_of(*out.instrument);
            unit = t.time ? names.integral_unit : names.rate_unit;
            if (!unit.empty()) unit = fmt::format(" [{}]", unit);
        }
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
    text += findings_text(out);
    return text + (out.noise ? noise_text(out) : "\nNo noise coefficients: say the unit of the data with --unit.\n");
}

}  // namespace ringlock::app
