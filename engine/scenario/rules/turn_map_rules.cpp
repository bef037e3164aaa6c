#include <fmt/format.h>

#include <array>
#include <cmath>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/units.hpp"
#include "engine/scenario/fast_motion.hpp"
#include "engine/scenario/injected_noise.hpp"
#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

/// Largest first-order kick of one turn, kappa = 2 pi Omega_L / sqrt(K Omega_D w_D).
double kick_rad(const Scenario& s) {
    return units::two_pi * s.gyro.lockin_threshold_deg_h /
           std::sqrt(s.gyro.scale_factor_arcsec * peak_rate_deg_h(s) * dither_rad_s(s));
}

Finding turn_map_has_fringes(const Scenario& s) {
    constexpr double fewest = 10.0;
    const double fringes = phase_amplitude_rad(s) / units::pi;
    if (s.propagation.method != PropagationMethod::turn_map || fringes >= fewest) return {};
    return Complaint{
        {"dither.peak_rate_deg_s", "dither.frequency_hz", "gyro.scale_factor_arcsec", "propagation.method"},
        fmt::format("{:.3g} fringes in a half cycle of the dither; "
                    "the turn map needs at least {:g} (turns must be far apart in phase); "
                    "set propagation.method = \"direct\" or a stronger dither",
                    fringes, fewest)};
}

Finding turn_map_has_small_kicks(const Scenario& s) {
    constexpr double largest = 1.0;
    const double kick = kick_rad(s);
    if (s.propagation.method != PropagationMethod::turn_map || kick < largest) return {};
    return Complaint{
        {"gyro.lockin_threshold_deg_h", "dither.peak_rate_deg_s", "dither.frequency_hz", "gyro.scale_factor_arcsec",
         "propagation.method"},
        fmt::format("lock-in moves the phase by up to {:.3g} rad at a turn; "
                    "the turn map needs less than {:g} rad; set propagation.method = \"direct\" or a stronger dither",
                    kick, largest)};
}

/// Advice for a scenario whose turn map does not exist or cannot be tabulated.
std::string way_without_tables(const Scenario& s) {
    return s.propagation.method == PropagationMethod::turn_map
               ? "set propagation.method = \"direct\""
               : "leave out the arms with compensated_exact and compensated_adaptive, which invert the turn map";
}

Finding turn_map_has_fast_middles(const Scenario& s) {
    if (!amplitude_loop_is_stable(s) || fast_middles(s)) return {};
    std::vector<std::string> keys = keys_of_rates(s);
    for (const char* key :
         {"noise_injection.turn_phase_rms_rad", "dither.peak_rate_deg_s", "dither.frequency_hz",
          "gyro.scale_factor_arcsec", "gyro.lockin_threshold_deg_h", "calibration.threshold_error_relative",
          "ensemble.dither_amplitude_sd_relative", "ensemble.dither_asymmetry_sd_ratio",
          "ensemble.lockin_threshold_sd_relative", "arms.names", "propagation.method"}) {
        keys.emplace_back(key);
    }
    return Complaint{
        std::move(keys),
        fmt::format("the phase can go through too few fringes between a zero-rate point "
                    "and the middle of a half cycle for the turn map, which needs 10 rad there, after injected noise, "
                    "effects and the spread of the gyros have taken their part; {} or a stronger dither",
                    way_without_tables(s))};
}

Finding turn_map_has_narrow_tables(const Scenario& s) {
    if (!amplitude_loop_is_stable(s) || tables_hold_the_tolerance(s)) return {};
    std::vector<std::string> keys = keys_of_rates(s);
    for (const char* key : {"noise_injection.turn_phase_rms_rad", "noise_injection.drive_noise_relative",
                            "dither.amplitude_wander_relative_rt_s", "dither.amplitude_drift_relative_per_h",
                            "propagation.turn_map_tolerance_rad", "dither.peak_rate_deg_s", "dither.frequency_hz",
                            "gyro.scale_factor_arcsec", "arms.names", "propagation.method"}) {
        keys.emplace_back(key);
    }
    return Complaint{
        std::move(keys),
        fmt::format("the tables of the turn map cannot hold a tolerance of {:g} rad over the amplitudes "
                    "and rates that they must cover: at a high input rate the phase at which the rate reverses moves "
                    "by many radians with either (docs/dev/turn-map.md); lower the input rate or the variation "
                    "of rate and amplitude, raise propagation.turn_map_tolerance_rad or {}",
                    s.propagation.turn_map_tolerance_rad, way_without_tables(s))};
}

constexpr std::array all_turn_map_rules = {
    Rule{"The turn map needs at least 10 fringes in a half cycle: 2 Omega_D / (K w_D) >= 10.", turn_map_has_fringes},
    Rule{"The turn map needs kicks below 1 rad: 2 pi Omega_L / sqrt(K Omega_D w_D) < 1.", turn_map_has_small_kicks},
    Rule{"The turn map needs a phase that goes through at least 10 rad from a zero-rate point to the middle "
         "of the half cycle, and a rate there of at least 4 b (b: coupling), after rates, injected noise, "
         "effects, the spread of the gyros and the room of the tables have taken their part (docs/dev/turn-map.md).",
         turn_map_has_fast_middles},
    Rule{"The tables of the turn map hold turn_map_tolerance_rad, by an estimate on the safe side, "
         "over the rates of 128 turns and the amplitudes that noise, wander and drift make: "
         "the wider these and the higher the input rate, the more terms it takes (docs/dev/turn-map.md).",
         turn_map_has_narrow_tables},
};

}  // namespace

std::span<const Rule> turn_map_rules() { return all_turn_map_rules; }

}  // namespace ringlock::scenario
