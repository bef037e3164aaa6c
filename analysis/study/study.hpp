#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/noise/fit.hpp"
#include "engine/ensemble/ensemble.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/scenario.hpp"

/// A study: the ensemble simulated and every gyro's record analysed.
namespace ringlock::study {

/// What one gyro's record of one arm shows.
struct GyroStatistics {
    std::vector<allan::Point> allan;  ///< at Study::factors
    noise::NoiseFit noise;
    double rate_error_deg_h = 0.0;  ///< mean output rate over the record less the input rate
    /// The same over infinite time, without simulation: where has_closed_form() and the dither has fringes enough.
    std::optional<double> rate_error_closed_form_deg_h;
};

struct ArmStatistics {
    scenario::Arm arm;
    std::vector<GyroStatistics> gyros;
};

struct Study {
    explicit Study(const scenario::Scenario& what);

    scenario::Scenario scenario;
    ensemble::Schedule schedule;
    std::vector<std::int64_t> factors;  ///< averaging factors of the Allan deviations: octaves
    std::vector<gyro::Setup> gyros;     ///< parameters as drawn
    std::vector<ArmStatistics> arms;
    std::int64_t turns = 0;  ///< zero-rate points of distinct physical trajectories
    std::int64_t turns_off_table = 0;
    double turn_map_error_rad = 0.0;  ///< largest error measured between the nodes of the turn maps
};

/// Whether the mean rate of the arm's gyros is known in closed form: a drive that repeats itself, and nothing
/// corrected.
bool has_closed_form(const scenario::Scenario& scenario, const scenario::Arm& arm);

/// Allan deviations, noise coefficients and rate error of one record.
///
/// \param angle_arcsec  output angle, uniform
/// \param interval_s    sampling interval
GyroStatistics analyse_record(std::span<const double> angle_arcsec, double interval_s, double input_rate_deg_h,
                              std::span<const std::int64_t> factors);

/// Told when a gyro is done and analysed: its angle records, [arm][sample] in arcsec. From any thread.
using OnRecord = std::function<void(std::int64_t gyro, const std::vector<std::vector<double>>& angle_arcsec)>;

/// Runs the whole study. Throws RunError, Interrupted.
Study run(const scenario::Scenario& scenario, int threads, const OnRecord& on_record = nullptr,
          const ensemble::Monitor& monitor = {});

}  // namespace ringlock::study
