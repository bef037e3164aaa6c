#pragma once
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/types.hpp"

/// Whether innovations are white: independent of those before, and of one variance.
namespace ringlock::closure {

/// Correlations of the innovations that count with those before, in standard errors by their own scatter.
struct Correlations {
    std::array<double, options.stats.lags + 1> root{};  ///< [lag]; none at 0

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
