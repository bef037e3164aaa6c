#pragma once
#include <string>
#include <vector>

#include "engine/effects/effect.hpp"

/// Effects of the library by what they change in a gyro: which columns of a record show them, and which parameter is
/// which. No effect is known by its name, so that another one of the same kind is found as well.
namespace ringlock::closure {

/// Parameters of an effect at which it does nothing: sizes, deviations, probabilities and phases zero, the others at
/// their defaults.
effects::Values values_at_rest(const effects::Effect& effect);

/// Whether times, accelerations, the quadrature circle or the counter show the effect by themselves: the dither's
/// shape, the detectors, the counter.
bool told_by_other_columns(const effects::Effect& effect);

/// Whether the effect changes the phases as they are read: the detectors or the counter. The record is then read anew.
bool changes_reading(const effects::Effect& effect);

/// Whether the effect changes the kicks of the lock-in and is seen in the phases alone.
bool is_of_coupling(const effects::Effect& effect);

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

/// The first effect of the library that changes each of these constants of the gyro, with the names of the parameters
/// that do; null where the library has none.
struct EffectRoles {
    struct Asymmetry {
        const effects::Effect* effect = nullptr;
        std::string ratio;  ///< gyro::Setup::dither_asymmetry_ratio
    };
    struct Harmonic {
        const effects::Effect* effect = nullptr;
        std::string ratio, phase_rad;  ///< gyro::Setup::dither_harmonic_ratio and its phase
    };
    struct Ellipse {
        const effects::Effect* effect = nullptr;
        std::string gain, offset_sin, offset_cos, orthogonality_rad;  ///< gyro::Setup::ellipse
    };
    struct MissedCounts {
        const effects::Effect* effect = nullptr;
        std::string probability;  ///< gyro::Setup::missed_count_probability
    };
    Asymmetry asymmetry;
    Harmonic harmonic;
    Ellipse ellipse;
    MissedCounts missed_counts;
};

/// Found once, by the setups that the effects configure.
const EffectRoles& effect_roles();

}  // namespace ringlock::closure
