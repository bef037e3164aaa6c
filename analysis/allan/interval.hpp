#pragma once
#include "analysis/allan/allan.hpp"

namespace ringlock::allan {

/// Throws InputError unless tau0 [s] is positive and finite and the confidence in (0, 1).
void check_deviation_input(double tau0_s, double confidence);

/// Quantile of chi-squared over its degrees of freedom.
double relative_chi_squared_quantile(double edf, double probability);

/// Sets lo and hi from dev and edf > 0: edf dev^2/sigma^2 is chi-squared (NIST SP1065 section 5.3, equation (45)).
void set_interval(Point& point, double confidence);

}  // namespace ringlock::allan
