#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/findings/finding.hpp"
#include "analysis/noise/fit.hpp"
#include "analysis/quantity/unit.hpp"
#include "app/coefficient_table.hpp"

namespace ringlock::app {

/// One deviation of the record.
struct DeviationOutput {
    allan::Estimator estimator = allan::Estimator::oadev;
    std::vector<allan::Point> points;
    std::vector<std::int64_t> without_terms;  ///< averaging factors of which gaps leave no term
};

/// Everything `ringlock allan` has to say.
struct AllanOutput {
    std::string data;
    std::string column;
    std::string kind;
    std::string input_unit;  ///< empty: dimensionless
    /// Where the input has a unit: decides the units of the deviations and of the noise coefficients.
    std::optional<quantity::Instrument> instrument;
    const WalkUnit* walk_unit = nullptr;  ///< of the random walk, where another than the usual one is asked for
    std::size_t n = 0;                    ///< data used
    std::size_t missing = 0;              ///< data that are missing among them
    bool streamed = false;                ///< sums with a stride of tau/8
    double tau0_s = 0.0;
    double confidence = 0.0;
    std::vector<DeviationOutput> deviations;
    std::vector<findings::Finding> findings;  ///< by row, counted from 0; sizes in the unit of the data
    std::optional<noise::NoiseFit> noise;
    /// A jump that explains the record as well as the rate random walk, which is not resolved then.
    std::optional<findings::Finding> jump_instead_of_walk;
    std::optional<std::size_t>
        noise_stretch;  ///< points of the part without gaps that was fitted, where there are gaps
    std::optional<std::int64_t> noise_thinning;  ///< samples from one to the next of those that were fitted, if not all
};

/// One JSON object and a newline; numbers that are not finite are null.
std::string allan_json(const AllanOutput& out);

/// Tables for people.
std::string allan_text(const AllanOutput& out);

}  // namespace ringlock::app
