#pragma once
#include "analysis/allan/sums/phase.hpp"
#include "app/allan/series.hpp"

namespace ringlock::app {

/// Phase of the data that were kept, in the unit of the deviations times seconds.
inline allan::Phase phase_of_data(const AllanRequest& request, const AnalysedSeries& series) {
    const double tau0_s = series.out.tau0_s;
    return series.counts.empty() ? allan::phase_of(series.values, request.kind, tau0_s, request.scale())
                                 : allan::phase_of(series.counts, series.values, request.kind, tau0_s, request.scale());
}

}  // namespace ringlock::app
