#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"

/// How the closed loop decides, on turns and on samples alike.
namespace ringlock::closure {

/// One family-wise level for everything that a record is asked.
inline constexpr double level = 0.003;
inline constexpr double level_of_effects = 0.002;
inline constexpr double level_of_residual = level - level_of_effects;
/// Log-likelihoods that are closer tell nothing: a false model gains so much over the true one with a probability of
/// exp(-4) at most.
inline constexpr double tie = 4.0;
/// A rate without a random part may be so much likelier than the random one that made it: all that has been seen of
/// that was a ramp or a step, whose size is anything, where the other had to be as large as it happened to be.
/// Simulated (test `RandomRates.MayLookLikeARamp`), a ramp is likelier than a true random walk by 4 in one record of
/// twenty, by this in two of a thousand at most.
inline constexpr double tie_with_random = 7.0;
inline constexpr std::size_t most_steps = 8;
inline constexpr std::size_t most_contenders = 5;

/// The rows that effects are chosen by and parameters fitted to. The record is cut into 40 contiguous blocks; one of
/// ten in a row does not count, so that what is foretold of it can be reported.
Rows rows_that_choose(std::size_t rows);

/// What would tell two effects apart that this record cannot.
std::string experiment_for(const std::string& effect, const std::vector<std::string>& others);

Verdict verdict_of(const Closure& closure);

/// Correlations of the innovations that count with those before, in standard errors by their own scatter.
struct Correlations {
    std::array<double, 25> root{};  ///< [lag]; none at 0

    ResidualTest test(Where where, std::string view) const;
};
Correlations correlations_of(const std::vector<double>& innovations, const Rows& rows);

/// Mean and variance of the squares of the innovations that count.
struct Squares {
    double mean, variance;
};
Squares squares_of(const std::vector<double>& innovations, const Rows& rows);

/// Whether the residual is as large everywhere: its squares in stretches of the record, each of `fewest` rows at least.
ResidualTest size_over_time(const std::vector<double>& innovations, const Rows& rows, std::size_t stretches,
                            double fewest);

}  // namespace ringlock::closure
