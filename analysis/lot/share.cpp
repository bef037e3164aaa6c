#include "analysis/lot/share.hpp"

#include <fmt/format.h>

#include <boost/math/distributions/binomial.hpp>

#include "engine/core/error.hpp"

namespace ringlock::lot {

std::optional<double> Share::half_width() const {
    if (!interval) return std::nullopt;
    return 0.5 * (interval->hi - interval->lo);
}

Share share(std::int64_t k, std::int64_t n, const Confidence& confidence) {
    const double tail = tail_probability(confidence);
    if (n < 0) throw InputError(fmt::format("share of {} gyros: a lot has 0 gyros or more", n));
    if (k < 0 || k > n) {
        throw InputError(fmt::format("{} of {} gyros: a share counts from none to all of the lot", k, n));
    }
    Share s{.k = k, .n = n, .value = std::nullopt, .interval = std::nullopt};
    if (n == 0) return s;
    using Binomial = boost::math::binomial_distribution<double>;
    const auto trials = static_cast<double>(n);
    const auto successes = static_cast<double>(k);
    s.value = successes / trials;
    s.interval = {k == 0 ? 0.0 : Binomial::find_lower_bound_on_p(trials, successes, tail),
                  k == n ? 1.0 : Binomial::find_upper_bound_on_p(trials, successes, tail)};
    return s;
}

}  // namespace ringlock::lot
