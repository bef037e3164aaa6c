#pragma once
#include <cstdint>

/// Figures of a lot of gyros: shares, quantiles, means, pairs of arms, each with an interval, and when a lot is large
/// enough. Gyros are taken as independent draws from one population. docs/lot.md has formulas, sources and the measured
/// coverage.
namespace ringlock::lot {

/// Both ends belong to it; an end may be infinite.
struct Interval {
    double lo = 0.0;
    double hi = 0.0;

    bool holds(double x) const { return lo <= x && x <= hi; }
};

/// How the number of gyros came about.
enum class Sampling {
    fixed,          ///< chosen before any gyro was seen
    until_precise,  ///< a StoppingRule chose it from the figures; intervals are wider, so that they keep their coverage
};

/// Requirements on an interval.
struct Confidence {
    double level = 0.95;  ///< probability that the interval holds the truth, in (0, 1)
    Sampling sampling = Sampling::fixed;
};

/// Throws InputError unless the level lies between 0 and 1.
void check(const Confidence& confidence);

/// The probability that each end of an exact interval (shares, quantiles) may miss by: (1 - level)/2 in a lot of fixed
/// size, two thirds of that after a StoppingRule (docs/lot.md, "After a stop").
double tail_probability(const Confidence& confidence);

/// The factor on the half width of a t interval of n values: 1 in a lot of fixed size, sqrt(1.04 + 2/n) after a
/// StoppingRule. It stops earlier where the standard deviation came out too small, for which 2/n makes up, and where a
/// yield, of which the mean is not independent, came out far from one half, for which 0.04 does (docs/lot.md, "After a
/// stop").
///
/// \param n  values, at least 1
double widening(const Confidence& confidence, std::int64_t n);

}  // namespace ringlock::lot
