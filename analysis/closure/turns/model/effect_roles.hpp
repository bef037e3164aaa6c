#pragma once
#include <string>
#include <vector>

#include "analysis/closure/decide/effect_queries.hpp"
#include "engine/effects/effect.hpp"

/// Effects of the library by the constants of a gyro that they change: which columns of a record show them, and which
/// parameter changes which constant. No effect is identified by its name, so that another one of the same kind is also
/// found.
namespace ringlock::closure {

/// Whether times, accelerations, the quadrature circle or the counter show the effect without the phases: the dither's
/// shape, the detectors, the counter.
bool estimated_from_other_columns(const effects::Effect& effect);

/// Whether parameters with this role are fitted to the phases. Those that other columns determine
/// (side_channels.hpp) are held.
bool is_fitted_in_phase(const effects::Effect& effect, effects::Role role);

/// Whether the effect changes the phases as they are read: the detectors or the counter. The record is then read again.
bool changes_reading(const effects::Effect& effect);

/// Whether the effect changes the kicks of the lock-in, whatever else it changes. Such an effect shows in the phases
/// alone.
bool is_of_coupling(const effects::Effect& effect);

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

/// Computed once, from the setups that the effects configure.
const EffectRoles& effect_roles();

}  // namespace ringlock::closure
