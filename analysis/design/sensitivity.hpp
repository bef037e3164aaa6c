#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/design/unit_cube.hpp"

namespace ringlock::design {

/// The points at which a model is evaluated for its sensitivity indices, in the unit cube.
///
/// The 2 k coordinates of one scrambled Sobol' sequence are the points A and B of k independent factors; AB_i is A with
/// coordinate i from B (Saltelli et al., Comput. Phys. Commun. 181, 259, 2010). The k + 2 points of a base point follow
/// each other, A, B, AB_1 ... AB_k, and a design with more base points begins with that of fewer: evaluations made
/// already need not be made again.
///
/// \param base_points  n; powers of 2 are balanced best
/// \param factors      k
/// \param limit        on the number of evaluations n (k + 2)
/// Throws InputError where n or k is 0, where n (k + 2) is above the limit (computed without overflow), and where
/// sobol() does not support 2 k dimensions.
Points sensitivity_points(std::uint64_t base_points, std::uint64_t factors, std::uint64_t seed, std::uint64_t limit);

/// Results of a model at sensitivity_points().
struct Evaluations {
    std::size_t base_points = 0;
    std::size_t factors = 0;
    std::size_t outputs = 0;
    /// [evaluation][output], evaluations in the order of sensitivity_points(). A base point with a value
    /// that is not finite is left out, for that output.
    std::span<const double> values = {};
    /// Variance of each value by its own noise: for a Monte Carlo estimate, the square of its standard error. As many
    /// as values and >= 0 where the value is finite, or empty: not known.
    std::span<const double> noise_variance = {};
};

/// How the ends of the intervals follow from the bootstrap's replicates.
enum class Bootstrap {
    percentile,  ///< their quantiles (Efron 1979)
    bca,         ///< those at levels corrected for bias and acceleration (Efron, J. Am. Stat. Assoc. 82, 171, 1987)
};

struct SensitivityOptions {
    double confidence = 0.95;   ///< two-sided, above 0 and below 1
    std::uint64_t seed = 0;     ///< of the resampling
    std::size_t rounds = 1000;  ///< resamplings, 100 or more
    Bootstrap bootstrap = Bootstrap::percentile;
};

/// An index and its interval.
struct Index {
    double estimate = 0.0;
    double lo = 0.0;
    double hi = 0.0;
};

/// Of one factor.
struct FactorIndices {
    Index first;  ///< share of the variance that goes if the factor alone were known: Var(E(y|x_i))/Var(y)
    Index total;  ///< share that stays if all others were known: E(Var(y|all but x_i))/Var(y)
};

/// Of one output.
struct OutputIndices {
    std::size_t base_points = 0;     ///< whose evaluations were all finite
    std::size_t left_out = 0;        ///< base points with an evaluation that was not
    std::optional<double> mean;      ///< over A and B; absent without base points
    std::optional<double> variance;  ///< over A and B, noise included; absent likewise
    /// Mean noise variance over A and B, over the variance; absent where noise is not known or indices are absent.
    std::optional<double> noise_share;
    std::vector<FactorIndices> factors;  ///< empty where there are no indices
    std::string absent;                  ///< why there are no indices; empty otherwise
};

/// Of fewer base points no index is given.
inline constexpr std::size_t fewest_base_points = 16;

/// Sensitivity indices of first and total order of independent factors, one set for each output.
///
/// With m and V mean and variance of f over the points A and B together, and f_B' = f_B - m:
///
///     S_i  = mean(f_B' (f_AB_i - f_A))/V         Saltelli et al. 2010, Table 2 (b), the mean taken off as in Sobol',
///     Math.
///                                                Comput. Simul. 55, 271, 2001, and in Owen, ACM Trans. Model. Comput.
///                                                Simul. 23, 11, 2013
///     ST_i = mean((f_A - f_AB_i)^2)/(2 V)        Jansen, Comput. Phys. Commun. 117, 35, 1999
///
/// The intervals come from a bootstrap over the base points, in which each resample has its own m and V. The bootstrap
/// treats base points as independent. Those of a scrambled Sobol' sequence cover the cube more evenly, so that the
/// intervals are wider than the errors of smooth models (docs/design.md gives measured widths). Indices are not
/// clipped: for factors without influence they scatter about 0, and S_i below it.
///
/// Noise of the evaluations that is independent between them lowers S_i by the factor 1 - noise share, and brings ST_i
/// towards 1: ST_i (1 - share) + share, also for factors without influence. Where evaluations share their random
/// numbers neither need hold.
///
/// Indices are absent, with the reason, where fewer than fewest_base_points are left, where the output does not vary,
/// and where more than one round in a hundred drew base points that do not vary. Rounds run in parallel; the result is
/// the same to the bit for any number of threads.
///
/// Throws InputError where sizes do not match, noise variances are negative or not finite, or options are not in range.
std::vector<OutputIndices> sensitivity_indices(const Evaluations& evaluations, const SensitivityOptions& options = {});

}  // namespace ringlock::design
