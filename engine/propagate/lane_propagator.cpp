#include "engine/propagate/lane_propagator.hpp"

#include <algorithm>
#include <cmath>

namespace ringlock::propagate {

namespace {

/// Slow rates and couplings change at random: ranges this many times as wide as a piece needs need not be made anew
/// soon.
constexpr double spare = 3.0;
/// Half widths up to which there is such room [deg/h; relative]; far beyond, terms would run out.
constexpr double most_spare_rate_deg_h = 5000.0;
constexpr double most_spare_coupling = 0.5;
/// Every table must cover the range that a piece needs, with a little room for the next piece.
constexpr double least_spare = 1.05;
/// Ranges grow with each remake up to this rate, beyond which they need more and more terms [deg/h].
constexpr double widest_rate_deg_h = 200.0;
constexpr double widest_coupling = 0.05;  // relative

/// A range around the required one, wider than the last one up to `widest`, with room to spare up to `most_spare`.
Range around(double lowest, double highest, const Range& last, double widest, double most_spare) {
    const double asked = 0.5 * (highest - lowest);
    const double grown = std::min(last.highest - last.lowest, widest);  // twice the old half width
    const double half =
        std::max({least_spare * asked, std::min(spare * asked, most_spare), grown}) + 1e-9 * std::abs(highest);
    const double centre = 0.5 * (highest + lowest);
    return {centre - half, centre + half};
}

}  // namespace

template <class Turns>
TurnMapLanes<Turns>::TurnMapLanes(std::span<const gyro::Device> devices, const AmplitudeRoom& room,
                                  double tolerance_rad)
    : devices_(devices.begin(), devices.end()), room_(room), tables_(tolerance_rad) {
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const gyro::Device& device = devices_[std::min(lane, devices_.size() - 1)];
        state_.coupling_phase_fringes[lane] = device.coupling.phase_rad / units::two_pi;
    }
}

template <class Turns>
void TurnMapLanes<Turns>::cover(const gyro::LaneDrive& drive) {
    const bool noisy = room_.margin_rad > 0.0;
    if (begun_ && !noisy && !drive.rates_vary && !drive.thresholds_vary) return;
    simd::Lanes low_amplitude, high_amplitude, low_rate, high_rate, low_b, high_b;
    extremes(drive.amplitude_rad, low_amplitude, high_amplitude);
    simd::Lanes largest_change{};
    if (drive.amplitudes_change) {
        simd::Lanes low_change, high_change;
        extremes(drive.amplitude_change_rad, low_change, high_change);
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            largest_change[lane] = std::max(-low_change[lane], high_change[lane]);
            // Tables are of the amplitude at a turn.
            low_amplitude[lane] -= 0.5 * largest_change[lane];
            high_amplitude[lane] += 0.5 * largest_change[lane];
        }
    }
    if (!begun_ || drive.rates_vary) extremes(drive.rate_rad_s, low_rate, high_rate);
    if (!begun_ || drive.thresholds_vary) extremes(drive.b_rad_s, low_b, high_b);
    if (Turns::evaluates_first_half_cycle && begun_) {
        // The ranges of the present tables include it, those of new tables must include it.
        const auto include = [&](const std::vector<simd::Lanes>& rows, simd::Lanes& low, simd::Lanes& high) {
            for (std::size_t lane = 0; lane < devices_.size(); ++lane) {
                low[lane] = std::min(low[lane], rows[0][lane]);
                high[lane] = std::max(high[lane], rows[0][lane]);
            }
        };
        include(drive.amplitude_rad, low_amplitude, high_amplitude);
        if (drive.rates_vary) include(drive.rate_rad_s, low_rate, high_rate);
        if (drive.thresholds_vary) include(drive.b_rad_s, low_b, high_b);
    }
    for (std::size_t lane = 0; lane < devices_.size(); ++lane) {
        const gyro::Device& device = devices_[lane];
        HalfCycleRanges ranges = tables_.ranges(lane);
        const auto misses = [&](const Range& range, double low, double high) {
            return !begun_ || !range.covers(low) || !range.covers(high);
        };
        bool changed = !begun_;
        if (misses(ranges.amplitude_rad, low_amplitude[lane], high_amplitude[lane])) {
            // Noise beyond eight sigma, or the first piece.
            const double a = device.dither_amplitude_rad;
            const double margin =
                std::max({room_.margin_rad, 1.1 * (high_amplitude[lane] - a), 1.1 * (a - low_amplitude[lane])});
            ranges.amplitude_rad = noisy ? Range{a - margin, a + margin} : Range{a, a};
            changed = true;
        }
        if (drive.amplitudes_change &&
            misses(ranges.amplitude_change_rad, -largest_change[lane], largest_change[lane])) {
            const double change = std::max(room_.change_rad, 1.1 * largest_change[lane]);
            ranges.amplitude_change_rad = {-change, change};
            changed = true;
        }
        if ((!begun_ || drive.rates_vary) && misses(ranges.rate_rad_s, low_rate[lane], high_rate[lane])) {
            ranges.rate_rad_s = drive.rates_vary ? around(low_rate[lane], high_rate[lane], ranges.rate_rad_s,
                                                          widest_rate_deg_h * device.phase_per_arcsec,
                                                          most_spare_rate_deg_h * device.phase_per_arcsec)
                                                 : Range{low_rate[lane], high_rate[lane]};
            changed = true;
        }
        if ((!begun_ || drive.thresholds_vary) && misses(ranges.b_rad_s, low_b[lane], high_b[lane])) {
            ranges.b_rad_s = drive.thresholds_vary ? around(low_b[lane], high_b[lane], ranges.b_rad_s,
                                                            widest_coupling * device.coupling.b_rad_s,
                                                            most_spare_coupling * device.coupling.b_rad_s)
                                                   : Range{low_b[lane], high_b[lane]};
            changed = true;
        }
        if (!changed) continue;
        if (begun_) ++remade_[lane];
        tables_.make(lane, device, ranges);
    }
    begun_ = true;
}

template <class Turns>
void TurnMapLanes<Turns>::step(const gyro::LaneDrive& drive, gyro::LaneTurns& turns) {
    if (drive.turns == 0) return;
    cover(drive);
    Turns::step(tables_, drive, devices_.size(), state_, &turns);
}

template class TurnMapLanes<MoebiusTurns>;
template class TurnMapLanes<TabulatedTurns>;

std::unique_ptr<LanePropagator> make_turn_map(std::span<const gyro::Device> devices, const AmplitudeRoom& room,
                                              double tolerance_rad) {
    const bool moebius = std::all_of(devices.begin(), devices.end(),
                                     [](const gyro::Device& device) { return device.coupling.second_ratio == 0.0; });
    if (moebius) return std::make_unique<TurnMapLanes<MoebiusTurns>>(devices, room, tolerance_rad);
    return std::make_unique<TurnMapLanes<TabulatedTurns>>(devices, room, tolerance_rad);
}

}  // namespace ringlock::propagate
