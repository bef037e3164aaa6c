#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/noise/fit.hpp"
#include "engine/dither/noise_effectiveness.hpp"
#include "engine/ensemble/ensemble.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/scenario.hpp"

/// A study of one scenario, or a point of a design: the ensemble simulated and every gyro's record analysed.
namespace ringlock::study {

/// Figures of one gyro's record of one arm.
struct GyroStatistics {
    std::vector<allan::Point> allan;  ///< at Study::factors
    noise::NoiseFit noise;
    double rate_error_deg_h = 0.0;  ///< mean output rate over the record less the input rate
    /// The same over infinite time, without simulation: where has_closed_form() and the dither has fringes enough.
    std::optional<double> rate_error_closed_form_deg_h;
    /// Of the arm `noise_injected`: rms change of the dither's amplitude from a turn to the next but one, rad of
    /// optical phase.
    double change_per_cycle_rad = 0.0;
    /// Angle turned beyond the input's at Study::angle_times_s; NaN where the record ends before.
    std::vector<double> angle_error_arcsec;
};

struct ArmStatistics {
    scenario::Arm arm;
    std::vector<GyroStatistics> gyros;
};

struct Study {
    explicit Study(const scenario::Scenario& what);

    scenario::Scenario scenario;
    ensemble::Schedule schedule;
    /// Averaging factors of the Allan deviations in outputs of the schedule: octaves, and those of output.tau_s and of
    /// the specification; ascending.
    std::vector<std::int64_t> factors;
    /// Times since the start of the record at which angle errors are computed: dither::spread_times_s, then those of
    /// the scenario's output, then that of the specification.
    std::vector<double> angle_times_s;
    /// Output at which the angle of one of these times is taken: the nearest one. A record of whole samples may end up
    /// to a sample before the requested duration; for a time that lies beyond its end by no more than that, the last
    /// output is taken. Absent for later times.
    std::optional<std::int64_t> angle_output(std::size_t time) const;
    std::vector<gyro::Setup> gyros;  ///< parameters as drawn
    std::vector<ArmStatistics> arms;
    std::optional<dither::NoiseEffectiveness> predicted_noise;  ///< of the arm `noise_injected`, by predict_noise()
    std::int64_t turns = 0;                                     ///< zero-rate points of distinct physical trajectories
    std::int64_t tables_remade = 0;           ///< turn maps made anew because a drive left their ranges
    std::int64_t contradictory_readings = 0;  ///< turns at which pulses and detectors contradicted each other
    double turn_map_error_rad = 0.0;          ///< largest error measured between the nodes of the turn maps
};

/// Bytes of memory that the study of a scenario takes, its design apart; estimated.
std::uint64_t expected_memory_bytes(const scenario::Scenario& scenario);

/// Whether the mean rate of the arm's gyros is known in closed form: a drive that repeats itself, and nothing
/// corrected.
bool has_closed_form(const scenario::Scenario& scenario, const scenario::Arm& arm);

/// Whether the arm has injected noise and no compensator, so that its statistics show the effect of the noise.
bool shows_noise(const scenario::Arm& arm);

/// Whether all gyros have one input rate, which does not change.
bool has_steady_input(const scenario::Scenario& scenario);

/// Predicts the effect of the injected noise, where an arm has injected noise and no compensator. May take some ten
/// seconds.
void predict_noise(Study& study);

/// Samples of the angle output of an arm that are handed to a caller: those of gyros first_gyro + i, i < gyros, from
/// sample first_sample on, [gyro][sample] in arcsec. From any thread.
struct SampledAngles {
    std::size_t study = 0;  ///< of those that run together
    std::size_t arm = 0;
    std::int64_t first_gyro = 0;
    std::size_t gyros = 0;
    std::int64_t first_sample = 0;
    std::vector<double> angle_arcsec;
};
using OnSamples = std::function<void(const SampledAngles& samples)>;

/// All that a finished block of gyros leaves, its samples apart.
struct FinishedBlock {
    std::size_t study = 0;  ///< of those that run together
    std::int64_t first_gyro = 0;
    std::vector<gyro::Setup> gyros;
    std::vector<std::vector<GyroStatistics>> arms;  ///< [arm][gyro of the block]
    std::int64_t turns = 0;                         ///< this and the rest as in Study
    std::int64_t tables_remade = 0;
    std::int64_t contradictory_readings = 0;
    double turn_map_error_rad = 0.0;
};

/// Puts the results of a finished block into its study. Each gyro must come once.
void take_up(Study& study, const FinishedBlock& block);

/// Keeps the results of one block. If it is destroyed before finish(), the block has failed and nothing of it is kept.
class BlockKeeper {
   public:
    virtual ~BlockKeeper() = default;
    virtual bool wants_samples() const = 0;
    /// Samples of an arm of the block, as they come, if wants_samples() is true.
    virtual void samples(const SampledAngles& samples) = 0;
    /// The block is done.
    virtual void finish(const FinishedBlock& block) = 0;
};

/// Makes the keeper of a block of gyros of one of the studies; called from the thread that simulates it.
using MakeKeeper =
    std::function<std::unique_ptr<BlockKeeper>(std::size_t study, std::int64_t first_gyro, std::size_t gyros)>;

/// A keeper that hands samples on and keeps nothing.
MakeKeeper hand_on(OnSamples on_samples);

/// Gyros [first, last) of one of several studies.
struct Stretch {
    std::size_t study = 0;
    std::int64_t first = 0;
    std::int64_t last = 0;

    bool operator==(const Stretch&) const = default;
};

/// Runs a study that is planned only, and returns it with its results. Statistics are taken while it runs: Allan
/// deviations from every output, noise coefficients from at most `fit_samples` of the samples; nothing grows with the
/// simulated time but the number of octaves. Throws RunError, Interrupted.
Study run(Study study, int threads, const OnSamples& on_samples = nullptr, const ensemble::Monitor& monitor = {});

/// Simulates some gyros of several studies side by side: the results of a gyro do not depend, to the bit, on the gyros
/// that are simulated with it. The effect of injected noise is not predicted.
void run(std::span<Study> studies, std::span<const Stretch> stretches, int threads, const MakeKeeper& make_keeper,
         const ensemble::Monitor& monitor);

/// predict_noise() of several studies on that many threads: some seconds each for the noise of a drive, during which
/// cancellation is not checked. It is a stage for the observer. Throws Interrupted.
void predict_noise(std::span<Study> studies, int threads, const ensemble::Monitor& monitor);

/// Makes room for more gyros; the results so far equal those of a study with that many gyros from the start. Without a
/// sweep only.
void extend(Study& study, std::int64_t gyros);

/// Most samples of a gyro that noise coefficients are fitted to: N is known to 1 % from as many.
inline constexpr std::int64_t fit_samples = 8192;

}  // namespace ringlock::study
