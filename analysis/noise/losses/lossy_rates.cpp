#include "analysis/noise/losses/lossy_rates.hpp"

#include <algorithm>

namespace ringlock::noise {

std::size_t LossyRates::unknowns() const {
    std::size_t sum = 0;
    for (const Gap& gap : gaps) sum += gap.unknowns();
    return sum;
}

LossyRates LossyRates::first(std::size_t n) const {
    LossyRates out;
    out.rate.assign(rate.begin(), rate.begin() + static_cast<std::ptrdiff_t>(std::min(n, rate.size())));
    for (const Gap& gap : gaps) {
        if (gap.begin >= n) break;
        out.gaps.push_back(gap.end <= n ? gap : Gap{gap.begin, n, false});
    }
    return out;
}

LossyRates lossy_rates(const allan::Phase& phase, double tau0_s) {
    LossyRates out;
    if (phase.x.size() < 2) return out;
    out.rate.resize(phase.x.size() - 1);
    for (const allan::Stretch& s : phase.stretches) {
        for (std::size_t i = s.begin; i + 1 < s.end; ++i) out.rate[i] = (phase.x[i + 1] - phase.x[i]) / tau0_s;
    }
    for (std::size_t k = 1; k < phase.stretches.size(); ++k) {
        const std::size_t begin = phase.stretches[k - 1].end - 1;
        const std::size_t end = phase.stretches[k].begin;
        const auto length = static_cast<double>(end - begin);
        const double mean = (phase.x[end] - phase.x[begin]) / (length * tau0_s);
        // A phase without one origin begins anew in each stretch, of at least one rate.
        const double before = phase.one_origin || begin == 0 ? mean : out.rate[begin - 1];
        const double behind = phase.one_origin || end == out.rate.size() ? mean : out.rate[end];
        for (std::size_t i = begin; i < end; ++i) {
            const double share = (static_cast<double>(i - begin) + 0.5) / length;
            out.rate[i] = before + share * (behind - before);
        }
        out.gaps.push_back({begin, end, phase.one_origin});
    }
    return out;
}

}  // namespace ringlock::noise
