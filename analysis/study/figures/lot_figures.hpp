#pragma once
#include <string>
#include <vector>

#include "analysis/lot/pairs.hpp"
#include "analysis/lot/quantile.hpp"
#include "analysis/lot/share.hpp"
#include "analysis/study/study.hpp"

/// Figures of a study's gyros as a lot: quantiles, the share that passes a specification, arms in pairs.
namespace ringlock::study {

/// Quantiles of one figure over the gyros of an arm.
struct LotFigure {
    std::string name;                      ///< with its unit, as in JSON
    std::vector<lot::Quantile> quantiles;  ///< 5, 50, 95 %
};

/// One limit of a specification.
struct LimitYield {
    std::string name;   ///< key of [specification]
    double most = 0.0;  ///< the limit
    lot::Share share;   ///< gyros within it
};

/// Gyros of an arm that pass, each judged by its own record: a record of finite length scatters, and that belongs to
/// it.
struct Yield {
    lot::Share share;  ///< within all limits
    std::vector<LimitYield> limits;
    std::string fails_most;  ///< the limit that most gyros miss; empty where all pass
};

/// Random walks of two arms, gyro by gyro.
struct ArmPair {
    std::string first, second;
    lot::Comparison arw_deg_rt_h;
};

/// Confidence of a study's intervals over its gyros: 95 %, wider where a stopping rule chose the number of gyros.
lot::Confidence confidence_of(const scenario::Scenario& scenario);

/// Random walks of the gyros [deg/sqrt(h)], in the model that all records together select; medians, quantiles and
/// yields are computed from them.
std::vector<double> random_walks_deg_rt_h(const ArmStatistics& arm);

/// One figure of every gyro of an arm; NaN where its record does not have it.
struct LotValues {
    std::string name;  ///< with its unit
    std::vector<double> values;
};

/// Random walk, mean rate error, deviations at the requested averaging times, and angle errors.
std::vector<LotValues> lot_values(const Study& study, const ArmStatistics& arm);

/// Which gyros meet the scenario's specification; in a sweep, at every rate. One value a gyro, not one a row.
std::vector<bool> passed_gyros(const Study& study, const ArmStatistics& arm);

/// Quantiles of random walk, mean rate error, deviations at the requested averaging times, and angle errors.
std::vector<LotFigure> lot_figures(const Study& study, const ArmStatistics& arm);

/// The share of passed_gyros(), and of each limit by itself. A figure that a record does not have (NaN) does not pass.
Yield yield_of(const Study& study, const ArmStatistics& arm);

}  // namespace ringlock::study
