#include "analysis/design/design.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <utility>

#include "engine/core/error.hpp"

namespace ringlock::design {
namespace {

bool of_levels(Kind kind) { return kind == Kind::grid || kind == Kind::list; }

const char* name_of(Kind kind) {
    switch (kind) {
        case Kind::grid:
            return "grid";
        case Kind::list:
            return "list";
        case Kind::latin_hypercube:
            return "Latin hypercube";
        case Kind::sobol:
            return "Sobol' sequence";
    }
    return "design";
}

[[noreturn]] void refuse_count(const Plan& plan, const std::string& count, std::uint64_t limit) {
    throw InputError(fmt::format("a {} of {} points: {} is the limit; take fewer {}", name_of(plan.kind), count, limit,
                                 plan.kind == Kind::grid ? "factors or fewer values of each" : "points"));
}

std::uint64_t grid_count(const Plan& plan, std::uint64_t limit) {
    std::vector<std::string> counts;
    for (const Factor& f : plan.factors) {
        if (has_distribution(f)) {
            throw InputError(
                fmt::format("factor {}: a grid has no place for a distribution; give it values or a range, "
                            "or take a Latin hypercube or a Sobol' sequence",
                            f.key));
        }
        counts.push_back(fmt::format("{}", level_count(f)));
    }
    std::uint64_t count = 1;
    for (const Factor& f : plan.factors) {
        // count <= limit so far.
        if (level_count(f) > limit / count) refuse_count(plan, fmt::format("{}", fmt::join(counts, " x ")), limit);
        count *= level_count(f);
    }
    return count;
}

std::uint64_t list_count(const Plan& plan, std::uint64_t limit) {
    const Factor& first = plan.factors.front();
    for (const Factor& f : plan.factors) {
        if (!std::holds_alternative<Values>(f.takes)) {
            throw InputError(fmt::format("factor {}: in a list every factor has values; write its values down", f.key));
        }
        if (level_count(f) != level_count(first)) {
            throw InputError(
                fmt::format("factor {} has {} values and factor {} has {}: in a list all have equally many", first.key,
                            level_count(first), f.key, level_count(f)));
        }
    }
    const std::uint64_t count = level_count(first);
    if (count > limit) refuse_count(plan, fmt::format("{}", count), limit);
    return count;
}

Points grid(const Plan& plan, std::uint64_t count, std::uint64_t limit) {
    Points points = room_for(count, plan.factors.size(), limit);
    for (std::uint64_t i = 0; i < count; ++i) {
        std::uint64_t rest = i;
        for (std::size_t f = plan.factors.size(); f-- > 0;) {
            const std::uint64_t levels = level_count(plan.factors[f]);
            points[i][f] = level(plan.factors[f], rest % levels);
            rest /= levels;
        }
    }
    return points;
}

Points list(const Plan& plan, std::uint64_t count, std::uint64_t limit) {
    Points points = room_for(count, plan.factors.size(), limit);
    for (std::uint64_t i = 0; i < count; ++i) {
        for (std::size_t f = 0; f < plan.factors.size(); ++f) points[i][f] = level(plan.factors[f], i);
    }
    return points;
}

/// Values in place of coordinates.
void to_values(Points& points, std::span<const Factor> factors, const GaussianCopula& copula) {
    const std::vector<Marginal> marginals(factors.begin(), factors.end());
    std::vector<Probability> probability(factors.size());
    for (std::size_t i = 0; i < points.count; ++i) {
        const std::span<double> point = points[i];
        copula(point, probability);
        for (std::size_t f = 0; f < factors.size(); ++f) point[f] = marginals[f](probability[f]);
    }
}

}  // namespace

std::uint64_t point_count(const Plan& plan, std::uint64_t limit) {
    check(plan.factors);
    // Refuses correlations that no copula has.
    const GaussianCopula copula(plan.factors, plan.correlations, plan.correlation_of);
    if (!of_levels(plan.kind)) {
        if (plan.points == 0) {
            throw InputError(fmt::format("a {} of no points: give the number of points", name_of(plan.kind)));
        }
        if (plan.points > limit) refuse_count(plan, fmt::format("{}", plan.points), limit);
        return plan.points;
    }
    if (!plan.correlations.empty()) {
        throw InputError(
            fmt::format("a {} has no correlations, because its values are given: "
                        "leave the correlation of {} and {} out",
                        name_of(plan.kind), plan.correlations.front().first, plan.correlations.front().second));
    }
    const std::uint64_t count = plan.kind == Kind::grid ? grid_count(plan, limit) : list_count(plan, limit);
    if (plan.points != 0 && plan.points != count) {
        throw InputError(fmt::format("a {} of {} points: its factors make {}; leave the number out", name_of(plan.kind),
                                     plan.points, count));
    }
    return count;
}

Points make_points(const Plan& plan, std::uint64_t limit) {
    const std::uint64_t count = point_count(plan, limit);
    if (plan.kind == Kind::grid) return grid(plan, count, limit);
    if (plan.kind == Kind::list) return list(plan, count, limit);
    Points points = plan.kind == Kind::sobol ? sobol(count, plan.factors.size(), plan.seed, limit)
                                             : latin_hypercube(count, plan.factors.size(), plan.seed, limit);
    to_values(points, plan.factors, GaussianCopula(plan.factors, plan.correlations, plan.correlation_of));
    return points;
}

Points at_quantiles(const Points& unit, std::span<const Factor> factors) {
    check(factors);
    if (unit.dimensions != factors.size()) {
        throw InputError(fmt::format("points in {} dimensions for {} factors: there must be one dimension per factor",
                                     unit.dimensions, factors.size()));
    }
    Points points = unit;
    to_values(points, factors, GaussianCopula(factors, {}, CorrelationOf::ranks));
    return points;
}

}  // namespace ringlock::design
