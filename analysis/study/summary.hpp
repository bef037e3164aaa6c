#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/lot/mean.hpp"
#include "analysis/study/figures/lot_figures.hpp"
#include "analysis/study/figures/repeatability.hpp"
#include "analysis/study/figures/scale_factor.hpp"
#include "analysis/study/study.hpp"

namespace ringlock::study {

/// A figure over the ensemble; values that the data do not resolve are absent.
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
    /// Gyros whose output moved over the whole record by less than a fringe and the residue of a reader's dither.
    std::int64_t locked = 0;
    bool can_tell = true;  ///< the input moves by more than that, so that locked and free differ
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

/// Angle random walk of arm `noise_injected` over that of another: the factor by which a compensator reduces it.
struct Reduction {
    std::optional<double> ratio;  ///< of the medians; absent where the other's is not resolved
    double lo = 0.0;              ///< from the medians' 95 % intervals, or from the other's upper limit
    std::optional<double> hi;     ///< absent where the other's interval begins at zero
};

/// One deviation of the Allan family, of an ensemble.
struct FamilyDeviation {
    allan::Estimator estimator = allan::Estimator::oadev;
    std::vector<EnsemblePoint> points;  ///< deg/h, time errors in arcsec; lo, hi and edf are NaN for deviations without
                                        ///< interval
};

/// Effect of the injected noise, as predicted and as measured in the simulation.
struct NoiseFigures {
    dither::NoiseEffectiveness predicted;
    /// Why the turns are not at random phases, by the prediction: a random walk that is off by a tenth, or a bias
    /// larger than the contribution of the random walk to a mean over an hour. Empty where the turns are at random
    /// phases, and where nothing was predicted.
    std::string not_randomised;
    double change_per_cycle_percent = 0.0;  ///< as predicted, of the dither's amplitude
    struct Measured {
        double change_per_cycle_rad = 0.0;
        /// Median of the gyros over that of turns at random phases, declared noises taken off in squares.
        std::optional<double> arw_over_theory;
        std::optional<double> bias_deg_h;  ///< mean rate error, less that of `ideal` where there is such an arm
        double bias_error_deg_h = 0.0;     ///< its standard error
        std::vector<dither::AngleSpread> angle_spread;
    } measured;
};

/// The angle random walk that an arm would have without a compensator, part by part; independent, so that squares add.
struct ArwTheory {
    double lockin_deg_rt_h = 0.0;  ///< of turns at independent random phases; 0 where no noise is injected
    std::vector<std::pair<std::string, double>> effects_deg_rt_h;  ///< white rate noise of the effects, by their names
    double total_deg_rt_h = 0.0;
};

struct ArmSummary {
    std::string name;
    std::int64_t gyros = 0;
    bool noise_injected = false;
    Figure arw_deg_rt_h;
    std::string arw_reason;  ///< why arw_deg_rt_h has no median; empty where it has one
    ArwTheory arw_theory;
    std::vector<LotFigure> lot;                    ///< quantiles over the gyros; empty in sweeps
    lot::GeometricMean arw_mean_deg_rt_h;          ///< where arw_deg_rt_h has a median
    std::vector<AverageScatter> scatter;           ///< of averages over given times, from gyro to gyro
    std::optional<Scatter> turn_on_repeatability;  ///< where gyros are switched on more than once
    std::optional<Yield> yield;                    ///< where the scenario has a specification
    std::optional<Figure> bias_instability_deg_h;
    MeanFigure rate_error_deg_h;
    std::vector<EnsemblePoint> allan;
    std::vector<SweepPoint> sweep;                    ///< empty without a sweep
    std::vector<Step> steps;                          ///< of the closed form, in the order of the sweep
    std::optional<ScaleFactor> scale_factor;          ///< of sweeps of three rates and more, with two gyros and more
    std::vector<FamilyDeviation> family;              ///< empty unless requested
    std::vector<EnsemblePoint> asked;                 ///< of stored samples, at requested times; empty unless requested
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
    std::vector<ArmPair> pairs;  ///< of arms whose gyros have random walks, each with each that follows it
    Theory theory;               ///< of the scenario's device without spread
};

/// Whether the arm has a random walk or an upper limit of it.
bool has_arw(const ArmSummary& arm);

/// Whether rates of the arm's sweep are known in closed form.
bool has_closed_form(const ArmSummary& arm);

/// Highest rate of the sweep up to which every gyro of the arm is locked, counted from the first rate that is large
/// enough to distinguish a locked gyro from a turning one; absent where a gyro is not locked at that rate.
std::optional<double> locked_up_to_deg_h(const ArmSummary& arm);

/// The root of the mean variance of some gyros, with the 68.27 % interval of their degrees of freedom together.
///
/// \param curves  one deviation curve a gyro, all of the same averaging times
std::vector<EnsemblePoint> ensemble_points(const std::vector<std::vector<allan::Point>>& curves);

/// Sums the study up. An angle random walk is claimed where the records of an arm show white rate noise. None is
/// claimed for a locking arm on which no white rate noise acts, injected or declared, and that no compensator corrects:
/// its error is deterministic, a dead band and a staircase, regardless of its spectrum. No bias instability is claimed
/// unless most records resolve an Allan floor, and none for arms without injected noise but `ideal`.
Summary summarise(const Study& study);

}  // namespace ringlock::study
