#pragma once
#include <functional>
#include <string_view>
#include <vector>

#include "analysis/closure/types.hpp"
#include "engine/effects/effect.hpp"

/// Questions on an effect that are common to records of turns and of samples. The answers follow from the effect's
/// own interface, so that no effect is identified by its name.
namespace ringlock::closure {

using Effects = std::vector<const effects::Effect*>;

/// How an effect shows on a record of uniform samples. This decides how it is searched and fitted there.
enum class OnSamples {
    nothing,     ///< it acts on single turns only
    rate,        ///< a rate that is known but for its size
    step,        ///< a rate that begins at a time to be searched
    walk,        ///< a rate that is a random walk
    flicker,     ///< a rate that is a sum of Gauss-Markov processes
    white,       ///< white rate noise: part of the base model
    rate_line,   ///< a line in the input rate
    angle_line,  ///< a line in the output angle
    motion,      ///< motion of the case
    resolution,  ///< readings in steps
    transport,   ///< readings taken at another rate than that of the record
    other,       ///< it shows, but no search exists for it
};
OnSamples on_samples(const effects::Effect& effect);

/// The effects of a library that show in this way, those with the fewest parameters first. The first is searched; the
/// others, which samples do not distinguish from it, are its alternatives.
Effects effects_that_show(OnSamples as, std::span<const effects::Effect* const> library = effects::registry());
/// The first of them or null.
const effects::Effect* first_that_shows(OnSamples as,
                                        std::span<const effects::Effect* const> library = effects::registry());

/// Number of effects of the library that show on samples, among which a search on samples chooses.
double effects_on_samples();

/// Whether the effect is a rate that changes slowly. Each of these can look like another, or like two others together.
bool is_slow_rate(const effects::Effect& effect);
bool is_line(const effects::Effect& effect);

/// A value of any parameter that is allowed and large enough to change the result of an effect.
inline constexpr double probe = 1e-3;

/// The standard gyro as the effect changes it at these values.
gyro::Setup configured(const effects::Effect& effect, const effects::Values& values);

/// Parameters at which the effect does nothing: sizes, deviations, probabilities and phases are zero, the others have
/// their defaults.
effects::Values values_at_rest(const effects::Effect& effect);

/// Whether a parameter is a phase that acts even if all sizes are zero, such as one of the coupling. Any other
/// phase is the phase of the size before it.
bool is_own_phase(const effects::Effect& effect, const effects::Parameter& parameter);

/// A parameter in which the effect is linear about zero.
struct Amplitude {
    const effects::Parameter* value;      ///< a size, or a phase that acts by itself
    const effects::Parameter* turned_by;  ///< phase with which the size makes two amplitudes; null if none
};
/// The amplitudes of the effect, in the order of its parameters.
std::vector<Amplitude> amplitudes_of(const effects::Effect& effect);

/// Whether the phases are proportional to the effect's sizes: it adds an angle, and does not change the gyro.
bool changes_angle_only(const effects::Effect& effect);

/// Whether a larger effect contains a smaller one: with some of its amplitudes at zero it equals the smaller one. The
/// comparison evaluates the changes of both over several intervals, and the setups that both configure. An effect with
/// a random part neither contains another effect nor is contained in one.
bool contains(const effects::Effect& larger, const effects::Effect& smaller);

/// Parameters of the larger effect at which it equals the smaller one, which it contains, at `values`.
effects::Values values_as_larger(const effects::Effect& larger, const effects::Effect& smaller,
                                 const effects::Values& values);

/// The amplitudes of the larger effect that have no counterpart in the smaller one, which it contains.
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

/// Kinds of constants of a gyro that an effect changes.
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
