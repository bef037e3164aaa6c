#pragma once
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/gyro/setup.hpp"
#include "engine/random/normal_lanes.hpp"
#include "engine/random/stream.hpp"
#include "engine/simd/lanes.hpp"

/// Effects beyond the base equation. One file each, one line in registry.cpp.
namespace ringlock::effects {

/// How a parameter enters the output of a gyro, which determines how a fit to a record finds it.
enum class Role {
    size,   ///< proportionally, about zero
    phase,  ///< phase of the size before it, with which it makes two amplitudes, size cos(phase) and size sin(phase),
            ///< that enter proportionally; of the lock-in threshold where no size stands before it
    time,   ///< time of an event: the fit must search over it
    frequency,  ///< the fit must search over it
    deviation,  ///< standard deviation of a random process: its square enters variances proportionally
    probability,
    sampled,  ///< of an effect on uniform samples, 0 without the effect: found from these samples alone
    setting,  ///< any other way
};

/// One parameter of an effect: its name carries the unit, as in a scenario's [effects.NAME] table.
struct Parameter {
    std::string_view name;
    double default_value;  ///< value of an effect that the scenario does not turn on
    double min;
    double max;
    Role role;
    std::string_view doc;  ///< one line
    /// Size that comes with the typical sizes of the effect's other parameters, to an order of magnitude: a record in
    /// which that size would be invisible does not decide whether the effect is present. Zero where sizes have no
    /// typical proportion.
    double typical = 0.0;
};

/// The value of every parameter of one effect.
using Values = std::map<std::string, double>;

/// A stretch of time and the exposure of a gyro in it: values at both ends, linear between them.
struct Interval {
    double start_s = 0.0;  ///< since the start, of the run or of the record
    double duration_s = 0.0;
    double temperature_change_k[2] = {0.0, 0.0};  ///< temperature less that at the start
    double input_rate_deg_h[2] = {0.0, 0.0};      ///< of the case, the dither apart
};

/// Deterministic change of a gyro by an effect over an interval. Angles of intervals that follow each other add up.
/// Threshold and phase of the coupling are those in the middle of the interval. The engine keeps both constant over
/// each half cycle of the dither and evaluates them at the instant in its middle: an interval without duration, both
/// ends of which are alike.
struct Change {
    double angle_arcsec = 0.0;        ///< rotation that the output gains
    double threshold_factor = 1.0;    ///< of the lock-in threshold
    double coupling_phase_rad = 0.0;  ///< by which the whole coupling moves: F(psi) becomes F(psi + phase)

