#include "analysis/allan/uncertainty.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "analysis/allan/degrees_of_freedom.hpp"
#include "analysis/allan/interval.hpp"

namespace ringlock::allan {
namespace {

/// Samples of a tau in the short records that stand for others, and the most taus that those have.
constexpr std::int64_t fine = 8;
constexpr std::int64_t most_taus = 16;
/// Degrees of freedom from which an estimate is chi-squared for all purposes.
constexpr double many_degrees = 16.0;

EstimatorShape shape_of(Estimator estimator) {
    const Traits& t = traits(estimator);
    const bool modified = t.family == Family::modified || t.family == Family::modified_total;
    return {.differences = t.differences, .modified = modified, .overlapping = t.overlapping};
}

/// The estimator without reflections that is like it.
Estimator plain(Estimator estimator) {
    switch (traits(estimator).family) {
        case Family::total:
            return Estimator::oadev;
        case Family::modified_total:
            return Estimator::mdev;
        case Family::hadamard_total:
            return Estimator::ohdev;
        default:
            return estimator;
    }
}

bool is_total(Estimator estimator) { return plain(estimator) != estimator; }

/// A record of as many tau as that of `points`, with at most `fine` samples to each.
struct Short {
    std::int64_t m;
    std::int64_t points;
};

Short short_record(Estimator estimator, std::int64_t m, std::int64_t points) {
    const Traits& t = traits(estimator);
    const std::int64_t few = !t.overlapping ? 1 : std::min(m, fine);
    const double taus = static_cast<double>(points - 1) / static_cast<double>(m);
    const auto steps = static_cast<std::int64_t>(t.overlapping ? std::llround(taus * static_cast<double>(few))
                                                               : static_cast<std::int64_t>(taus));
    return {few, std::max(span_of(estimator, few), steps + 1)};
}

}  // namespace

double published_bias(Estimator estimator, int alpha, std::int64_t m, std::int64_t points) {
    switch (traits(estimator).family) {
        case Family::total: {
            const double share = static_cast<double>(m) / static_cast<double>(points - 1);
            if (alpha == -1) return 1.0 - share / (3.0 * std::numbers::ln2);
            return alpha <= -2 ? 1.0 - 0.75 * share : 1.0;
        }
        case Family::modified_total: {
            constexpr std::array<double, 5> factors = {0.94, 0.83, 0.73, 0.70, 0.69};
            return factors[static_cast<std::size_t>(std::clamp(2 - alpha, 0, 4))];
        }
        case Family::hadamard_total: {
            constexpr std::array<double, 5> excess = {-0.005, -0.149, -0.229, -0.283, -0.321};
            if (m == 1 || alpha > 0) return 1.0;
            return 1.0 + excess[static_cast<std::size_t>(std::clamp(-alpha, 0, 4))];
        }
        default:
            return 1.0;
    }
}

Uncertainties::Uncertainties(double confidence) : confidence_(confidence) {}

const WeightedSquares& Uncertainties::form(Estimator estimator, int alpha, std::int64_t m, std::int64_t points) {
    auto& kept = forms_[{estimator, alpha, m, points}];
    if (!kept) kept = std::make_unique<WeightedSquares>(distribution_of(estimator, alpha, m, points));
    return *kept;
}

double Uncertainties::total_degrees(Estimator estimator, int alpha, std::int64_t m, std::int64_t points) {
    const Estimator like = plain(estimator);
    const Short little = short_record(estimator, m, std::min(points, most_taus * m + 1));
    const double ratio = form(estimator, alpha, little.m, little.points).degrees();
    const std::int64_t enough = std::max(points, span_of(like, m));
    const std::int64_t little_enough = std::max(little.points, span_of(like, little.m));
    return ratio * degrees_of_freedom(shape_of(like), alpha, m, enough) /
           degrees_of_freedom(shape_of(like), alpha, little.m, little_enough);
}

void Uncertainties::set_quantiles(Uncertainty& out, const WeightedSquares* exact) const {
    const double below = 0.5 * (1.0 - confidence_);
    const double above = 0.5 * (1.0 + confidence_);
    out.low = exact != nullptr ? exact->quantile(below) : relative_chi_squared_quantile(out.edf, below);
    out.high = exact != nullptr ? exact->quantile(above) : relative_chi_squared_quantile(out.edf, above);
}

Uncertainty Uncertainties::operator()(Estimator estimator, int alpha, std::int64_t m, std::int64_t points) {
    Uncertainty out;
    const WeightedSquares* exact = nullptr;
    const bool scale_free = alpha <= 0;
    if (is_total(estimator)) {
        out.edf = total_degrees(estimator, alpha, m, points);
        const Short little = short_record(estimator, m, std::min(points, most_taus * m + 1));
        const WeightedSquares& there = form(estimator, alpha, little.m, little.points);
        out.bias = there.mean();
        // Beyond, what the ends do fades in proportion to tau/T.
        if (traits(estimator).family == Family::total && points - 1 > most_taus * m) {
            out.bias = 1.0 + (out.bias - 1.0) * static_cast<double>(most_taus * m) / static_cast<double>(points - 1);
        }
        if (scale_free && out.edf < many_degrees) exact = &there;
    } else {
        out.edf = degrees_of_freedom(shape_of(estimator), alpha, m, points);
        const Short little = short_record(estimator, m, points);
        if (scale_free && out.edf < many_degrees) exact = &form(estimator, alpha, little.m, little.points);
    }
    set_quantiles(out, exact);
    return out;
}

}  // namespace ringlock::allan
