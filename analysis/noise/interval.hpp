#pragma once
#include <optional>

#include "analysis/noise/model/likelihood.hpp"

namespace ringlock::noise {

/// Ends of a central 68.27 % interval, in the order lower, upper.
struct Ends {
    double lo = 0.0;
    double hi = 0.0;
};

/// Central 68.27 % interval of a parameter that is inside its range.
///
/// \param best       maximum of the model
/// \param parameter  a variance > 0 of the model, or log_time
///
/// A variance that rests on many degrees of freedom: normal on the scale of its logarithm. One that rests on few, and
/// the correlation time: where the likelihood, all else free, has fallen as far as that of so many chi-squared
/// ordinates at the quantiles 0.16 and 0.84 of their sum; but no nearer above than the curvature of the likelihood says
/// where another variance falls to 0 on the way.
Ends central_interval(const Likelihood& likelihood, const Model& model, const Maximum& best, std::size_t parameter);

/// Value of a variance at which the likelihood, all else free, has fallen to its one-sided 95 % limit.
///
/// \param best  maximum of the model
std::optional<double> upper_limit(const Likelihood& likelihood, const Model& model, const Maximum& best,
                                  std::size_t term);

}  // namespace ringlock::noise
