#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "analysis/study/scale_factor.hpp"
#include "analysis/study/study.hpp"

namespace ringlock::study {

/// A figure over the ensemble; what the data do not show is absent.
struct Figure {
    std::optional<double> median;
    std::optional<double> lo;         ///< central 68.27 % of the gyros
    std::optional<double> hi;         ///< its upper end; a 95 % upper limit where there is no median
    std::optional<double> median_lo;  ///< bootstrap 95 % interval of the median
    std::optional<double> median_hi;
    std::int64_t resolved = 0;  ///< gyros whose record shows the figure by itself
};

struct MeanFigure {
    double mean = 0.0;
    double lo = 0.0;  ///< central 68.27 % of the gyros
    double hi = 0.0;
};

/// Allan deviation over the ensemble at one averaging time.
struct EnsemblePoint {
    double tau_s = 0.0;
    double dev_deg_h = 0.0;  ///< root of the mean Allan variance of the gyros
    double edf = 0.0;        ///< sum of the gyros'
    double lo = 0.0;         ///< 68.27 % chi-squared interval
    double hi = 0.0;
};

/// One rate of a sweep.
struct SweepPoint {
    double input_rate_deg_h = 0.0;
    MeanFigure output_rate_deg_h;
    std::int64_t locked = 0;  ///< gyros whose output moved by less than a fringe over the whole record
    bool can_tell = true;     ///< the input moves by more than a fringe, so that locked and free differ
    std::int64_t gyros = 0;
    /// Mean output rate over infinite time and the gyros, without simulation; see has_closed_form().
    std::optional<double> closed_form_rate_deg_h;
};

/// Rates of a sweep, next to each other, at which every gyro of the arm is locked to the same step of the staircase.
struct Step {
    std::int64_t order = 0;          ///< n: fringes a dither cycle
    double output_rate_deg_h = 0.0;  ///< n K w_D/(2 pi)
    double first_deg_h = 0.0;        ///< input rates, in the order of the sweep
    double last_deg_h = 0.0;
};

/// Angle random walk of arm `noise_injected` over that of another: what a cure takes away.
struct Reduction {
    std::optional<double> ratio;  ///< of the medians; absent where the other's is not resolved
    double lo = 0.0;              ///< from the medians' 95 % intervals, or from the other's upper limit
    std::optional<double> hi;     ///< absent where the other's interval begins at zero
};

/// One deviation of the Allan family, of an ensemble.
struct FamilyDeviation {
    allan::Estimator estimator = allan::Estimator::oadev;
    std::vector<EnsemblePoint> points;  ///< deg/h, time errors in arcsec; lo, hi and edf NaN where there are none
};

/// Effect of the injected noise, as predicted and as measured in the simulation.
struct NoiseFigures {
    dither::NoiseEffectiveness predicted;
    double change_per_cycle_percent = 0.0;  ///< as predicted, of the dither's amplitude
    struct Measured {
        double change_per_cycle_rad = 0.0;
        std::optional<double> arw_over_theory;  ///< median of the gyros
        std::optional<double> bias_deg_h;       ///< mean rate error, less that of `ideal` where there is such an arm
        double bias_error_deg_h = 0.0;          ///< its standard error
        std::vector<dither::AngleSpread> angle_spread;
    } measured;
};

struct ArmSummary {
    std::string name;
    std::int64_t gyros = 0;
    bool noise_injected = false;
    Figure arw_deg_rt_h;  ///< meaningful only where noise_injected
    std::optional<Figure> bias_instability_deg_h;
    MeanFigure rate_error_deg_h;
    std::vector<EnsemblePoint> allan;
    std::vector<SweepPoint> sweep;                    ///< empty without a sweep
    std::vector<Step> steps;                          ///< of the closed form, in the order of the sweep
    std::optional<ScaleFactor> scale_factor;          ///< of sweeps of three rates and more, with two gyros and more
    std::vector<FamilyDeviation> family;              ///< empty unless asked for
    std::optional<NoiseFigures> noise_effectiveness;  ///< of the arm `noise_injected`
    std::optional<Reduction> arw_reduction;           ///< of arms with injected noise other than `noise_injected`
};

struct Theory {
    double arw_deg_rt_h = 0.0;
    double arw_first_order_deg_rt_h = 0.0;  ///< in the kick
    double dead_band_deg_h = 0.0;
};

struct Summary {
    std::uint64_t seed = 0;
    std::int64_t turns = 0;
    std::vector<ArmSummary> arms;
    Theory theory;  ///< of the scenario's device without spread
};

/// Highest rate of the sweep up to which, from its first rate that can tell on, every gyro of the arm is locked; none
/// where the first is not.
std::optional<double> locked_up_to_deg_h(const ArmSummary& arm);

/// The root of the mean variance of some gyros, with the 68.27 % interval of their degrees of freedom together.
///
/// \param curves  one deviation curve a gyro, all of the same averaging times
std::vector<EnsemblePoint> ensemble_points(const std::vector<std::vector<allan::Point>>& curves);

/// Sums the study up. No noise is claimed for a locking arm without injected noise: its error is deterministic, a dead
/// band and a staircase, whatever spectrum it has. No bias instability is claimed unless most records resolve an Allan
/// floor. An angle random walk is claimed where noise is injected only.
Summary summarise(const Study& study);

}  // namespace ringlock::study
