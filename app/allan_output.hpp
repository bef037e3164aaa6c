#pragma once
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/noise/fit.hpp"

namespace ringlock::app {

/// Everything `ringlock allan` has to say.
struct AllanOutput {
    std::string data;
    std::string column;
    std::string kind;
    std::string input_unit;   ///< empty: dimensionless
    bool gyro = false;        ///< the input has a unit: deviations in deg/h (time errors in arcsec), noise fitted
    std::size_t n = 0;        ///< data used
    std::size_t missing = 0;  ///< data that are missing among them
    bool streamed = false;    ///< sums with a stride of tau/8
    double tau0_s = 0.0;
    double confidence = 0.0;
    std::vector<std::pair<allan::Estimator, std::vector<allan::Point>>> deviations;
    std::optional<noise::NoiseFit> noise;
    std::optional<std::size_t>
        noise_stretch;  ///< points of the part without gaps that was fitted, where there are gaps
    std::optional<std::int64_t> noise_thinning;  ///< samples from one to the next of those that were fitted, if not all
};

/// One JSON object and a newline; numbers that are not finite are null.
std::string allan_json(const AllanOutput& out);

/// Tables for people.
std::string allan_text(const AllanOutput& out);

}  // namespace ringlock::app
