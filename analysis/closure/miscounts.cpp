#include "analysis/closure/miscounts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "engine/core/interrupt.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

constexpr int quarters = 4;
using Chances = std::array<double, quarters>;

/// The chain, its likelihood and where it steps.
class Chain {
   public:
    /// \param edge  standard deviation, in quarters, of where the counter sees the edge of a quarter, beside what the
    ///              quadrature's noise makes of it
    Chain(const record::Turns& turns, const JoinedPhase& joined, double edge) {
        const double quarter_rad = 0.5 * units::pi;
        const std::size_t n = turns.size();
        seen_.resize(n);
        step_.resize(n);
        for (std::size_t i = 0; i < n; ++i) {
            const double of_noise = joined.readout.empty() ? 1.0 : std::sqrt(joined.readout[i]);
            const double sd = std::hypot(edge, joined.readout_sd_rad * of_noise / quarter_rad);
            const double off =
                joined.phase_rad[i] / quarter_rad - (static_cast<double>(turns.quarter_count[i] % quarters) + 0.5);
            for (int lost = 0; lost < quarters; ++lost) {
                double x = off - lost;
                x -= quarters * std::round(x / quarters);
                // However far off it is: something else has happened, and the chain goes on.
                constexpr double never = 1e-12;
                seen_[i][static_cast<std::size_t>(lost)] = std::max(never, inside(x, sd));
            }
            // Down to a minimum the count stays too high by what it misses.
            step_[i] = turns.direction[i] > 0 ? quarters - 1 : 1;
        }
    }

    struct Pass {
        double log_likelihood = 0.0;
        double steps = 0.0;  ///< expected number of them at the rows that count
    };

    double log_likelihood(double p) { return forward(p); }

    Pass pass(double p, const Rows& rows) {
        Pass pass{forward(p), 0.0};
        Chances after{1.0, 1.0, 1.0, 1.0};  // of all that is seen later, scaled
        for (std::size_t i = seen_.size(); i-- > 1;) {
            double all = 0.0;
            double stepped = 0.0;
            Chances before{};
            for (std::size_t to = 0; to < quarters; ++to) {
                const double later = seen_[i][to] * after[to];
                const std::size_t from = (to + quarters - step_[i]) % quarters;
                all += (1.0 - p) * forward_[i - 1][to] * later + p * forward_[i - 1][from] * later;
                stepped += p * forward_[i - 1][from] * later;
                before[to] += (1.0 - p) * later;
                before[from] += p * later;
            }
            if (rows[i]) pass.steps += stepped / all;
            const double scale = *std::max_element(before.begin(), before.end());
            for (std::size_t k = 0; k < quarters; ++k) after[k] = before[k] / scale;
        }
        return pass;
    }

   private:
    static double below(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }
    /// Probability that what is read at x, from the middle of a quarter, is in that quarter.
    static double inside(double x, double sd) { return below((0.5 - x) / sd) - below((-0.5 - x) / sd); }

    double forward(double p) {
        check_interrupt();
        forward_.resize(seen_.size());
        double log_likelihood = 0.0;
        Chances now{};
        for (std::size_t i = 0; i < seen_.size(); ++i) {
            Chances next{};
            double sum = 0.0;
            for (std::size_t to = 0; to < quarters; ++to) {
                const std::size_t from = (to + quarters - step_[i]) % quarters;
                const double foretold = i == 0 ? 1.0 / quarters : (1.0 - p) * now[to] + p * now[from];
                next[to] = foretold * seen_[i][to];
                sum += next[to];
            }
            for (double& chance : next) chance /= sum;
            log_likelihood += std::log(sum);
            now = forward_[i] = next;
        }
        return log_likelihood;
    }

    std::vector<Chances> seen_;  ///< how likely what is seen is with so many lost
    std::vector<std::size_t> step_;
    std::vector<Chances> forward_;
};

}  // namespace

MissedShare share_of_missed_counts(const record::Turns& turns, const JoinedPhase& joined, const Rows& rows) {
    const auto n = static_cast<double>(std::count(rows.begin(), rows.end(), 1));
    const double counted = std::max(1.0, static_cast<double>(joined.miscounted.size()));
    const double begun = std::min(0.5, counted / static_cast<double>(turns.size()));
    MissedShare share;
    double likeliest = 0.0;
    bool first = true;
    // A counter may have noise of its own, and edges elsewhere than the quadrature's.
    for (const double edge : {1e-4, 0.03, 0.1}) {
        Chain chain(turns, joined, edge);
        constexpr int most_passes = 100;
        constexpr double enough = 1e-6;
        double p = begun;
        double log_likelihood = 0.0;
        for (int k = 0; k < most_passes; ++k) {
            const Chain::Pass pass = chain.pass(p, rows);
            const double next = std::clamp(pass.steps / n, 1e-9, 1.0 - 1e-9);
            const bool there = std::abs(next - p) < enough * p;
            log_likelihood = pass.log_likelihood;
            p = next;
            if (there) break;
        }
        if (!first && log_likelihood <= likeliest) continue;
        first = false;
        likeliest = log_likelihood;
        // Information by the bend of the likelihood of all turns
        const double h = 0.01 * p * (1.0 - p);
        const double bend =
            (2.0 * chain.log_likelihood(p) - chain.log_likelihood(p - h) - chain.log_likelihood(p + h)) / (h * h);
        const double of_rows = bend * n / static_cast<double>(turns.size());
        share.probability_per_turn = p;
        // Where no bend is to be had, of so many trials.
        share.sd = of_rows > 0.0 ? 1.0 / std::sqrt(of_rows) : std::sqrt(p * (1.0 - p) / n);
    }
    return share;
}

}  // namespace ringlock::closure
