#pragma once
#include <functional>
#include <string_view>
#include <vector>

#include "analysis/closure/types.hpp"
#include "engine/effects/effect.hpp"

/// Questions that both halves of the closed loop ask of an effect. The answers come from what the effect says of
/// itself, so that no effect is known by its name.
namespace ringlock::closure {

using Effects = std::vector<const effects::Effect*>;

/// How an effect shows on a record of uniform samples, which is how it is searched and fitted there.
enum class OnSamples {
    nothing,     ///< it acts on single turns only
    rate,        ///< a rate that is known but for its size
    step,        ///< a rate that begins at a time to be searched
    walk,        ///< a rate that is a random walk
    flicker,     ///< a rate that is a sum of Gauss-Markov processes
    white,       ///< white rate noise: part of the base model
    rate_line,   ///< a line in the input rate
    angle_line,  ///< a line in the angle that is put out
    motion,      ///< the case rotates
    resolution,  ///< readings in steps
    transport,   ///< readings taken at another rate than that of the record
    other,       ///< it shows, but in a way that nothing searches for
};
OnSamples on_samples(const effects::Effect& effect);

/// The effects of a library that show in this way, those of the fewest parameters first: the first is searched for, and
/// the others, of which samples show no more than that, are its alternatives.
Effects effects_that_show(OnSamples as, std::span<const effects::Effect* const> library = effects::registry());
/// The first of them or null.
const effects::Effect* first_that_shows(OnSamples as,
                                        std::span<const effects::Effect* const> library = effects::registry());

/// Number of effects of the library that show on samples: a search on samples chooses among so many.
double effects_on_samples();

/// A rate that changes slowly. Each of these can be taken for another, or for two others together.
bool is_slow_rate(const effects::Effect& effect);
bool is_line(const effects::Effect& effect);

/// A value of any parameter that shows in what an effect changes and is allowed.
inline constexpr double probe = 1e-3;

/// The standard gyro as an effect of these values changes it.
gyro::Setup configured(const effects::Effect& effect, const effects::Values& values);

/// Parameters of an effect at which it does nothing: sizes, deviations, probabilities and phases zero, the others at
/// their defaults.
effects::Values values_at_rest(const effects::Effect& effect);

/// Whether a parameter is a phase that does something while all sizes are zero, such as one of the coupling. Any other
/// phase turns the size before it.
bool is_own_phase(const effects::Effect& effect, const effects::Parameter& parameter);

/// A parameter that enters in proportion, about zero.
struct Amplitude {
    const effects::Parameter* value;      ///< a size, or a phase of its own
    const effects::Parameter* turned_by;  ///< phase with which the size makes two amplitudes; null where there is none
};
/// The amplitudes of the effect, in the order of its parameters.
std::vector<Amplitude> amplitudes_of(const effects::Effect& effect);

/// Whether the phases are proportional to the effect's sizes: it adds an angle, and changes nothing of the gyro.
bool changes_angle_only(const effects::Effect& effect);

/// Whether a larger effect contains a smaller one: with some of its amplitudes at zero it equals the smaller one. The
/// comparison evaluates the changes of both over several intervals, and the setups that both configure. An effect with
/// a random part neither contains another effect nor is contained in one.
bool contains(const effects::Effect& larger, const effects::Effect& smaller);

/// The values of the larger effect at which it is the smaller one at these, which it contains.
effects::Values values_as_larger(const effects::Effect& larger, const effects::Effect& smaller,
                                 const effects::Values& values);

/// The amplitudes of an effect for which one that it contains has no counterpart.
std::vector<Amplitude> in_addition(const effects::Effect& larger, const effects::Effect& smaller);

/// The effect's values with every size and deviation at one and the other parameters at their defaults.
effects::Values unit_values(const effects::Effect& effect);
/// Rotation [arcsec] over an interval that the effect adds at these values.
std::function<double(const effects::Interval&)> unit_angle(const effects::Effect& effect);
/// Rate [deg/h] that the effect adds per unit of its size where the temperature is one kelvin higher than assumed.
double rate_per_kelvin(const effects::Effect& effect);

/// The first parameter of that role; the effect must have one.
const effects::Parameter& parameter_of(const effects::Effect& effect, effects::Role role);
/// The parameter of that name; the effect must have one.
const effects::Parameter& parameter_of(const effects::Effect& effect, std::string_view name);
/// All parameters of that role, in the effect's order.
std::vector<const effects::Parameter*> parameters_of(const effects::Effect& effect, effects::Role role);
/// The value of a parameter.
double value_of(const effects::Values& values, const effects::Parameter& parameter);

/// Constants of a gyro that an effect changes, of which kind.
struct Configures {
    bool dither_shape = false;  ///< the dither's asymmetry or its second harmonic
    bool reading = false;       ///< the detectors or the counter
    bool coupling = false;      ///< the lock-in: its phase, its second harmonic, its threshold at either kind of turn
};
Configures configured_by(const effects::Effect& effect);

/// Converts the times and phases of an effect to a clock that begins `start_s` later. Earlier times become zero.
void set_back_clock(const effects::Effect& effect, effects::Values& values, double start_s);

/// A fitted parameter of an effect.
Estimate estimate_of(const effects::Effect& effect, std::string_view parameter, double value, double sd);

}  // namespace ringlock::closure
