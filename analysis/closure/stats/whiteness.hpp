#pragma once
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/types.hpp"

/// Tests of whether innovations are white: independent of earlier ones, and of one variance.
namespace ringlock::closure {

/// Correlations of the innovations that count with earlier ones, in standard errors by their own scatter.
struct Correlations {
    std::array<double, options.stats.lags + 1> root{};  ///< by lag; zero at lag 0

    ResidualTest test(Where where, std::string subject) const;
};
Correlations correlations_of(const std::vector<double>& innovations, const Rows& rows);

/// Mean and variance of the squares of the innovations that count.
struct Squares {
    double mean, variance;
};
Squares squares_of(const std::vector<double>& innovations, const Rows& rows);

/// Whether the residual has the same size everywhere: its squares in stretches of the record of at least `fewest` rows.
ResidualTest size_over_time(const std::vector<double>& innovations, const Rows& rows, std::size_t stretches,
                            double fewest);

}  // namespace ringlock::closure
