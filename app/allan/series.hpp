#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "app/allan/output/allan_output.hpp"
#include "app/allan/repeated_input.hpp"
#include "app/allan/request.hpp"
#include "app/allan/series_names.hpp"

namespace ringlock::app {

/// A series with everything that is said of it.
struct AnalysedSeries {
    AllanOutput out;
    // The data, where they are kept.
    std::vector<double> values;
    std::vector<std::int64_t> counts;
};

/// Reads one series and computes its deviations and noise coefficients. Throws InputError.
AnalysedSeries analyse(const AllanRequest& request, const SeriesName& name, const RepeatedInput& input, bool keep_data);

}  // namespace ringlock::app
