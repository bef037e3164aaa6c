#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "analysis/stability/three_cornered_hat.hpp"
#include "app/allan/series.hpp"

namespace ringlock::app {

/// The three-cornered hat of three series by each deviation that was asked for.
struct HatOutput {
    struct OfEstimator {
        allan::Estimator estimator;
        std::vector<stability::HatPoint> points;
    };
    std::vector<std::string> names;  ///< of the series, not yet printable()
    std::string unit;                ///< of the deviations; empty where they have none
    std::string integral_unit;       ///< of deviations of time, likewise
    std::vector<OfEstimator> by_estimator;
};

/// Throws InputError where there are not three series with one time base (sampling interval and number of data), or a
/// deviation is asked for that is no variance of differences (mtie, tierms).
HatOutput hat_of(const AllanRequest& request, const std::vector<AnalysedSeries>& series);

std::string hat_text(const HatOutput& hat);

/// For each estimator a list of `m`, `tau_s` and `series`: `variance`, `standard_error`, `dev`, `lo`, `hi` of each, dev
/// null where the variance is negative.
nlohmann::ordered_json hat_object(const HatOutput& hat);

}  // namespace ringlock::app
