#pragma once
#include <cstdint>
#include <vector>

#include "engine/compensate/lane_compensator.hpp"
#include "engine/readout/lane_readings.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::ensemble {

/// Counts of the angle output in a fringe: fixed point, fine enough for its rounding (7e-11 fringes rms) to lie below
/// anything that an arm leaves, and exact in every sum and difference. 2^31 fringes fit before it wraps round.
inline constexpr double counts_per_fringe = 4294967296.0;

/// Angle output of an arm at the minima of a piece, from its first turn on, which is a minimum: [minimum][gyro] in
/// counts. `errors` of the arm's compensator are taken away where given. Counts wrap round, so that differences hold.
///
/// \param stride  turns from an output to the next: 1 gives the maxima, too
void output_counts(const readout::LaneAngles& angles, const compensate::LaneErrors* errors, std::size_t turns,
                   std::vector<simd::LaneCounts>& counts, std::size_t stride = 2);

/// An angle in those counts.
std::int64_t counts_of(double fringes);

}  // namespace ringlock::ensemble