    bool operator==(const Change&) const = default;
};

/// The change over an interval: a pure function of it.
using ChangeOver = std::function<Change(const Interval&)>;

/// The members of Change that an effect can set; the others keep their defaults.
struct Changes {
    bool angle = false;
    bool threshold = false;
    bool coupling_phase = false;
};

/// A stationary random rate of exponential autocorrelation, variance exp(-|t|/time).
struct GaussMarkov {
    double time_s = 0.0;
    double variance_deg2_h2 = 0.0;
};

/// A random rate as the sum of independent ones; 1 deg/h is 1 arcsec/s.
struct RateNoise {
    /// White: two-sided power spectral density of the rate [(deg/h)^2 s]. The angle after t has the variance density t
    /// [arcsec^2]; the density of an angle random walk of N deg/sqrt(h) is 3600 N^2.
    double white_deg2_h2_s = 0.0;
    /// Random walk of the rate, from zero at the start: growth of its variance in time [(deg/h)^2/s]. That of K
    /// (deg/h)/sqrt(h) is K^2/3600.
    double walk_deg2_h2_per_s = 0.0;
    std::vector<GaussMarkov> terms = {};  ///< in the order of their times
};

/// Variance of the angle [arcsec^2] that the rate adds in the first `duration_s` after the start.
double angle_variance_arcsec2(const RateNoise& noise, double duration_s);

/// Standard deviation [deg/h] of the rate's mean over `average_s` at the end of a run of `duration_h`, or a little
/// more: for rates that remember longer than that mean lasts, the standard deviation of the rate itself is taken.
double rate_sd_deg_h(const RateNoise& noise, double average_s, double duration_h);

/// The most that a gyro is exposed to over a run.
struct Exposure {
    double duration_h = 0.0;
    double temperature_change_k = 0.0;       ///< largest magnitude of the temperature less that at the start
    double temperature_slope_k_per_h = 0.0;  ///< largest magnitude
    double input_rate_deg_h = 0.0;           ///< largest magnitude, the dither apart
    double input_slope_deg_h_s = 0.0;        ///< largest magnitude: change of that rate in a second
};

/// How far an effect can take a gyro, chance apart: magnitudes that Change does not exceed at any time of a run.
struct Bounds {
    double rate_deg_h = 0.0;  ///< of the angle over the duration
    /// Bound of the slope of that rate [deg/h each second]; absent for a rate that steps, or whose slope is not needed.
    std::optional<double> rate_slope_deg_h_s = {};
    double threshold_relative = 0.0;  ///< of the threshold's factor less one
    double coupling_phase_rad = 0.0;
};

/// A random rate, given as the angle it adds.
class RateProcess {
   public:
    virtual ~RateProcess() = default;
    /// Rotation [arcsec] added between `start_s` and `start_s + duration_s`. Called with consecutive intervals, once
    /// each.
    virtual double angle_arcsec(double start_s, double duration_s) = 0;
};

/// Consecutive intervals of time of a block of gyros: [interval][gyro].
struct LaneIntervals {
    std::size_t lanes = simd::lanes;  ///< gyros of the block
    std::uint64_t first = 0;          ///< number of the first interval since the start of the run
    std::span<const simd::Lanes> start_s;
    std::span<const simd::Lanes> duration_s;
};

/// A rate that varies in time, of a block of gyros.
class LaneRateProcess {
   public:
    virtual ~LaneRateProcess() = default;
    /// Adds the rotation [arcsec] of each interval to `angle_arcsec`. Called with consecutive intervals, once each.
    virtual void add_angles(const LaneIntervals& intervals, std::span<simd::Lanes> angle_arcsec) = 0;
};

/// Angle increments on their way into a record of uniform samples, and the reference channels (witnesses) next to the
/// gyro.
struct Sampled {
    double rate_hz = 0.0;    ///< of the increments
    double record_hz = 0.0;  ///< of the record that they end in
    double start_s = 0.0;    ///< where the first increment begins, since the start of the run
    std::vector<double> increment_arcsec = {};
    std::map<std::string, std::vector<double>> witnesses =
        {};  ///< by their names in a record, as long as the increments
};

/// Change of the samples of one gyro.
class SampleStage {
   public:
    /// Stages act in this order, independently of their names.
    enum class Place {
        motion,      ///< the case rotates
        output,      ///< something is added to the angle that is put out
        resolution,  ///< the angle becomes numbers
        transport,   ///< the numbers become a record
    };
    virtual ~SampleStage() = default;
    virtual Place place() const = 0;
    /// Rate at which samples are taken for a record of that rate.
    virtual double source_hz(double record_hz) const { return record_hz; }
    virtual void apply(Sampled& samples) const = 0;
};

/// The quantity that drives an effect which is not random: in order to distinguish effects with different drivers,
/// these quantities must be changed independently of each other.
enum class Follows {
    nothing,      ///< none of these: constants of the gyro, lines, random rates
    time,         ///< the time since the start
    temperature,  ///< the temperature less that at the start
    input_rate,   ///< the rotation that the gyro is to measure
};

/// An effect: its name, its parameters, and its action on a gyro.
class Effect {
   public:
    virtual ~Effect() = default;
    virtual std::string_view name() const = 0;
    virtual std::string_view summary() const = 0;   ///< one line
    virtual std::string_view equation() const = 0;  ///< plain text, with its source
    /// Advice for the test bench where the effect was found: one or two sentences.
    virtual std::string_view advice() const = 0;
    virtual std::span<const Parameter> parameters() const = 0;
    /// True where these values do something.
    virtual bool active(const Values& values) const = 0;
    /// Changes constants of the gyro. The default does nothing.
    virtual void configure(const Values& /*values*/, gyro::Setup& /*setup*/) const {}
    /// The members that change() sets.
    virtual Changes changes() const { return {}; }
    bool adds_angle() const { return changes().angle; }
    /// The deterministic change by the effect as a function of time.
    virtual ChangeOver change(const Values& /*values*/) const {
        return [](const Interval&) { return Change{}; };
    }
    /// How far change() can go under that exposure.
    virtual Bounds bounds(const Values& /*values*/, const Exposure& /*exposure*/) const { return {}; }
    /// The random rate that rate_process() draws from.
    virtual RateNoise rate_noise(const Values& /*values*/) const { return {}; }
    /// A random rate for one gyro, or null where the effect has none.
    virtual std::unique_ptr<RateProcess> rate_process(const Values& /*values*/, const random::Identity& /*who*/) const {
        return nullptr;
    }
    /// The same for the first `lanes` gyros of a block, with the same angles: one rate_process() a gyro, unless the
    /// effect has something faster.
    virtual std::unique_ptr<LaneRateProcess> lane_rate_process(const Values& values, const random::LaneIdentities& who,
                                                               std::size_t lanes) const;
    /// The quantity that drives the effect.
    virtual Follows follows() const { return Follows::nothing; }
    /// Where sample_stage() acts; none where the effect has no such stage.
    virtual std::optional<SampleStage::Place> sample_place() const { return std::nullopt; }
    /// The additional change of uniform samples by the effect, or null.
    virtual std::unique_ptr<SampleStage> sample_stage(const Values& /*values*/, const random::Identity& /*who*/) const {
        return nullptr;
    }
};

/// All effects this program can simulate, in the order of their names.
std::span<const Effect* const> registry();

/// The effect of that name or null.
const Effect* find(std::string_view name);

/// The first parameter of that role or null.
const Parameter* first_of(const Effect& effect, Role role);

/// Names of effects that are planned but cannot be simulated yet, in order.
std::span<const std::string_view> planned();

}  // namespace ringlock::effects
