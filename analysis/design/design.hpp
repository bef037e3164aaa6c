#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/design/correlation.hpp"
#include "analysis/design/factor.hpp"
#include "analysis/design/unit_cube.hpp"

namespace ringlock::design {

enum class Kind {
    grid,             ///< every combination of the factors' levels; the last factor changes fastest
    list,             ///< point i has the i-th value of every factor; all have explicit values, equally many
    latin_hypercube,  ///< latin_hypercube(), at the factors' quantiles
    sobol,            ///< sobol(), at the factors' quantiles
};

/// A requested design.
struct Plan {
    Kind kind = Kind::sobol;
    std::vector<Factor> factors = {};
    std::vector<Correlation> correlations = {};  ///< between factors with distributions; none in a grid or a list
    CorrelationOf correlation_of = CorrelationOf::ranks;
    std::uint64_t points =
        0;                   ///< of a Latin hypercube or a Sobol' sequence; a grid or a list have as many as they have
    std::uint64_t seed = 0;  ///< of a Latin hypercube or a Sobol' sequence
};

/// How many points the plan has.
///
/// \param limit  largest number of points that the caller is willing to compute
/// Throws InputError where the plan is impossible: factors that check() refuses; more points than the limit (a grid's
/// product cannot overflow); a grid with a distribution; a list with anything but values, or with unequally many;
/// correlations that GaussianCopula refuses, or in a grid or a list; a number of points of a grid or a list that is
/// given and differs from their own.
std::uint64_t point_count(const Plan& plan, std::uint64_t limit);

/// The points of the plan in the units of the factors: points x factors, in the order of the plan.
///
/// The same plan gives the same points; a Sobol' sequence with more points begins with those of one with fewer. Throws
/// InputError under the conditions of point_count(), before memory is allocated, and of room_for().
Points make_points(const Plan& plan, std::uint64_t limit);

/// Points of the unit cube at the quantiles of independent factors, for a design for sensitivity indices.
///
/// \param unit  one dimension a factor, all coordinates above 0 and below 1
/// Throws the exceptions of check() and Marginal, and InputError where dimensions and factors are not equally many.
Points at_quantiles(const Points& unit, std::span<const Factor> factors);

}  // namespace ringlock::design
