#include <fmt/format.h>

#include <array>
#include <cmath>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/fast_motion.hpp"
#include "engine/scenario/read_arms.hpp"
#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

Finding dither_reverses_the_rate(const Scenario& s) {
    const double asymmetry = largest_asymmetry(s);
    const double smallest =
        peak_rate_deg_h(s) * (1.0 - sigmas * s.ensemble.dither_amplitude_sd_relative) * (1.0 - asymmetry);
    const double swing = 1.0 - amplitude_change_relative(s.dither, simulated_s(s));
    for (const double rate : s.input.profile_rate_deg_h) {
        if (std::abs(rate) < 0.5 * smallest * swing) continue;
        return Complaint{{"input.profile_rate_deg_h", "dither.peak_rate_deg_s"},
                         fmt::format("the input rate of {:g} deg/h must stay below {:g} deg/h, half of the smallest "
                                     "peak rate of the dither (the rate must reverse in every half cycle)",
                                     rate, 0.5 * smallest * swing)};
    }
    const bool sweep = s.input.sweep_points > 1;
    const bool stop_is_larger = sweep && std::abs(s.input.sweep_stop_deg_h) > std::abs(s.input.rate_deg_h);
    const double rate = stop_is_larger ? s.input.sweep_stop_deg_h : s.input.rate_deg_h;
    if (std::abs(rate) < 0.5 * smallest) return {};
    std::vector<std::string> keys = with_keys_of_effects(
        s, {stop_is_larger ? "input.sweep_stop_deg_h" : "input.rate_deg_h", "dither.peak_rate_deg_s"},
        [](const gyro::Setup& a, const gyro::Setup& b) {
            return a.dither_asymmetry_ratio != b.dither_asymmetry_ratio;
        });
    keys.insert(keys.end(), {"ensemble.dither_asymmetry_sd_ratio", "ensemble.dither_amplitude_sd_relative"});
    return Complaint{std::move(keys),
                     fmt::format("the input rate of {:g} deg/h must stay below {:g} deg/h, half "
                                 "of the smallest peak rate of the dither (the rate must reverse in every half cycle)",
                                 rate, 0.5 * smallest)};
}

Finding dither_reverses_effects(const Scenario& s) {
    double certain = exposure(s).input_rate_deg_h;
    double random = 0.0;
    std::vector<RateOfKeys> rates;
    for (const EffectBounds& bounds : bounds_of_effects(s)) {
        const double rate = bounds.certain.rate_deg_h + sigmas * bounds.rate_sd_deg_h;
        if (rate == 0.0) continue;
        certain += bounds.certain.rate_deg_h;
        random = std::hypot(random, bounds.rate_sd_deg_h);
        rates.push_back({rate, keys_of(*bounds.effect)});
    }
    const double rate = certain + sigmas * random;
    const double swing = 1.0 - amplitude_change_relative(s.dither, simulated_s(s));
    const double smallest = peak_rate_deg_h(s) * (1.0 - sigmas * s.ensemble.dither_amplitude_sd_relative) *
                            (1.0 - largest_asymmetry(s)) * swing;
    constexpr double most = 0.9;
    if (rates.empty() || rate < most * smallest) return {};
    std::vector<std::string> keys = keys_by_rate(std::move(rates));
    for (const char* key :
         {"environment.temperature_ramp_k_per_h", "environment.temperature_swing_k",
          "environment.profile_temperature_k", "input.profile_rate_deg_h", "input.rate_deg_h", "input.sweep_stop_deg_h",
          "dither.peak_rate_deg_s", "ensemble.duration_s", "ensemble.settle_s"}) {
        keys.emplace_back(key);
    }
    return Complaint{std::move(keys),
                     fmt::format("effects take the rate to as much as {:g} deg/h within {:g} sigma, input included; "
                                 "it must stay below {:g} deg/h, {:g} of the smallest peak rate "
                                 "of the dither (the rate must reverse in every half cycle); "
                                 "make the effects smaller or the run shorter, or set a stronger dither",
                                 rate, sigmas, most * smallest, most)};
}

Finding turns_are_reached(const Scenario& s) {
    // 20000 steps of an eighth of a radian are 2500 rad, see zero_rate-inl.hpp.
    constexpr double most_rad = 2250.0;
    const double way_rad = way_to_turns_rad(s);
    if (way_rad <= most_rad) return {};
    std::vector<std::string> keys = keys_of_rates(s);
    for (const char* key : {"dither.peak_rate_deg_s", "dither.frequency_hz", "gyro.scale_factor_arcsec"}) {
        keys.emplace_back(key);
    }
    return Complaint{
        std::move(keys),
        fmt::format("input rate and effects move the turn of the phase away from that of the dither by up "
                    "to {:.4g} rad of phase, and the readout follows it for {:g} rad; lower the input rate "
                    "or the effects, or set another dither or scale factor that makes fewer fringes",
                    way_rad, most_rad)};
}

Finding amplitude_stays(const Scenario& s) {
    constexpr double most = 0.5;
    const double change = amplitude_change_relative(s.dither, simulated_s(s));
    if (change <= most) return {};
    return Complaint{{"dither.amplitude_wander_relative_rt_s", "dither.amplitude_drift_relative_per_h",
                      "ensemble.duration_s", "ensemble.settle_s"},
                     fmt::format("the dither's amplitude changes by up to {:g} of itself; it must not change by more "
                                 "than {:g} within {:g} sigma",
                                 change, most, sigmas)};
}

constexpr std::array all_rate_rules = {
    Rule{"The input rate, over the whole sweep, stays below half of the dither's smallest peak rate (six standard "
         "deviations of its spread and the asymmetry taken off), so that the rate reverses in every half cycle.",
         dither_reverses_the_rate},
    Rule{"Input rate and effects together, six standard deviations of random rates taken, "
         "stay below 0.9 of that peak rate over the run.",
         dither_reverses_effects},
    Rule{"Input rate and effects move the turn of the phase away from that of the dither by no more than 2250 rad "
         "of phase: the readout follows it up to there.",
         turns_are_reached},
    Rule{"Wander and drift of the dither's amplitude stay within half of it over the run, "
         "six standard deviations taken.",
         amplitude_stays},
};

}  // namespace

std::span<const Rule> rate_rules() { return all_rate_rules; }

}  // namespace ringlock::scenario
