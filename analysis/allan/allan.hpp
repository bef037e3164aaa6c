#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/allan/estimator.hpp"
#include "analysis/allan/sums/phase.hpp"

/// Allan family of frequency-stability estimators.
namespace ringlock::allan {

/// One point of a deviation curve.
struct Point {
    std::int64_t m = 0;      ///< averaging factor
    double tau_s = 0.0;      ///< m tau0
    double dev = 0.0;        ///< deviation; unit of the phase per second, of the phase for time errors
    std::int64_t terms = 0;  ///< squares in the mean (windows, for mtie and the totals of pieces)
    int alpha = 0;           ///< power-law exponent of the noise assumed for edf (0 where none could be identified)
    double bias = 1.0;       ///< divisor of the variance (total family)
    double edf = 0.0;        ///< equivalent degrees of freedom; NaN with lo and hi for estimators without interval
                             ///< (mtie, tierms)
    double lo = 0.0;         ///< interval of the true deviation at the requested confidence
    double hi = 0.0;
};

/// Divisor of the variances of the total family and of their intervals.
enum class Bias {
    published,  ///< published_bias(): the figures of the literature and of Stable32
    exact,      ///< Uncertainty::bias, which depends on averaging factor and length of the record; intervals need it to
                ///< cover the truth
    none        ///< 1: the definition as it stands
};

struct Options {
    double confidence = 0.682689492137;  ///< two-sided level of lo...hi, in (0, 1)
    Bias bias = Bias::published;
};

/// Deviations of phase at the requested averaging factors, with intervals.
///
/// \param phase    phase_of() a record, with or without gaps
/// \param tau0_s   sampling interval [s], > 0
/// \param factors  averaging factors, each 1...largest_factor(); in any order
/// \return one point for each factor, in their order; factors for which gaps leave no term are missing
///
/// Definitions: NIST SP1065 sections 5.2.2 to 5.2.18, as named in estimator.hpp; docs/dev/allan-deviations.md writes
/// them out. A term that needs a missing point is left out of the mean; the differences of rates of which a tenth at
/// most is missing are taken from the means of the others (gapped_rates.hpp). Noise is identified at each factor
/// (noise_identification.hpp; gaps are bridged by straight lines for that), intervals are those of uncertainty.hpp.
/// Throws InputError where a factor has no term in a record of that length, tau0 is not positive or the confidence
/// outside (0, 1).
std::vector<Point> deviation(Estimator estimator, const Phase& phase, double tau0_s,
                             std::span<const std::int64_t> factors, const Options& options = {});

/// The same of phase without gaps. Time interval errors are those of the phase as it is given.
std::vector<Point> deviation(Estimator estimator, std::span<const double> phase, double tau0_s,
                             std::span<const std::int64_t> factors, const Options& options = {});

}  // namespace ringlock::allan
