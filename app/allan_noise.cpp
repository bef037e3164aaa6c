#include "app/allan_noise.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "analysis/findings/search.hpp"
#include "analysis/findings/values.hpp"
#include "analysis/noise/fit.hpp"

namespace ringlock::app {
namespace {

using findings::Finding;

const allan::Stretch& longest_of(const allan::Phase& phase) {
    return *std::max_element(phase.stretches.begin(), phase.stretches.end(),
                             [](const allan::Stretch& l, const allan::Stretch& r) { return l.size() < r.size(); });
}

/// Sizes in the unit of the data, rows of the data: the search was made in rates of the phase.
Finding in_data(Finding found, std::size_t first_row, allan::Kind kind, double scale, double tau0_s) {
    found.row += first_row;
    if (kind == allan::Kind::phase && found.kind != findings::Kind::outlier) found.row += 1;
    if (found.kind == findings::Kind::variance) return found;
    found.size /= scale;
    const bool in_rates = kind == allan::Kind::rate ||
                          (kind == allan::Kind::phase && !found.of_angle && found.kind == findings::Kind::jump);
    if (!in_rates) found.size *= tau0_s;
    return found;
}

/// Whether coefficients would describe the noise that the record has elsewhere.
std::string withheld_because_of(const findings::Searched& searched) {
    if (!searched.ended) {
        return fmt::format("{} outliers and jumps were found and the search was given up", searched.findings.size());
    }
    const auto stretches = std::count_if(searched.findings.begin(), searched.findings.end(),
                                         [](const Finding& f) { return f.kind == findings::Kind::variance; });
    if (stretches > 0) {
        return fmt::format("the noise of {} stretch{} is of another size than that of the rest", stretches,
                           stretches == 1 ? "" : "es");
    }
    return "";
}

}  // namespace

void search_and_fit(std::vector<double> values, const allan::Phase& phase, allan::Kind kind, double scale,
                    AllanOutput& out) {
    out.findings = findings::search_values(values);
    const allan::Phase* clean = &phase;
    allan::Phase unwrapped;
    if (const auto wraps = findings::find_wraps(values)) {
        for (const std::size_t at : wraps->at) {
            out.findings.push_back({.kind = findings::Kind::wrap, .row = at, .size = wraps->modulus});
        }
        findings::unwrap(*wraps, values);
        unwrapped = allan::phase_of(values, kind, out.tau0_s, scale);
        clean = &unwrapped;
    }
    // A phase begins with the first value that is there.
    const auto there = std::find_if(values.begin(), values.end(), [](double v) { return !std::isnan(v); });
    const auto lead = static_cast<std::size_t>(there - values.begin());
    values = {};
    const allan::Stretch& stretch = longest_of(*clean);
    const std::span<const double> angle = std::span(clean->x).subspan(stretch.begin, stretch.size());
    if (!clean->whole()) out.noise_stretch = stretch.size();
    std::vector<double> rate;
    for (std::size_t i = 1; i < angle.size(); ++i) rate.push_back((angle[i] - angle[i - 1]) / out.tau0_s);
    findings::Searched searched = findings::search_rates(rate, kind == allan::Kind::phase);
    rate = {};
    std::vector<double> cleaned{0.0};
    for (const double r : searched.rate) cleaned.push_back(cleaned.back() + r * out.tau0_s);
    const bool any = std::any_of(searched.findings.begin(), searched.findings.end(),
                                 [](const Finding& f) { return f.kind != findings::Kind::variance; });
    out.noise = any ? noise::fit_noise(cleaned, out.tau0_s) : noise::fit_noise(angle, out.tau0_s);
    const std::string why = withheld_because_of(searched);
    if (!why.empty()) {
        out.noise->described = false;
        out.noise->reason = why;
    }
    for (const Finding& found : searched.findings) {
        out.findings.push_back(in_data(found, lead + stretch.begin, kind, scale, out.tau0_s));
    }
    std::stable_sort(out.findings.begin(), out.findings.end(),
                     [](const Finding& a, const Finding& b) { return a.row < b.row; });
}

}  // namespace ringlock::app
