#include "analysis/closure/stats/count_chain.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "analysis/closure/options.hpp"
#include "engine/core/interrupt.hpp"

namespace ringlock::closure {

namespace {

double below(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

/// Probability that a phase read at x from the middle of a quarter lies in that quarter.
double inside(double x, double sd) { return below((0.5 - x) / sd) - below((-0.5 - x) / sd); }

}  // namespace

CountChain::CountChain(const CountedQuarters& counted, double edge)
    : seen_(counted.off.size()), step_(counted.off.size()) {
    for (std::size_t i = 0; i < seen_.size(); ++i) {
        const double sd = std::hypot(edge, counted.sd[i]);
        for (std::size_t lost = 0; lost < quarters; ++lost) {
            double x = counted.off[i] - static_cast<double>(lost);
            x -= quarters * std::round(x / quarters);
            // However far off the reading is: it has another cause then, and the chain continues.
            seen_[i][lost] = std::max(options.stats.count_chain.never, inside(x, sd));
        }
        // Towards a minimum the count stays too high by the quarters that it misses.
        step_[i] = counted.direction[i] > 0 ? quarters - 1 : 1;
    }
}

CountChain::Pass CountChain::pass(double p, std::span<const std::uint8_t> rows) {
    Pass pass{forward(p), 0.0};
    Chances after{1.0, 1.0, 1.0, 1.0};  // probability of all later readings, scaled
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

double CountChain::forward(double p) {
    check_interrupt();
    forward_.resize(seen_.size());
    double log_likelihood = 0.0;
    Chances now{};
    for (std::size_t i = 0; i < seen_.size(); ++i) {
        Chances next{};
        double sum = 0.0;
        for (std::size_t to = 0; to < quarters; ++to) {
            const std::size_t from = (to + quarters - step_[i]) % quarters;
            const double predicted = i == 0 ? 1.0 / quarters : (1.0 - p) * now[to] + p * now[from];
            next[to] = predicted * seen_[i][to];
            sum += next[to];
        }
        for (double& chance : next) chance /= sum;
        log_likelihood += std::log(sum);
        now = forward_[i] = next;
    }
    return log_likelihood;
}

std::vector<std::int64_t> CountChain::likeliest_path(double p) const {
    // Probabilities of steps of 0 to 3 quarters in the direction of the phase; three are one against the direction.
    const double chances[quarters] = {1.0 - p, p, options.stats.count_chain.two_at_once * p,
                                      options.stats.count_chain.against_direction * p};
    double costs[quarters];
    std::transform(std::begin(chances), std::end(chances), costs, [](double chance) { return -std::log(chance); });
    const std::size_t n = seen_.size();
    std::vector<std::array<std::uint8_t, quarters>> came(n);  // number of steps of the cheapest path to this state
    Chances cost{};
    for (std::size_t i = 0; i < n; ++i) {
        Chances next{};
        for (std::size_t to = 0; to < quarters; ++to) {
            double least = i == 0 ? 0.0 : std::numeric_limits<double>::infinity();
            for (std::size_t steps = 0; steps < quarters && i > 0; ++steps) {
                const std::size_t from = (to + quarters * step_[i] - steps * step_[i]) % quarters;
                if (!(cost[from] + costs[steps] < least)) continue;
                least = cost[from] + costs[steps];
                came[i][to] = static_cast<std::uint8_t>(steps);
            }
            next[to] = least - std::log(seen_[i][to]);
        }
        cost = next;
    }
    std::vector<std::int64_t> path(n);
    if (n == 0) return path;
    auto at = static_cast<std::size_t>(std::min_element(cost.begin(), cost.end()) - cost.begin());
    std::vector<std::int64_t> steps(n);
    for (std::size_t i = n; i-- > 1;) {
        const std::size_t taken = came[i][at];
        const std::int64_t way = step_[i] == 1 ? 1 : -1;
        steps[i] = way * (taken == quarters - 1 ? -1 : static_cast<std::int64_t>(taken));
        at = (at + quarters * step_[i] - taken * step_[i]) % quarters;
    }
    path[0] = static_cast<std::int64_t>(at);
    for (std::size_t i = 1; i < n; ++i) path[i] = path[i - 1] + steps[i];
    return path;
}

}  // namespace ringlock::closure
