#include "engine/scenario/fast_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "engine/core/units.hpp"
#include "engine/gyro/device.hpp"
#include "engine/gyro/fast_motion.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/injected_noise.hpp"
#include "engine/scenario/read_arms.hpp"

namespace ringlock::scenario {

namespace {

/// Turns that a run makes its tables for at one time.
constexpr double turns_of_tables = 128.0;

/// Standard deviations within which the rates of that many half cycles stay, with very few exceptions.
constexpr double sigmas_of_a_piece = 5.0;

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

/// Half of the range of the input's profile within the turns for which a run makes its tables at one time [deg/h].
double profile_half_span_deg_h(const Scenario& s) {
    if (!has_profile(s.input)) return 0.0;
    const auto [lowest, highest] = input_range(s.input);
    return 0.5 *
           std::min(highest - lowest, input_slope_deg_h_s(s.input) * turns_of_tables / (2.0 * s.dither.frequency_hz));
}

/// The varying rate with the room that tables leave on either side, see lane_propagator.cpp: twice the varying part, at
/// most 5000 deg/h and at least 200 deg/h.
double tabulated_rate_deg_h(const Scenario& s) {
    const double varies = varying_rate_deg_h(s);
    const double spans = varies + profile_half_span_deg_h(s);
    return spans > 0.0 ? varies + std::max(200.0, std::min(2.0 * spans, 5000.0)) : 0.0;
}

/// Largest coupling of the run's tables over that of the gyro: the varying part, and room of twice its size, at most
/// one half.
double tabulated_coupling(const Scenario& s) {
    const double varies = threshold_change_relative(s);
    return varies > 0.0 ? 1.0 + varies + std::max(0.05, std::min(2.0 * varies, 0.5)) : 1.0;
}

/// Ranges that a table must cover; the couplings go up to, and the amplitudes down from, those of the gyro.
struct Room {
    double margin_rad;
    double change_rad;  ///< of the amplitude over a half cycle
    double lowest_rate_deg_h, highest_rate_deg_h;
    double half_width_deg_h;  ///< of the rates of one table, which lies anywhere between these
    double coupling;
    bool with_harmonics;  ///< of dither and coupling
};

/// The gyro with the least dither and the strongest coupling, of both asymmetries that the spread may give it.
std::array<gyro::Setup, 2> worst_setups(const Scenario& s, const Room& room) {
    gyro::Setup setup = configured_setup(s);
    setup.lockin_threshold_deg_h *= (1.0 + sigmas * s.ensemble.lockin_threshold_sd_relative) * room.coupling;
    setup.dither_peak_rate_deg_s *= 1.0 - sigmas * s.ensemble.dither_amplitude_sd_relative;
    if (!room.with_harmonics) {
        setup.dither_harmonic_ratio = 0.0;
        setup.lockin_second_ratio = 0.0;
        setup.lockin_turn_asymmetry = 0.0;
    }
    const double spread = sigmas * s.ensemble.dither_asymmetry_sd_ratio;
    std::array<gyro::Setup, 2> setups{setup, setup};
    setups[0].dither_asymmetry_ratio -= spread;
    setups[1].dither_asymmetry_ratio += spread;
    return setups;
}

bool fast(const Scenario& s, const Room& room) {
    for (const gyro::Setup& setup : worst_setups(s, room)) {
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

/// Amplitude, rate and change of the amplitude.
constexpr std::size_t variables = 3;
using Point = std::array<double, variables>;

/// Nodes that the terms of a variable are looked for with: more than the tables of Moebius maps may have.
constexpr std::size_t sampled_nodes = 48;
using Sampled = std::array<double, sampled_nodes>;

/// Chebyshev coefficients of exp(i phase) from the phases at the nodes, magnitudes.
Sampled chebyshev_sizes(const Sampled& phase_rad) {
    static const std::vector<Sampled> cosines = [] {
        std::vector<Sampled> rows(sampled_nodes);
        for (std::size_t k = 0; k < sampled_nodes; ++k) {
            for (std::size_t i = 0; i < sampled_nodes; ++i) {
                const double angle = units::pi * (static_cast<double>(i) + 0.5) / sampled_nodes;
                rows[k][i] = (k == 0 ? 1.0 : 2.0) / sampled_nodes * std::cos(static_cast<double>(k) * angle);
            }
        }
        return rows;
    }();
    Sampled real;
    Sampled imaginary;
    for (std::size_t i = 0; i < sampled_nodes; ++i) {
        real[i] = std::cos(phase_rad[i]);
        imaginary[i] = std::sin(phase_rad[i]);
    }
    Sampled sizes;
    for (std::size_t k = 0; k < sampled_nodes; ++k) {
        double re = 0.0;
        double im = 0.0;
        for (std::size_t i = 0; i < sampled_nodes; ++i) {
            re += cosines[k][i] * real[i];
            im += cosines[k][i] * imaginary[i];
        }
        sizes[k] = std::hypot(re, im);
    }
    return sizes;
}

/// Where the phase of the kick moves the fastest: at the smallest amplitude, the highest rate, and either change.
Point fastest_corner(const Point& low, const Point& high, std::size_t which) {
    return {low[0], std::abs(low[1]) > std::abs(high[1]) ? low[1] : high[1], which == 0 ? low[2] : high[2]};
}

/// Whether polynomials hold a half turn's kick over these ranges. Its phase is that of the zero-rate point against the
/// turn. It varies with amplitude and rate, and this variation determines the number of terms (docs/dev/turn-map.md).
/// Powers of high orders also lose digits: a term of order k counts (1 + sqrt(2))^k times in the rounding.
bool holds_kick(const gyro::Device& device, double sign, int end, const Point& low, const Point& high, double kick_rad,
                double harmonics, std::size_t most_nodes, double tolerance_rad) {
    constexpr double rounding = 1e-15;  // of a radian, and of each that the phase goes through
    // The shift of a half turn is rounded over the whole of its path, independently of the kick.
    const double shift_rad = 2e-17 * high[0];
    double largest_rad = 0.0;
    const auto phase_rad = [&](const Point& at) {
        gyro::HalfCycle half = device.half_cycle(sign, at[0] + 0.5 * at[2]);
        half.amplitude_change_rad = end == 0 ? at[2] : -at[2];
        half.rate_rad_s = at[1];
        const gyro::HalfCycle upright = half.upright(end);
        return harmonics * upright.plain_phase_rad(gyro::zero_rate_s(upright));
    };
    // Few radians take few terms: exp(i S x) has the coefficients 2 J_k(S), which with (1 + sqrt(2))^k add up to less
    // than 2 exp(S); and they are not small before k = S. Nearly all scenarios end here.
    double few = 1.0;
    double most_rad = 0.0;
    for (std::size_t variable = 0; variable < variables; ++variable) {
        if (!(high[variable] > low[variable])) continue;
        double half_span_rad = 0.0;
        for (std::size_t corner = 0; corner < (high[2] > low[2] ? 2 : 1); ++corner) {
            Point at = fastest_corner(low, high, corner);
            double phases[3];
            for (std::size_t i = 0; i < 3; ++i) {
                at[variable] = low[variable] + 0.5 * static_cast<double>(i) * (high[variable] - low[variable]);
                phases[i] = phase_rad(at);
                largest_rad = std::max(largest_rad, std::abs(phases[i]));
            }
            const auto [least, most] = std::minmax({phases[0], phases[1], phases[2]});
            half_span_rad = std::max(half_span_rad, 0.5 * (most - least));
        }
        most_rad = std::max(most_rad, half_span_rad);
        few *= 2.0 * std::exp(half_span_rad);
    }
    const auto rounded_rad = [&](double grown) {
        return kick_rad * rounding * (1.0 + largest_rad) * grown + shift_rad;
    };
    if (most_rad < 3.0 && rounded_rad(few) <= 0.1 * tolerance_rad) return true;
    if (most_rad > static_cast<double>(most_nodes)) return false;

    double left_out = 0.0;
    double growth = 1.0;
    for (std::size_t variable = 0; variable < variables; ++variable) {
        if (!(high[variable] > low[variable])) continue;
        double worst_tail = 0.0;
        double worst_growth = 1.0;
        for (std::size_t corner = 0; corner < (high[2] > low[2] ? 2 : 1); ++corner) {
            Point at = fastest_corner(low, high, corner);
            Sampled phases;
            for (std::size_t i = 0; i < sampled_nodes; ++i) {
                const double x = std::cos(units::pi * (static_cast<double>(i) + 0.5) / sampled_nodes);
                at[variable] = 0.5 * (low[variable] + high[variable] + x * (high[variable] - low[variable]));
                phases[i] = phase_rad(at);
            }
            const double first = phases[0];
            for (const double phase : phases) largest_rad = std::max(largest_rad, std::abs(phase));
            for (double& phase : phases) phase -= first;
            const Sampled sizes = chebyshev_sizes(phases);
            std::size_t needed = sampled_nodes;
            double tail = 0.0;
            while (needed > 1 &&
                   (needed > most_nodes || kick_rad * (tail + sizes[needed - 1]) < 0.05 * tolerance_rad)) {
                tail += sizes[--needed];
            }
            double grown = 0.0;
            for (std::size_t k = needed; k-- > 0;) grown = grown * (1.0 + std::numbers::sqrt2) + sizes[k];
            worst_tail = std::max(worst_tail, tail);
            // Coefficients that are nearly nothing are rounded as well.
            worst_growth = std::max({worst_growth, grown, 1e-5 * std::pow(1.0 + std::numbers::sqrt2, needed)});
        }
        left_out += worst_tail;
        growth *= worst_growth;
    }
    return kick_rad * left_out + rounded_rad(growth) <= 0.3 * tolerance_rad;
}

bool hold_kicks(const Scenario& s, const Room& room) {
    for (const gyro::Setup& setup : worst_setups(s, room)) {
        const gyro::Device device(setup);
        const double amplitude = device.dither_amplitude_rad;
        const double w = units::two_pi * setup.dither_frequency_hz;
        const double kick_rad =
            std::min(1.0, device.coupling.b_rad_s * std::sqrt(units::two_pi / (amplitude - room.margin_rad)) / w);
        const bool series = setup.lockin_second_ratio != 0.0;
        // The tables' own limits, less a few terms for effects that this estimate neglects.
        const std::size_t most_nodes = series ? 20 : 28;
        const double half = std::min(room.half_width_deg_h, 0.5 * (room.highest_rate_deg_h - room.lowest_rate_deg_h));
        // For a sinusoidal dither the phase is even in the rate, and both ends are alike.
        const bool alike = setup.dither_harmonic_ratio == 0.0;
        const double centres[] = {room.lowest_rate_deg_h + half, room.highest_rate_deg_h - half};
        for (const double centre : centres) {
            if (alike && std::abs(centre) < std::max(std::abs(centres[0]), std::abs(centres[1]))) continue;
            const Point low{amplitude - room.margin_rad, device.phase_per_arcsec * (centre - half), -room.change_rad};
            const Point high{amplitude + room.margin_rad, device.phase_per_arcsec * (centre + half), room.change_rad};
            for (const double sign : {1.0, -1.0}) {
                for (const int end : {0, 1}) {
                    if (alike && end == 1) continue;
                    if (!holds_kick(device, sign, end, low, high, kick_rad, series ? 2.0 : 1.0, most_nodes,
                                    s.propagation.turn_map_tolerance_rad)) {
                        return false;
                    }
                }
            }
        }
    }
    return true;
}

/// Half of the range of the rates within the turns for which tables are made at one time [deg/h].
double half_span_deg_h(const Scenario& s) {
    const double piece_s = turns_of_tables / (2.0 * s.dither.frequency_hz);
    double certain = profile_half_span_deg_h(s);
    double random = 0.0;
    for (const EffectBounds& bounds : bounds_of_effects(s)) {
        const double rate = bounds.certain.rate_deg_h;
        const auto& slope = bounds.certain.rate_slope_deg_h_s;
        certain += slope ? std::min(rate, 0.5 * piece_s * *slope) : rate;
        random = std::hypot(random, bounds.rate_sd_deg_h);
    }
    return certain + sigmas_of_a_piece * random;
}

/// Half width of the rates of one table, see lane_propagator.cpp.
double table_half_width_deg_h(const Scenario& s) {
    if (tabulated_rate_deg_h(s) == 0.0) return 0.0;
    const double asked = half_span_deg_h(s);
    return std::max({1.05 * asked, std::min(3.0 * asked, 5000.0), 200.0});
}

/// Calls `allows` with the room of every table that the scenario's arms need, until it returns false: with the direct
/// method these are the compensators' tables.
template <class Allows>
bool all_tables(const Scenario& s, Allows&& allows) {
    const auto [lowest, highest] = input_range(s.input);
    bool driven[2] = {};    // without and with noise injected
    bool inverted[2] = {};  // by a compensator with tables of its own
    for (const Arm& arm : s.arms) {
        driven[arm.noise_injected] |= !arm.ideal && s.propagation.method == PropagationMethod::turn_map;
        inverted[arm.noise_injected] |=
            arm.compensator == Compensator::exact || arm.compensator == Compensator::adaptive;
    }
    const double room = tabulated_rate_deg_h(s);
    const double half_width = table_half_width_deg_h(s);
    // The compensators' tables are those of the sinusoid, the calibrated threshold, and the measured rate, see
    // exact.cpp.
    const double amplitude_rad =
        s.dither.peak_rate_deg_s * units::deg_h_per_deg_s / (s.gyro.scale_factor_arcsec * s.dither.frequency_hz);
    const double width = 0.01 * std::max(std::abs(lowest), std::abs(highest)) + 16.0 * s.gyro.scale_factor_arcsec;
    const double measured = varying_rate_deg_h(s) + 2.0 * width;
    const double threshold_factor = (1.0 + s.calibration.threshold_error_relative) * 1.02;
    const double wander_rad = amplitude_rad * amplitude_change_relative(s.dither, simulated_s(s));
    for (const bool noisy : {false, true}) {
        if (!driven[noisy] && !inverted[noisy]) continue;
        const InjectedNoise injected = noisy ? injected_noise(s) : InjectedNoise{};
        const double margin = injected.margin_rad + wander_rad;
        const double change = injected.change_rad;
        const double wider = std::max(margin, 0.002 * amplitude_rad);
        if (driven[noisy] &&
            !allows(Room{margin, change, lowest - room, highest + room, half_width, tabulated_coupling(s), true}))
            return false;
        if (inverted[noisy] &&
            !allows(Room{wider, change, lowest - measured, highest + measured, width, threshold_factor, false}))
            return false;
    }
    return true;
}

}  // namespace

bool fast_middles(const Scenario& s) {
    return all_tables(s, [&](const Room& room) { return fast(s, room); });
}

double way_to_turns_rad(const Scenario& s) {
    const auto [lowest, highest] = input_range(s.input);
    const double varies = varying_rate_deg_h(s);
    const Room room{0.0, 0.0, lowest - varies, highest + varies, 0.0, tabulated_coupling(s), true};
    const double left = 1.0 - amplitude_change_relative(s.dither, simulated_s(s));
    double longest = 0.0;
    for (const gyro::Setup& setup : worst_setups(s, room)) {
        gyro::Device device(setup);
        for (const double rate : {room.lowest_rate_deg_h, room.highest_rate_deg_h}) {
            device.input_rate_rad_s = device.phase_per_arcsec * rate;
            for (const double sign : {1.0, -1.0}) {
                for (const int end : {0, 1}) {
                    const gyro::HalfCycle half =
                        device.half_cycle(sign, left * device.dither_amplitude_rad).upright(end);
                    const double zero_s = gyro::zero_rate_s(half);
                    const double fastest = std::sqrt(half.end_acceleration_rad_s2()) + device.coupling.b_rad_s;
                    longest = std::max(longest, std::abs(half.plain_phase_rad(zero_s)) + std::abs(zero_s) * fastest);
                }
            }
        }
    }
    return longest;
}

bool pulses_before_middles(const Scenario& s) {
    constexpr double least_phase_rad = 8.0;  // four quarter fringes and a part of one
    const auto [lowest, highest] = input_range(s.input);
    const Room room{0.0, 0.0, lowest, highest, 0.0, 1.0, true};
    for (const gyro::Setup& setup : worst_setups(s, room)) {
        gyro::Device device(setup);
        for (const double rate : {lowest, highest}) {
            device.input_rate_rad_s = device.phase_per_arcsec * rate;
            for (const double sign : {1.0, -1.0}) {
                for (const int end : {0, 1}) {
                    const gyro::HalfCycle half = device.half_cycle(sign, device.dither_amplitude_rad).upright(end);
                    const double zero_s = gyro::zero_rate_s(half);
                    const double middle_s = 0.5 * half.duration_s;
                    const double gained = half.plain_phase_rad(middle_s) - half.plain_phase_rad(zero_s) -
                                          device.coupling.b_rad_s * (middle_s - zero_s);
                    if (!(gained >= least_phase_rad)) return false;
                }
            }
        }
    }
    return true;
}

bool tables_hold_the_tolerance(const Scenario& s) {
    return all_tables(s, [&](const Room& room) { return !fast(s, room) || hold_kicks(s, room); });
}

}  // namespace ringlock::scenario
