#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/allan/allan.hpp"

namespace ringlock::stability {

/// Variances of three instruments at one averaging time.
struct HatPoint {
    std::int64_t m = 0;
    double tau_s = 0.0;
    std::array<double, 3> variance{};        ///< estimates; below zero where the differences contradict independence
    std::array<double, 3> standard_error{};  ///< of the variance; NaN where the deviations have no degrees of freedom
};

/// The three-cornered hat: variances of instruments A, B and C that were never seen without each other, from the
/// deviations of their differences A - B, A - C and B - C.
///
/// \param ab, ac, bc  deviations of the differences by one estimator; averaging factors that one lacks are left out
///
/// var A = (var AB + var AC - var BC)/2, and likewise the others, for independent instruments: J. Gray, D. Allan, "A
/// method for estimating the frequency stability of an individual oscillator", 28th Symposium on Frequency Control
/// (1974) 243. The estimate is the mean of products (a - b)(a - c) of what the estimator squares. For Gaussian noise a
/// product has the variance var AB var AC + (var A)^2, so that with nu degrees of freedom, the fewest of the three, the
/// standard error is sqrt((var AB var AC + (var A)^2)/nu).
std::vector<HatPoint> three_cornered_hat(std::span<const allan::Point> ab, std::span<const allan::Point> ac,
                                         std::span<const allan::Point> bc);

}  // namespace ringlock::stability
