#pragma once
#include <cstddef>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/octave_stream.hpp"

namespace ringlock::allan {

/// Power-law exponent alpha of the noise at each octave, from the slope of the Allan variance alone.
///
/// \param variances  Allan variances at m = 1, 2, 4, ..., any unit, >= 0
/// \param samples    length of the record [phase samples]
/// \param differences  2 for Allan variances; with Hadamard's (3) exponents go down to -4
/// \return S_y(f) ~ f^alpha for each: 2 (white phase, and flicker phase, which has nearly its slope), 0 (white
///         frequency), -1 (flicker), -2 (random walk and redder); 0 where the slope cannot be determined
///
/// The slope mu of log variance over log m at an octave is that from the octave below to the one above, one-sided at
/// the ends; alpha = -1 - round(mu), and 2 for mu < -3/2 (NIST SP1065 section 5.5.5, table 6). Beyond n/m = 30
/// averaging times the last exponent is kept, and from 100 on the redder of it and the octave's below taken, as for
/// stored records.
std::vector<int> noise_of_octaves(const std::vector<double>& variances, std::int64_t samples, int differences = 2);

/// Result of a stream at one averaging factor.
struct OctaveMean {
    std::int64_t m = 0;        ///< averaging factor
    double mean_square = 0.0;  ///< of differences of the phase by m, in units of it
    std::int64_t terms = 0;
};

/// The deviation with its interval from a sum with a stride of tau/8, of noise of that exponent.
///
/// \param alpha  power-law exponent of the noise, as returned by noise_of_octaves()
/// The other parameters are those of octave_points().
Point stream_point(const OctaveMean& mean, int alpha, int differences, std::int64_t samples, double tau0_s,
                   double confidence);

/// Deviations with intervals from sums with a stride of tau/8 (OctaveStream::starts_per_tau).
///
/// \param octaves      m = 1, 2, 4, ... as far as there are terms
/// \param differences  2 Allan, 3 Hadamard
/// \param samples      phase samples of the record
/// \param tau0_s       sampling interval [s], > 0
/// \param confidence   two-sided level of the intervals, in (0, 1)
///
/// Throws InputError where tau0 or confidence are out of range.
std::vector<Point> octave_points(const std::vector<OctaveMean>& octaves, int differences, std::int64_t samples,
                                 double tau0_s, double confidence);

/// Allan deviation of one gyro at every octave that has a term, with intervals.
///
/// \param stream          its sums
/// \param lane            its column
/// \param unit_per_count  unit of phase that one count stands for, > 0 and finite
/// \param tau0_s          sampling interval [s], > 0
/// \param confidence      two-sided level of the intervals, in (0, 1)
/// \return one point an octave, of the same m as octave_factors(largest_factor(...)): the last one may rest on a single
///         term, and its interval says so (one degree of freedom); dev in units of phase per second
///
/// dev^2 = sum / (2 tau^2 terms), the overlapping estimator of allan.hpp with a stride of tau/8; edf for that stride.
/// Throws InputError where unit, tau0 or confidence are out of range, std::out_of_range for a lane that is not there.
std::vector<Point> deviation(const OctaveStream& stream, std::size_t lane, double unit_per_count, double tau0_s,
                             double confidence = Options{}.confidence);

}  // namespace ringlock::allan
