#include "analysis/allan/estimator.hpp"

#include <algorithm>

namespace ringlock::allan {

std::optional<Estimator> estimator_named(std::string_view name) {
    for (const Traits& t : all_estimators) {
        if (t.name == name) return t.estimator;
    }
    return std::nullopt;
}

std::int64_t span_of(Estimator estimator, std::int64_t m) {
    const Traits& t = traits(estimator);
    switch (t.family) {
        case Family::difference:
        case Family::interval_error:
            return t.differences * m + 1;
        case Family::modified:
        case Family::modified_total:
            return 3 * m;
        case Family::total:
            return std::max<std::int64_t>(3, m + 1);
        case Family::hadamard_total:
            return m == 1 ? 4 : 3 * m + 1;
    }
    return 0;
}

std::int64_t term_count(Estimator estimator, std::int64_t m, std::int64_t phase_points) {
    const Traits& t = traits(estimator);
    const std::int64_t span = span_of(estimator, m);
    if (phase_points < span) return 0;
    if (t.family == Family::total) return phase_points - 2;
    return 1 + (phase_points - span) / (t.overlapping ? 1 : m);
}

std::int64_t largest_factor(Estimator estimator, std::int64_t phase_points) {
    const Traits& t = traits(estimator);
    std::int64_t largest = 0;
    switch (t.family) {
        case Family::difference:
        case Family::interval_error:
            largest = (phase_points - 1) / t.differences;
            break;
        case Family::modified:
        case Family::modified_total:
            largest = phase_points / 3;
            break;
        case Family::total:
            largest = phase_points < 3 ? 0 : phase_points - 1;
            break;
        case Family::hadamard_total:
            largest = (phase_points - 1) / 3;
            break;
    }
    return std::max<std::int64_t>(0, largest);
}

std::vector<std::int64_t> octave_factors(std::int64_t largest) {
    std::vector<std::int64_t> m;
    for (std::int64_t k = 1; k <= largest; k *= 2) m.push_back(k);
    return m;
}

std::vector<std::int64_t> decade_factors(std::int64_t largest) {
    std::vector<std::int64_t> m;
    for (std::int64_t decade = 1; decade <= largest; decade *= 10) {
        for (const std::int64_t step : {1, 2, 4}) {
            if (step * decade <= largest) m.push_back(step * decade);
        }
    }
    return m;
}

std::vector<std::int64_t> all_factors(std::int64_t largest) {
    std::vector<std::int64_t> m(static_cast<std::size_t>(std::max<std::int64_t>(0, largest)));
    for (std::size_t i = 0; i < m.size(); ++i) m[i] = static_cast<std::int64_t>(i) + 1;
    return m;
}

}  // namespace ringlock::allan
