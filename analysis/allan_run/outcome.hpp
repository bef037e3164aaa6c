#pragma once
#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan_run/coefficient_table.hpp"
#include "analysis/findings/cleaned.hpp"
#include "analysis/findings/finding.hpp"
#include "analysis/noise/fit.hpp"
#include "analysis/quantity/unit.hpp"

/// The Allan analysis of one series, from its values to the object of `ringlock allan --json`.
namespace ringlock::allan_run {

/// One deviation of the record.
struct DeviationOutput {
    allan::Estimator estimator = allan::Estimator::oadev;
    std::vector<allan::Point> points;
    std::vector<std::int64_t> without_terms;  ///< averaging factors of which gaps leave no term
};

/// Everything that `ringlock allan` reports on a series.
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
    std::vector<std::size_t> finding_lines;  ///< of the file, from 1; 0 where there is none, empty where there are none
    std::optional<findings::Cleaned> cleaned;  ///< where the deviations are of the data without the findings
    std::size_t wraps_undone = 0;              ///< in the deviations
    std::optional<noise::NoiseFit> noise;
    /// A jump that explains the record as well as the rate random walk, which is not resolved then.
    std::optional<findings::Finding> jump_instead_of_walk;
    /// Where there are gaps: data that were fitted, or points of the longest part without gaps if only that was.
    std::optional<std::size_t> noise_stretch;
    std::optional<std::size_t> noise_filled_in;  ///< missing data among those, if all data were fitted
    std::optional<std::int64_t> noise_thinning;  ///< samples from one to the next of those that were fitted, if not all
};

/// The JSON object of one series; numbers that are not finite are null.
nlohmann::ordered_json allan_object(const AllanOutput& out);

/// An estimate in another unit.
noise::Estimate times(const noise::Estimate& estimate, double factor);
noise::Coefficient times(noise::Coefficient coefficient, double factor);

/// The random walk of the fit in the unit that was asked for.
noise::Coefficient walk_in(const WalkUnit& unit, const noise::NoiseFit& fit);

/// Line of the file of finding `i`; 0 where it has none.
std::size_t line_of(const AllanOutput& out, std::size_t i);

}  // namespace ringlock::allan_run
