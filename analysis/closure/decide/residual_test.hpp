#pragma once
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "analysis/closure/types.hpp"

namespace ringlock::closure {

/// A residual test with the columns on which it regresses the innovations.
template <class Column>
struct ResidualTestOn {
    ResidualTest result;
    double cost = 0.0;                                  ///< in the log-likelihood, of its parameters and its search
    std::function<std::vector<Column>()> columns = {};  ///< empty if the test is no regression
    double largest = std::numeric_limits<double>::infinity();  ///< largest coefficient that makes sense
    bool jumps = false;             ///< random rates follow it nearly as well as it can be described
    std::optional<double> hz = {};  ///< frequency of a line
    /// Of a line whose power is scattered: evidence by the gain of a model that removes as much of the variance.
    std::optional<double> by_variance = {};
    /// Evidence by a new fit that is no regression; empty if there is none. A search is completed only if it comes near
    /// the evidence `competing`.
    std::function<double(double competing)> refitted = {};
    /// In a test that is not located in time: number of columns that are trends in time with free coefficients.
    int trends = 0;
};

}  // namespace ringlock::closure
