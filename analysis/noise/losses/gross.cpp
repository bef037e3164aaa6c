#include "analysis/noise/losses/gross.hpp"

#include <algorithm>
#include <cmath>

namespace ringlock::noise {
namespace {

/// A rate that is there, and by how much it differs from the mean of those that are there on both sides.
struct Contrast {
    std::size_t at = 0;
    double size = 0.0;
};

std::vector<Contrast> contrasts(const LossyRates& rates) {
    std::vector<std::size_t> there;
    std::size_t next = 0;
    for (const Gap& gap : rates.gaps) {
        for (; next < gap.begin; ++next) there.push_back(next);
        next = gap.end;
    }
    for (; next < rates.rate.size(); ++next) there.push_back(next);
    std::vector<Contrast> out;
    for (std::size_t k = 1; k + 1 < there.size(); ++k) {
        const double around = 0.5 * (rates.rate[there[k - 1]] + rates.rate[there[k + 1]]);
        out.push_back({there[k], std::abs(rates.rate[there[k]] - around)});
    }
    return out;
}

double median_size(std::vector<Contrast> all) {
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end(),
                     [](const Contrast& a, const Contrast& b) { return a.size < b.size; });
    return middle->size;
}

}  // namespace

LossyRates without_gross(const LossyRates& rates) {
    constexpr double most_deviations = 8.0;
    constexpr double deviations_in_median = 0.674489750196082;
    const std::vector<Contrast> all = contrasts(rates);
    if (all.empty()) return rates;
    const double most = most_deviations * median_size(all) / deviations_in_median;
    LossyRates out = rates;
    if (!(most > 0.0)) return out;
    for (const Contrast& c : all) {
        if (c.size > most) out.gaps.push_back({c.at, c.at + 1, false});
    }
    std::sort(out.gaps.begin(), out.gaps.end(), [](const Gap& a, const Gap& b) { return a.begin < b.begin; });
    return out;
}

}  // namespace ringlock::noise
