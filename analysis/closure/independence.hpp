#pragma once
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "analysis/closure/turn_fit.hpp"

namespace ringlock::closure {

/// Of the turn's phase, that views of the residual look at.
inline constexpr int harmonics_of_phase = 6;

/// Where structure lies that a model has left.
enum class Where { phase, time, frequency, temperature, rate, amplitude };
std::string_view name_of(Where where);

/// One view of the residual and how probable it is by chance, its own searches counted.
struct ResidualTest {
    Where where;
    std::string view;  ///< what the residual was held against
    double p_value = 1.0;
    std::string detail;  ///< the largest of what was seen
    double merit = 0.0;  ///< of a regression: gain of the log-likelihood less its parameters and its search

    std::string description() const;
};

/// A test of the innovations and what it regresses them on.
struct View {
    ResidualTest test;
    double cost = 0.0;                                     ///< of its parameters and its search, in the log-likelihood
    std::function<std::vector<Regressor>()> columns = {};  ///< none where nothing regresses
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

/// Gain of the log-likelihood by the regression, the noise fitted anew beside it and its coefficients integrated out,
/// less its search; minus infinity where coefficients make no sense. `rival`: the merit that it is compared with.
double refitted_merit(const TurnFit& fit, const View& view, double rival);

/// Holds the innovations that count against everything that the record has: phase at the turns and its harmonics,
/// direction, amplitude, temperature, input rate, time, frequency, the innovations before. The views refer to the fit.
std::vector<View> view_residual(const TurnFit& fit);

}  // namespace ringlock::closure
