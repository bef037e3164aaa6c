#include "app/allan/output/allan_output.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "analysis/noise/losses/fit.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {

using allan_run::times;
using allan_run::walk_in;

namespace {

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
        case findings::Kind::gap:
            return fmt::format("{} of {} data from {:.6g} s on\n", row, found.length,
                               static_cast<double>(found.row) * out.tau0_s);
        case findings::Kind::clipped:
            break;
    }
    return fmt::format("{} {} data at {:.6g}, an end of their range\n", row, found.length, found.size);
}

/// Faults of the record other than noise, the first of each kind where there are many.
std::string findings_text(const AllanOutput& out) {
    if (out.findings.empty()) return "";
    constexpr std::size_t most = 20;
    std::string text = "\nFound in the data (rows counted from 1; missing data count):\n";
    std::vector<std::size_t> shown = findings::listed(out.findings);
    shown.resize(std::min(most, shown.size()));
    for (const std::size_t i : shown) text += finding_line(out.findings[i], out, allan_run::line_of(out, i));
    if (out.findings.size() > most) text += fmt::format("  and {} more\n", out.findings.size() - most);
    if (out.cleaned) {
        return text + fmt::format("Deviations and coefficients are of {}.\n", findings::data_of(*out.cleaned));
    }
    const std::string without = findings::estimated_without(out.findings);
    const bool estimated = out.noise && out.noise->described && !without.empty();
    text += fmt::format("The deviations are of the data as they are{}{}.\n",
                        out.wraps_undone > 0 ? fmt::format(" with {} wraps undone", out.wraps_undone) : "",
                        estimated ? fmt::format(", the coefficients of them without {}", without) : "");
    return text;
}

/// The coefficients, or why they are withheld.
std::string noise_text(const AllanOutput& out) {
    const InstrumentNames& names = names_of(*out.instrument);
    std::string text;
    if (out.noise_filled_in) {
        if (out.noise->described) {
            const char* others = "";
            if (*out.noise_filled_in > out.missing) others = out.cleaned ? " or left out" : " or repeat a value";
            text += fmt::format("\nCoefficients from all {} data; the {} that are missing{} are allowed for.\n",
                                *out.noise_stretch, *out.noise_filled_in, others);
        }
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
        const bool stretches = std::any_of(out.findings.begin(), out.findings.end(), [](const findings::Finding& f) {
            return f.kind == findings::Kind::variance;
        });
        return text + fmt::format(
                          "\nNoise coefficients withheld: {}.\nQ, N, B, K and R would not describe this record; find "
                          "and remove the cause before quoting any.\n{}",
                          out.noise->reason,
                          stretches && !out.cleaned ? "--clean analyses the rest without these stretches.\n" : "");
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
        text += fmt::format("\n{:>8} {:>11} {:>16} {:>23} {:>9} {:>9}  {}\n", "m", "tau [s]",
                            fmt::format("{}{}", t.name, unit), interval, "edf", "terms", "noise");
        for (const allan::Point& p : points) {
            text +=
                fmt::format("{:>8} {:>11.6g} {:>16.6e} {:>11} {:>11} {:>9} {:>9}  {}\n", p.m, p.tau_s, p.dev,
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
