#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/allan/sums/phase.hpp"
#include "analysis/allan_run/outcome.hpp"

namespace ringlock::allan_run {

/// Searches the data for faults that no noise model has, and estimates the noise without those, of all data or, where a
/// record with gaps is too long for that, of the longest part without gaps: outliers and jumps are taken off by their
/// estimated sizes, wraps are undone, values that only repeat the one before them count as missing. Coefficients are
/// withheld where stretches have another variance or clipped values hide a part of the noise. The findings join those
/// that are in `out`.
/// \param values   the data, NaN where missing
/// \param counts   the same as whole numbers where doubles would round them, else empty
/// \param phase    of the data
/// \param scale    one of the data in arcsec (m/s, s), or in arcsec/s of rates
void search_and_fit(std::vector<double> values, std::span<const std::int64_t> counts, const allan::Phase& phase,
                    allan::Kind kind, double scale, AllanOutput& out);

}  // namespace ringlock::allan_run
