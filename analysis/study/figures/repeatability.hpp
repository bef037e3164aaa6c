#pragma once
#include <optional>
#include <vector>

#include "analysis/lot/confidence.hpp"
#include "analysis/study/study.hpp"

/// How far the mean rates of a lot scatter, from gyro to gyro and from turn-on to turn-on.
namespace ringlock::study {

/// A standard deviation [deg/h] with its interval; exact for normal values.
struct Scatter {
    double sd_deg_h = 0.0;
    lot::Interval interval;
    std::int64_t degrees_of_freedom = 0;
};

/// Scatter of the rate averaged over the first after_s of the record, less the input's, over all gyros of an arm.
struct AverageScatter {
    double after_s = 0.0;
    Scatter scatter;
};

/// At Study::angle_times_s within the record, and over the whole of it. Empty with fewer than two gyros, and in sweeps.
std::vector<AverageScatter> scatter_of_averages(const Study& study, const ArmStatistics& arm);

/// Standard deviation of the mean rate over the record from turn-on to turn-on of one gyro (IEEE Std 647-2006 calls it
/// the bias repeatability): it is computed from the deviations from each gyro's mean, over all gyros. Absent where
/// gyros are switched on once.
std::optional<Scatter> turn_on_repeatability(const Study& study, const ArmStatistics& arm);

}  // namespace ringlock::study
