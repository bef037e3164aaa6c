#pragma once
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "analysis/closure/types.hpp"

namespace ringlock::closure {

/// A residual test with the columns on which it regresses the innovations.
template <class Column>
struct View {
    ResidualTest test;
    double cost = 0.0;                                  ///< of its parameters and its search, in the log-likelihood
    std::function<std::vector<Column>()> columns = {};  ///< none where nothing regresses
    double largest = std::numeric_limits<double>::infinity();  ///< coefficient that makes sense
    bool jumps = false;             ///< random rates can follow it nearly as well as it can be said
    std::optional<double> hz = {};  ///< of a line
    /// Of a line whose power is scattered: merit as the likelihood gains it where as much of the variance goes.
    std::optional<double> by_variance = {};
    /// Merit where it is fitted anew otherwise than by a regression, if it is; by a search, that is gone through with
    /// only where it comes near the merit of a rival.
    std::function<double(double rival)> refitted = {};
    int courses = 0;  ///< so many of the columns of what is not of time are courses in time of any size
};

}  // namespace ringlock::closure
