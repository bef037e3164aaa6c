#include "analysis/closure/turns/screen/miscounts.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/count_chain.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

CountedQuarters counted_quarters(const record::Turns& turns, const JoinedPhase& joined) {
    CountedQuarters counted{.off = {}, .sd = {}, .direction = turns.direction};
    for (std::size_t i = 0; i < turns.size(); ++i) {
        const auto middle = static_cast<double>(turns.quarter_count[i] % 4) + 0.5;
        const double of_noise = joined.readout.empty() ? 1.0 : std::sqrt(joined.readout[i]);
        counted.off.push_back(joined.phase_rad[i] / units::quarter_fringe_rad - middle);
        counted.sd.push_back(joined.readout_sd_rad * of_noise / units::quarter_fringe_rad);
    }
    return counted;
}

}  // namespace

MissedShare share_of_missed_counts(const record::Turns& turns, const JoinedPhase& joined, const Rows& rows) {
    const auto n = static_cast<double>(std::count(rows.begin(), rows.end(), 1));
    const double missed = std::max(1.0, static_cast<double>(joined.miscounted.size()));
    const double begun =
        std::min(options.turns.reading.most_miscounts_per_turn, missed / static_cast<double>(turns.size()));
    MissedShare share;
    double likeliest = 0.0;
    bool first = true;
    const CountedQuarters counted = counted_quarters(turns, joined);
    for (const double edge : options.stats.count_chain.edge_sds) {
        CountChain chain(counted, edge);
        constexpr double enough = 1e-6;
        double p = begun;
        double log_likelihood = 0.0;
        for (int k = 0; k < options.turns.miscounts.most_passes; ++k) {
            const CountChain::Pass pass = chain.pass(p, rows);
            const double next = std::clamp(pass.steps / n, 1e-9, 1.0 - 1e-9);
            const bool there = std::abs(next - p) < enough * p;
            log_likelihood = pass.log_likelihood;
            p = next;
            if (there) break;
        }
        if (!first && log_likelihood <= likeliest) continue;
        first = false;
        likeliest = log_likelihood;
        // Information from the curvature of the likelihood of all turns.
        const double h = 0.01 * p * (1.0 - p);
        const double bend =
            (2.0 * chain.log_likelihood(p) - chain.log_likelihood(p - h) - chain.log_likelihood(p + h)) / (h * h);
        const double of_rows = bend * n / static_cast<double>(turns.size());
        share.probability_per_turn = p;
        // Without curvature, the error of a binomial probability.
        share.sd = of_rows > 0.0 ? 1.0 / std::sqrt(of_rows) : std::sqrt(p * (1.0 - p) / n);
    }
    return share;
}

}  // namespace ringlock::closure
