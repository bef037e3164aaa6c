#include "engine/scenario/fast_motion.hpp"

#include <algorithm>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/gyro/device.hpp"
#include "engine/gyro/fast_motion.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/injected_noise.hpp"

namespace ringlock::scenario {

namespace {

/// How far the rate of a half cycle may be from the input rate [deg/h].
double varying_rate_deg_h(const Scenario& s) {
    double certain = 0.0;
    double random = 0.0;
    for (const EffectBounds& bounds : bounds_of_effects(s)) {
        certain += bounds.certain.rate_deg_h;
        random = std::hypot(random, bounds.rate_sd_deg_h);
    }
    return certain + sigmas * random;
}

/// Half of what the input's profile can span within the turns that a run makes its tables for at one time [deg/h].
double profile_half_span_deg_h(const Scenario& s) {
    constexpr double turns = 128.0;
    if (!has_profile(s.input)) return 0.0;
    const auto& times = s.input.profile_time_s;
    const auto& rates = s.input.profile_rate_deg_h;
    double steepest = 0.0;
    for (std::size_t i = 1; i < std::min(times.size(), rates.size()); ++i) {
        steepest = std::max(steepest, std::abs(rates[i] - rates[i - 1]) / (times[i] - times[i - 1]));
    }
    const auto [lowest, highest] = input_range(s.input);
    return 0.5 * std::min(highest - lowest, steepest * turns / (2.0 * s.dither.frequency_hz));
}

/// The varying rate with the room that tables leave on either side, see lane_propagator.cpp: up to twice what varies or
/// 5000 deg/h, and 200 deg/h in any case.
double tabulated_rate_deg_h(const Scenario& s) {
    const double varies = varying_rate_deg_h(s);
    const double spans = varies + profile_half_span_deg_h(s);
    return spans > 0.0 ? varies + std::max(200.0, std::min(2.0 * spans, 5000.0)) : 0.0;
}

/// Largest coupling over that of the gyro, of the run's tables: what varies with as much room, at most half.
double tabulated_coupling(const Scenario& s) {
    const double varies = threshold_change_relative(s);
    return varies > 0.0 ? 1.0 + varies + std::max(0.05, std::min(2.0 * varies, 0.5)) : 1.0;
}

/// What a table is asked to cover; the couplings go up to, and the amplitudes down from, those of the gyro.
struct Room {
    double margin_rad;
    double change_rad;  ///< of the amplitude over a half cycle
    double lowest_rate_deg_h, highest_rate_deg_h;
    double coupling;
    bool with_harmonics;  ///< of dither and coupling
};

bool fast(const Scenario& s, const Room& room) {
    gyro::Setup setup = configured_setup(s);
    setup.lockin_threshold_deg_h *= (1.0 + sigmas * s.ensemble.lockin_threshold_sd_relative) * room.coupling;
    setup.dither_peak_rate_deg_s *= 1.0 - sigmas * s.ensemble.dither_amplitude_sd_relative;
    if (!room.with_harmonics) {
        setup.dither_harmonic_ratio = 0.0;
        setup.lockin_second_ratio = 0.0;
        setup.lockin_turn_asymmetry = 0.0;
    }
    const double spread = sigmas * s.ensemble.dither_asymmetry_sd_ratio;
    const double asymmetry = setup.dither_asymmetry_ratio;
    for (const double off : {-spread, spread}) {
        setup.dither_asymmetry_ratio = asymmetry + off;
        gyro::Device device(setup);
        // Amplitudes, rates and couplings inside are faster: the worst are at the corners.
        const double amplitude = device.dither_amplitude_rad - room.margin_rad - 0.5 * room.change_rad;
        if (amplitude <= 0.0) return false;
        const bool series = setup.lockin_second_ratio != 0.0;
        const double b = series ? gyro::strength_with_harmonics_rad_s(device.coupling) : device.coupling.b_rad_s;
        for (const double rate : {room.lowest_rate_deg_h, room.highest_rate_deg_h}) {
            device.input_rate_rad_s = device.phase_per_arcsec * rate;
            for (const double sign : {1.0, -1.0}) {
                for (const int end : {0, 1}) {
                    gyro::HalfCycle half = device.half_cycle(sign, amplitude);
                    half.amplitude_change_rad = (end == 0 ? -1.0 : 1.0) * room.change_rad;
                    if (!gyro::has_fast_middle(half.upright(end), b)) return false;
                }
            }
        }
    }
    return true;
}

}  // namespace

bool fast_middles(const Scenario& s) {
    const auto [lowest, highest] = input_range(s.input);
    const InjectedNoise injected = injected_noise(s);
    bool driven[2] = {};    // without and with noise injected
    bool inverted[2] = {};  // by a compensator with tables of its own
    for (const Arm& arm : s.arms) {
        driven[arm.noise_injected] = true;
        inverted[arm.noise_injected] |=
            arm.compensator == Compensator::exact || arm.compensator == Compensator::adaptive;
    }
    const double room = tabulated_rate_deg_h(s);
    // The compensators' tables are of the sinusoid, the threshold as told, and the rate as measured, see exact.cpp.
    const double amplitude_rad =
        s.dither.peak_rate_deg_s * units::deg_h_per_deg_s / (s.gyro.scale_factor_arcsec * s.dither.frequency_hz);
    const double measured = varying_rate_deg_h(s) + 0.02 * std::max(std::abs(lowest), std::abs(highest)) +
                            16.0 * s.gyro.scale_factor_arcsec;
    const double told = (1.0 + s.calibration.threshold_error_relative) * 1.02;
    for (const bool noisy : {false, true}) {
        const double margin = noisy ? injected.margin_rad : 0.0;
        const double change = noisy ? injected.change_rad : 0.0;
        const double wider = std::max(margin, 0.002 * amplitude_rad);
        if (driven[noisy] && !fast(s, {margin, change, lowest - room, highest + room, tabulated_coupling(s), true}))
            return false;
        if (inverted[noisy] && !fast(s, {wider, 0.0, lowest - measured, highest + measured, told, false})) return false;
    }
    return true;
}

}  // namespace ringlock::scenario
