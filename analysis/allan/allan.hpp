#pragma once
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "analysis/allan/phase.hpp"

/// Allan family of frequency-stability estimators.
namespace ringlock::allan {

enum class Estimator {
    adev,  ///< Allan deviation, every tau once
    oadev  ///< overlapping Allan deviation
};

/// The estimator's name as on the command line.
std::string_view name(Estimator estimator);

/// One point of a deviation curve.
struct Point {
    std::int64_t m = 0;      ///< averaging factor
    double tau_s = 0.0;      ///< m tau0
    double dev = 0.0;        ///< deviation; unit of the phase per second
    std::int64_t terms = 0;  ///< squared differences in the mean
    int alpha = 0;           ///< power-law exponent of the noise assumed for edf (0 where none could be identified)
    double edf = 0.0;        ///< equivalent degrees of freedom
    double lo = 0.0;         ///< chi-squared interval of the true deviation at the confidence asked for
    double hi = 0.0;
};

struct Options {
    double confidence = 0.682689492137;  ///< two-sided level of lo...hi, in (0, 1)
};

/// Largest averaging factor with at least one term.
std::int64_t largest_factor(Estimator estimator, std::int64_t phase_points);

/// Averaging factors up to `largest`: 1, 2, 4, ...; 1, 2, 4, 10, 20, 40, ...; every one.
std::vector<std::int64_t> octave_factors(std::int64_t largest);
std::vector<std::int64_t> decade_factors(std::int64_t largest);
std::vector<std::int64_t> all_factors(std::int64_t largest);

/// Allan deviation of phase at the averaging factors asked for, with intervals.
///
/// \param phase    phase samples (centred_phase), length N, finite
/// \param tau0_s   sampling interval [s], > 0
/// \param factors  averaging factors, each 1...largest_factor(); in any order
/// \return one point for each factor, in their order
///
/// oadev: sigma^2 = sum_{i<N-2m} (x_{i+2m} - 2 x_{i+m} + x_i)^2 / (2 tau^2 (N-2m)); NIST SP1065 section 5.2.4, equation
/// (11); adev takes every m-th term of that sum; section 5.2.2. Interval: dev sqrt(edf/chi2) with edf of Greenhall &
/// Riley for the identified noise; SP1065 section 5.3, equation (45). Throws InputError where a factor has no term,
/// tau0 is not positive or the confidence outside (0, 1).
std::vector<Point> deviation(Estimator estimator, std::span<const double> phase, double tau0_s,
                             std::span<const std::int64_t> factors, const Options& options = {});

}  // namespace ringlock::allan
