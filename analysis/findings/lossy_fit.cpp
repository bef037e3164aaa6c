#include <algorithm>
#include <utility>

#include "analysis/findings/clean_fit.hpp"
#include "analysis/findings/decided.hpp"
#include "analysis/noise/losses/fit.hpp"
#include "analysis/noise/losses/gross.hpp"

namespace ringlock::findings {
namespace {

/// Whether the fault is one of a value that was filled in. The angle before the first rate of a gap is there.
bool in_gap(const Finding& found, const noise::LossyRates& rates, bool of_angles) {
    if (found.kind != Kind::outlier) return false;
    return std::any_of(rates.gaps.begin(), rates.gaps.end(), [&](const noise::Gap& gap) {
        return gap.begin + (of_angles ? 1 : 0) <= found.row && found.row < gap.end;
    });
}

/// Rates that are there take the place of those that were filled in for them.
void put_back(const noise::LossyRates& rates, std::vector<double>& completed) {
    std::size_t next = 0;
    for (const noise::Gap& gap : rates.gaps) {
        for (; next < gap.begin; ++next) completed[next] = rates.rate[next];
        next = gap.end;
    }
    for (; next < rates.rate.size(); ++next) completed[next] = rates.rate[next];
}

}  // namespace

CleanFit fit_without_events(noise::LossyRates rates, double tau0_s, bool of_angles, const SearchOptions& options) {
    const noise::LossyRates usual = noise::without_gross(rates);
    noise::CompletedFit completed = noise::fit_and_complete(usual, tau0_s);
    if (completed.given_up) return {{}, std::move(completed.fit), {}, true};
    put_back(rates, completed.rate);
    CleanFit out{search_rates(completed.rate, of_angles, options), {}, {}};
    auto& found = out.searched.findings;
    const bool any = std::any_of(found.begin(), found.end(), [](const Finding& f) { return f.kind != Kind::variance; });
    std::erase_if(found, [&](const Finding& f) { return in_gap(f, rates, of_angles); });
    if (any || usual.gaps.size() != rates.gaps.size()) {
        for (std::size_t i = 0; i < rates.rate.size(); ++i) rates.rate[i] += out.searched.rate[i] - completed.rate[i];
        completed = noise::fit_and_complete(rates, tau0_s);
        if (completed.given_up) return {{}, std::move(completed.fit), {}, true};
    }
    out.noise = std::move(completed.fit);
    decide(completed.rate, options, out);
    return out;
}

}  // namespace ringlock::findings
