#pragma once
#include <string>
#include <vector>

#include "analysis/report/map.hpp"
#include "analysis/stability/dynamic.hpp"
#include "app/allan/series.hpp"

namespace ringlock::app {

/// Deviations of one series over time windows.
struct DynamicOutput {
    allan::Estimator estimator = allan::Estimator::oadev;
    stability::Windows windows;
    std::vector<stability::WindowDeviation> of_windows;
};

/// The first deviation that was asked for, in windows of that length. Throws InputError, naming --dynamic, where a
/// window has fewer than eight sampling intervals or more than the record.
DynamicOutput dynamic_of(const AllanRequest& request, const AnalysedSeries& series, const std::string& window);

/// file, column, begin_s, end_s, deviation, m, tau_s, dev, lo, hi with their unit, terms.
std::string dynamic_csv(const std::vector<AllanOutput>& series, const std::vector<DynamicOutput>& dynamic);

/// Time along, averaging time up, the deviation as colour; a panel for each series.
report::Map dynamic_map(const std::vector<AllanOutput>& series, const std::vector<DynamicOutput>& dynamic);

}  // namespace ringlock::app
