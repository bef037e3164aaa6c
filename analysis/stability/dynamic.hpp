#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/allan/allan.hpp"

namespace ringlock::stability {

/// Deviations of one time window.
struct WindowDeviation {
    double begin_s = 0.0;  ///< since the first value
    double end_s = 0.0;
    std::vector<allan::Point> points;  ///< none where too few values are there
};

/// How a record is cut into windows, in sampling intervals.
struct Windows {
    std::size_t length = 0;  ///< of a window, at least 4
    std::size_t step = 0;    ///< from the begin of one to that of the next, at least 1
};

/// Windows of that length, half a window from one to the next, or further where there would be more than `most`.
///
/// \param intervals  sampling intervals of the record
Windows windows_of(std::size_t length, std::size_t intervals, std::size_t most);

/// Deviation in windows that move over the record: the dynamic Allan deviation of L. Galleani and P. Tavella, IEEE
/// Trans. UFFC 56 (2009) 450, for any estimator, at octaves of tau0 up to a quarter of the window.
///
/// \param data    values, NaN where missing
/// \param counts  the same as whole numbers where some are beyond 2^53; else empty
/// \param scale   one of the data in the unit of the deviations times seconds, as of allan::phase_of()
std::vector<WindowDeviation> dynamic_deviation(allan::Estimator estimator, std::span<const double> data,
                                               std::span<const std::int64_t> counts, allan::Kind kind, double tau0_s,
                                               double scale, const Windows& windows, const allan::Options& options);

}  // namespace ringlock::stability
