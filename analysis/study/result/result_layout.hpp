#pragma once
#include <fmt/format.h>

#include <limits>
#include <string>

#include "analysis/study/experiment.hpp"
#include "engine/store/hdf5.hpp"

/// Layout that writer and reader of result files share.
namespace ringlock::study::layout {

inline constexpr const char* format_name = "ringlock-result";
inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Name of the dataset with an arm's predicted spread of angles after that time.
inline std::string spread_figure(double after_s) { return fmt::format("predicted_angle_spread_{:g}_s", after_s); }

/// Whether the file is a result, of any version.
bool is_result(const store::File& file);

/// Averaging times of the point that has most of them; rows of points with fewer times end with NaN, or 0 for types
/// without NaN.
std::size_t most_taus(const Experiment& experiment);

/// Shape of a dataset with one value for each averaging time: [taus], or [points][taus] in a design.
store::Shape tau_shape(const Experiment& experiment);

}  // namespace ringlock::study::layout
