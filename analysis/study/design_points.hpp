#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "engine/scenario/check.hpp"
#include "engine/scenario/scenario.hpp"

/// From a scenario's design to the scenarios of its points.
namespace ringlock::study {

/// A key that varies, with its value at every point.
struct Axis {
    std::string key;   ///< "gyro.lockin_threshold_deg_h"
    std::string unit;  ///< "deg/h"
    std::vector<double> values;
};

/// The axes of the scenario's design; none where it has no design. Sensitivity designs have n (k + 2) points in the
/// order of design::sensitivity_points(). Throws InputError where complaints() are about the design itself.
std::vector<Axis> design_axes(const scenario::Scenario& scenario);

/// The scenario alone of one point, without a design.
scenario::Scenario scenario_at(const scenario::Scenario& scenario, const std::vector<Axis>& axes, std::size_t point);

/// Checks a study. Without a design these are the rules of the scenario. With a design they are the errors of the
/// design itself or, for a correct design, the rules that its points break: each rule once, with the points that break
/// it.
std::vector<scenario::Complaint> complaints(const scenario::Scenario& scenario);

}  // namespace ringlock::study
