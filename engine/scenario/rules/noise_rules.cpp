#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>
#include <string>

#include "engine/gyro/resonator.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/injected_noise.hpp"
#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

bool an_arm_injects_noise(const Scenario& s) {
    return std::any_of(s.arms.begin(), s.arms.end(), [](const Arm& arm) { return arm.noise_injected; });
}

Finding noise_leaves_the_dither(const Scenario& s) {
    if (!an_arm_injects_noise(s) || !amplitude_loop_is_stable(s)) return {};
    // Eight standard deviations of the amplitude leave half of it.
    const InjectedNoise noise = injected_noise(s);
    const double half_swing_rad = 0.5 * phase_amplitude_rad(s);
    if (noise.margin_rad <= half_swing_rad) return {};
    const double most_rad = noise.turn_rms_rad * half_swing_rad / noise.margin_rad;
    const bool relative = s.noise_injection.drive_noise_relative > 0.0;
    const std::string most =
        relative
            ? fmt::format("{:.4g} of the force", s.noise_injection.drive_noise_relative * most_rad / noise.turn_rms_rad)
            : fmt::format("{:.4g} rad", most_rad);
    return Complaint{{relative ? "noise_injection.drive_noise_relative" : "noise_injection.turn_phase_rms_rad",
                      "dither.peak_rate_deg_s", "dither.frequency_hz", "gyro.scale_factor_arcsec"},
                     fmt::format("noise of {:.4g} rad at the turns must not exceed {} (eight standard deviations "
                                 "of a half cycle's amplitude must leave half of it)",
                                 noise.turn_rms_rad, most)};
}

Finding noise_has_one_strength(const Scenario& s) {
    const NoiseInjection& noise = s.noise_injection;
    if (noise.drive_noise_relative == 0.0) return {};
    if (noise.turn_phase_rms_rad != 0.0) {
        return Complaint{{"noise_injection.drive_noise_relative"},
                         "the strength of the noise is given twice, here and by noise_injection.turn_phase_rms_rad; "
                         "leave one of them out"};
    }
    if (noise.model == NoiseModel::drive) return {};
    return Complaint{{"noise_injection.drive_noise_relative"},
                     "noise of a drive needs noise_injection.model = \"drive\"; "
                     "the model \"turns\" has its strength from noise_injection.turn_phase_rms_rad"};
}

Finding keys_of_a_drive_need_it(const Scenario& s) {
    const NoiseInjection& noise = s.noise_injection;
    const NoiseInjection plain;
    if (noise.model == NoiseModel::drive) return {};
    const auto needless = [](const char* key) {
        return Complaint{{std::string("noise_injection.") + key},
                         "has a meaning only with noise_injection.model = \"drive\"; set that, or leave the key out"};
    };
    if (noise.resonator_q != plain.resonator_q) return needless("resonator_q");
    if (noise.form != plain.form) return needless("form");
    if (noise.distribution != plain.distribution) return needless("distribution");
    if (noise.hold_half_cycles != plain.hold_half_cycles) return needless("hold_half_cycles");
    if (noise.modulation_hz != plain.modulation_hz) return needless("modulation_hz");
    if (noise.amplitude_loop_hz != plain.amplitude_loop_hz) return needless("amplitude_loop_hz");
    return {};
}

Finding loop_must_be_stable(const Scenario& s) {
    if (amplitude_loop_is_stable(s)) return {};
    return Complaint{
        {"noise_injection.amplitude_loop_hz", "noise_injection.resonator_q", "dither.frequency_hz"},
        "the amplitude loop is not stable: it corrects the force once in a half cycle and must be slow compared "
        "with that; a hundredth of the dither's frequency is slow enough"};
}

Finding drive_forgets_in_time(const Scenario& s) {
    if (s.noise_injection.model != NoiseModel::drive || !amplitude_loop_is_stable(s)) return {};
    constexpr double most = 2e6;  // some seconds of a block of gyros
    const double settling = gyro::Resonator(drive_noise(s)).settling_half_cycles();
    if (settling <= most) return {};
    return Complaint{{"noise_injection.amplitude_loop_hz", "noise_injection.resonator_q", "dither.frequency_hz"},
                     fmt::format("resonator and amplitude loop forget a deviation in {:.3g} half cycles, "
                                 "which every gyro goes through before its run; at most {:g} are allowed: "
                                 "set a faster loop, none (0), or a lower resonator_q",
                                 settling, most)};
}

Finding sinusoidal_noise_is_slow(const Scenario& s) {
    const NoiseInjection& noise = s.noise_injection;
    if (noise.model != NoiseModel::drive || noise.form != gyro::NoiseForm::sinusoidal) return {};
    if (noise.modulation_hz < s.dither.frequency_hz) return {};
    return Complaint{{"noise_injection.modulation_hz", "dither.frequency_hz"},
                     fmt::format("the modulation must be slower than the dither, {:g} Hz", s.dither.frequency_hz)};
}

Finding changing_amplitudes_need_moebius_maps(const Scenario& s) {
    const NoiseInjection& noise = s.noise_injection;
    if (!an_arm_injects_noise(s) || noise.model != NoiseModel::drive || noise.form == gyro::NoiseForm::white) return {};
    if (s.propagation.method != PropagationMethod::turn_map || configured_setup(s).lockin_second_ratio == 0.0)
        return {};
    return Complaint{{"noise_injection.model", "noise_injection.form", "propagation.method"},
                     "the turn map does not support a second harmonic of the coupling together with an amplitude "
                     "that changes over half cycles; set propagation.method = \"direct\", or leave the effect out"};
}

constexpr std::array all_noise_rules = {
    Rule{"Injected noise leaves at least half of each half cycle's swing within eight standard deviations (checked "
         "where an arm injects noise).",
         noise_leaves_the_dither},
    Rule{"The strength of injected noise is given once: by turn_phase_rms_rad, or for a drive by drive_noise_relative.",
         noise_has_one_strength},
    Rule{"Keys of a drive's noise need model = \"drive\".", keys_of_a_drive_need_it},
    Rule{"The amplitude loop of a drive is stable.", loop_must_be_stable},
    Rule{"Resonator and amplitude loop of a drive forget a deviation to 1e-9 within 2e6 half cycles.",
         drive_forgets_in_time},
    Rule{"A sinusoidal modulation of the drive is slower than the dither.", sinusoidal_noise_is_slow},
    Rule{"The turn map does not support a second harmonic of the coupling together with held "
         "or sinusoidal noise of a drive.",
         changing_amplitudes_need_moebius_maps},
};

}  // namespace

std::span<const Rule> noise_rules() { return all_noise_rules; }

}  // namespace ringlock::scenario
