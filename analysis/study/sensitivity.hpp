#pragma once
#include <string>
#include <vector>

#include "analysis/design/sensitivity.hpp"
#include "analysis/study/experiment.hpp"

/// Which keys of a design decide: Sobol' indices of the figures of a study.
namespace ringlock::study {

/// One figure of one arm.
struct SensitiveFigure {
    std::string name;  ///< "log_arw_deg_rt_h", "rate_error_deg_h", "log_allan_deviation_100_s_deg_h", "yield"
    design::OutputIndices indices;
};

struct ArmSensitivity {
    std::string arm;
    std::vector<SensitiveFigure> figures;
};

/// Indices of first and total order of each key of a design with sensitivity_base_points; empty for others.
///
/// An evaluation is the mean of a figure over the gyros of a point: the logarithm of the random walk, the mean rate
/// error, the logarithms of the requested Allan deviations, and the share that passes. Its noise is the standard error
/// of that mean, of two gyros and more.
std::vector<ArmSensitivity> sensitivity(const Experiment& experiment);

}  // namespace ringlock::study
