#include "analysis/allan_run/search_and_fit.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "analysis/findings/clean_fit.hpp"
#include "analysis/findings/values.hpp"
#include "analysis/noise/losses/fit.hpp"
#include "analysis/noise/losses/lossy_rates.hpp"

namespace ringlock::allan_run {
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

/// The search and the fit of a record, and the row of its first rate.
struct Fitted {
    findings::CleanFit fit;
    std::size_t first_row = 0;
};

/// Of all data, or of the longest part without gaps where the record is too long or too empty for that.
Fitted fit_of(const allan::Phase& phase, allan::Kind kind, AllanOutput& out) {
    const bool of_angles = kind == allan::Kind::phase;
    if (!phase.whole()) {
        noise::LossyRates rates = noise::lossy_rates(phase, out.tau0_s);
        if (noise::fitted_as_a_whole(rates)) {
            findings::CleanFit fit = findings::fit_without_events(std::move(rates), out.tau0_s, of_angles);
            if (!fit.given_up) {
                out.noise_stretch = out.n;
                out.noise_filled_in = out.missing;
                return {std::move(fit), 0};
            }
        }
    }
    const allan::Stretch& stretch = longest_of(phase);
    const std::span<const double> angle = std::span(phase.x).subspan(stretch.begin, stretch.size());
    if (!phase.whole()) out.noise_stretch = stretch.size();
    return {findings::fit_without_events(angle, out.tau0_s, of_angles), stretch.begin};
}

}  // namespace

void search_and_fit(std::vector<double> values, const allan::Phase& phase, allan::Kind kind, double scale,
                    AllanOutput& out) {
    for (const Finding& found : findings::search_values(values)) out.findings.push_back(found);
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
    Fitted fitted = fit_of(*clean, kind, out);
    const auto shown = [&](const Finding& found) {
        return in_data(found, lead + fitted.first_row, kind, scale, out.tau0_s);
    };
    out.noise = std::move(fitted.fit.noise);
    for (const Finding& found : fitted.fit.searched.findings) out.findings.push_back(shown(found));
    if (fitted.fit.instead_of_walk) out.jump_instead_of_walk = shown(*fitted.fit.instead_of_walk);
    std::stable_sort(out.findings.begin(), out.findings.end(),
                     [](const Finding& a, const Finding& b) { return a.row < b.row; });
}

}  // namespace ringlock::allan_run
