#include <algorithm>
#include <array>

#include "engine/effects/effect.hpp"

/// Every effect, one line each, in the order of their names; NAME.cpp defines `const Effect& NAME()`.
#define RINGLOCK_EFFECTS(X)   \
    X(base_vibration)         \
    X(bias_instability)       \
    X(bias_ramp)              \
    X(bias_step)              \
    X(bias_temperature)       \
    X(case_motion)            \
    X(count_quantization)     \
    X(detector_phase_offset)  \
    X(dither_asymmetry)       \
    X(dither_residue)         \
    X(dither_second_harmonic) \
    X(lockin_second_harmonic) \
    X(lockin_temperature)     \
    X(lockin_turn_asymmetry)  \
    X(missed_counts)          \
    X(mode_hop)               \
    X(null_shift_ramp)        \
    X(quantum_noise)          \
    X(rate_random_walk)       \
    X(readout_ellipse)        \
    X(resampling)             \
    X(scale_factor_error)

namespace ringlock::effects {

#define RINGLOCK_DECLARE(effect) const Effect& effect();
RINGLOCK_EFFECTS(RINGLOCK_DECLARE)
#undef RINGLOCK_DECLARE

std::span<const Effect* const> registry() {
#define RINGLOCK_ADDRESS(effect) &effect(),
    static const std::array all = {RINGLOCK_EFFECTS(RINGLOCK_ADDRESS)};
#undef RINGLOCK_ADDRESS
    return all;
}

const Effect* find(std::string_view name) {
    const auto all = registry();
    const auto found = std::find_if(all.begin(), all.end(), [name](const Effect* e) { return e->name() == name; });
    return found == all.end() ? nullptr : *found;
}

const Parameter* first_of(const Effect& effect, Role role) {
    const auto all = effect.parameters();
    const auto found = std::find_if(all.begin(), all.end(), [role](const Parameter& p) { return p.role == role; });
    return found == all.end() ? nullptr : &*found;
}

std::span<const std::string_view> planned() { return {}; }

}  // namespace ringlock::effects
