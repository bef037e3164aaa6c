#include "analysis/closure/decide/verdict.hpp"

#include <algorithm>
#include <string_view>

namespace ringlock::closure {

std::string_view name_of(Verdict verdict) {
    switch (verdict) {
        case Verdict::nothing_missing:
            return "nothing_missing";
        case Verdict::closed:
            return "closed";
        case Verdict::unexplained:
            break;
    }
    return "unexplained";
}

std::string experiment_for(const effects::Effect& effect, const std::vector<const effects::Effect*>& others) {
    const auto has = [&](std::string_view name) {
        return effect.name() == name || std::any_of(others.begin(), others.end(), [&](const effects::Effect* other) {
                   return other->name() == name;
               });
    };
    if (has("dither_residue")) {
        return "declare the dither's frequency if the record does not, or record with another dither frequency or "
               "sampling rate";
    }
    if (has("bias_temperature") || has("lockin_temperature")) {
        return "record with the temperature changed against time: held, then stepped up and down";
    }
    if (has("scale_factor_error")) return "record at three input rates or more, of both signs";
    if (has("dither_asymmetry") && has("dither_second_harmonic")) {
        return "record the accelerations on both sides of the turns";
    }
    if (has("detector_phase_offset") || has("lockin_second_harmonic") || has("lockin_turn_asymmetry")) {
        return "record with more injected noise, so that all phases come at all turns, or for longer";
    }
    if (has("bias_step") || has("bias_ramp") || has("rate_random_walk") || has("bias_instability") ||
        has("quantum_noise")) {
        return "record for longer: their Allan deviations and their courses in time part with the averaging time";
    }
    return "record for longer";
}

Verdict verdict_of(const Closure& closure) {
    if (closure.unexplained) return Verdict::unexplained;
    return closure.steps.empty() ? Verdict::nothing_missing : Verdict::closed;
}

}  // namespace ringlock::closure
