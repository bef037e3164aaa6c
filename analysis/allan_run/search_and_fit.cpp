#include "analysis/allan_run/search_and_fit.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>

#include "analysis/findings/clean_fit.hpp"
#include "analysis/findings/cleaned.hpp"
#include "analysis/findings/clipping.hpp"
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

/// Makes the data that only repeat the one before them missing; returns how many that are. None where they are more
/// than half of all: there is no record without them.
std::size_t leave_out_repeated(const std::vector<Finding>& found, allan::Kind kind, double tau0_s,
                               std::vector<double>& values) {
    std::vector<Finding> repeated;
    std::copy_if(found.begin(), found.end(), std::back_inserter(repeated),
                 [](const Finding& f) { return f.kind == findings::Kind::repeated; });
    std::size_t held = 0;
    for (const Finding& f : repeated) held += f.length - 1;
    if (2 * held > values.size()) return 0;
    return findings::clean(repeated, kind, tau0_s, values).left_out;
}

/// Of all data, or of the longest part without gaps where the record is too long or too empty for that.
/// \param held  data that are missing from the phase because they repeat a value
Fitted fit_of(const allan::Phase& phase, allan::Kind kind, std::size_t held, AllanOutput& out) {
    const bool of_angles = kind == allan::Kind::phase;
    const auto of_all_data = [&] {
        out.noise_stretch = out.n - held;
        out.noise_filled_in = out.missing + held;
    };
    if (!phase.whole()) {
        noise::LossyRates rates = noise::lossy_rates(phase, out.tau0_s);
        if (noise::fitted_as_a_whole(rates)) {
            findings::CleanFit fit = findings::fit_without_events(std::move(rates), out.tau0_s, of_angles);
            if (!fit.given_up) {
                of_all_data();
                return {std::move(fit), 0};
            }
        }
    }
    const allan::Stretch& stretch = longest_of(phase);
    const std::span<const double> angle = std::span(phase.x).subspan(stretch.begin, stretch.size());
    if (!phase.whole()) {
        out.noise_stretch = stretch.size();
    } else if (held > 0) {
        of_all_data();  // the repeats are at an end of the record
    }
    return {findings::fit_without_events(angle, out.tau0_s, of_angles), stretch.begin};
}

}  // namespace

void search_and_fit(std::vector<double> values, std::span<const std::int64_t> counts, const allan::Phase& phase,
                    allan::Kind kind, double scale, AllanOutput& out) {
    const std::vector<Finding> of_values = findings::search_values(values);
    out.findings.insert(out.findings.end(), of_values.begin(), of_values.end());
    const std::size_t held = leave_out_repeated(of_values, kind, out.tau0_s, values);
    const std::string clipped = findings::why_clipping_withholds(of_values, kind, values);
    const allan::Phase* clean = &phase;
    allan::Phase changed;
    if (held > 0) {
        changed = counts.empty() ? allan::phase_of(values, kind, out.tau0_s, scale)
                                 : allan::phase_of(counts, values, kind, out.tau0_s, scale);
        clean = &changed;
    }
    if (const auto wraps = findings::find_wraps(values)) {
        for (const std::size_t at : wraps->at) {
            out.findings.push_back({.kind = findings::Kind::wrap, .row = at, .size = wraps->modulus});
        }
        findings::unwrap(*wraps, values);
        changed = allan::phase_of(values, kind, out.tau0_s, scale);
        clean = &changed;
    }
    // A phase begins with the first value that is there.
    const auto there = std::find_if(values.begin(), values.end(), [](double v) { return !std::isnan(v); });
    const auto lead = static_cast<std::size_t>(there - values.begin());
    values = {};
    Fitted fitted = fit_of(*clean, kind, held, out);
    const auto shown = [&](const Finding& found) {
        return in_data(found, lead + fitted.first_row, kind, scale, out.tau0_s);
    };
    out.noise = std::move(fitted.fit.noise);
    if (!clipped.empty()) {
        out.noise->reason = out.noise->described ? clipped : clipped + "; " + out.noise->reason;
        out.noise->described = false;
    }
    for (const Finding& found : fitted.fit.searched.findings) out.findings.push_back(shown(found));
    if (fitted.fit.instead_of_walk) out.jump_instead_of_walk = shown(*fitted.fit.instead_of_walk);
    std::stable_sort(out.findings.begin(), out.findings.end(),
                     [](const Finding& a, const Finding& b) { return a.row < b.row; });
}

}  // namespace ringlock::allan_run
