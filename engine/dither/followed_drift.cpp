#include "engine/dither/followed_drift.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <numeric>

#include "engine/core/units.hpp"
#include "engine/dither/drive_noise.hpp"
#include "engine/gyro/device.hpp"
#include "engine/gyro/theory.hpp"

namespace ringlock::dither {

namespace {

constexpr double most_turns = 2e8;  // of all gyros together: some ten seconds of two cores

double turns_in(double seconds, const gyro::Setup& setup) { return seconds * 2.0 * setup.dither_frequency_hz; }

/// A block of gyros on the chain, with the exact motion of their resonators.
class Followed {
   public:
    Followed(const PhaseChain& chain, const gyro::Setup& setup, const gyro::DriveNoise& noise, std::uint64_t first_gyro)
        : chain_(chain), noise_(noise, devices(setup), chain.rms_rad, identities(first_gyro)) {
        // Phases that fill the circle evenly for any number of gyros: multiples of the golden ratio.
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const double share = (static_cast<double>(first_gyro + lane) + 0.5) * 0.6180339887498949;
            first_rad_[lane] = units::two_pi * (share - std::floor(share));
        }
    }

    void advance(std::int64_t turns) {
        constexpr std::int64_t piece = 256;
        for (; turns > 0; turns -= piece) {
            const auto some = static_cast<std::size_t>(std::min(turns, piece));
            noise_.next(some, deviation_rad_, late_s_);
            for (std::size_t i = 0; i < some; ++i, ++turn_) step(deviation_rad_[i]);
        }
    }
    /// Phase that the lock-in has added to each gyro.
    const simd::Lanes& lockin_rad() const { return lockin_rad_; }

   private:
    static std::vector<gyro::Device> devices(const gyro::Setup& setup) {
        return std::vector<gyro::Device>(simd::lanes, gyro::Device(setup));
    }
    static random::LaneIdentities identities(std::uint64_t first_gyro) {
        random::LaneIdentities who;
        who.seed = 1;  // of predictions: the same one always
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = first_gyro + lane;
        return who;
    }
    void step(const simd::Lanes& deviation_rad) {
        const double sign = turn_ % 2 == 0 ? -1.0 : 1.0;
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const double phase = first_rad_[lane] + lockin_rad_[lane] +
                                 static_cast<double>(turn_) * chain_.half_cycle_rad +
                                 sign * (chain_.amplitude_rad + deviation_rad[lane] - 0.25 * units::pi);
            lockin_rad_[lane] -= 2.0 * std::atan2(chain_.r * std::sin(phase), 1.0 + chain_.r * std::cos(phase));
        }
    }

    PhaseChain chain_;
    DriveNoiseLanes noise_;
    std::int64_t turn_ = 0;
    simd::Lanes first_rad_{}, lockin_rad_{};
    std::vector<simd::Lanes> deviation_rad_, late_s_;
};

}  // namespace

bool comes_round(const PhaseChain& chain, const gyro::Setup& setup) {
    constexpr double rotations = 2.0;
    const double turns = turns_in(walk_read_after_s, setup);
    const double by_input = chain.half_cycle_rad * turns;
    const double by_kicks = std::sqrt(0.5 * gyro::randomised_kick_variance_rad2(setup) * turns);
    return std::abs(by_input) > rotations * units::two_pi || by_kicks > 0.5 * units::two_pi;
}

std::optional<KickDrift> followed_drift(const PhaseChain& chain, const gyro::Setup& setup,
                                        const gyro::DriveNoise& noise) {
    constexpr std::size_t blocks = 32;
    constexpr std::size_t stretches = 8;
    constexpr auto gyros_followed = static_cast<double>(blocks * simd::lanes);
    // The drive's noise begins as long before.
    const double settling = std::max(4000.0, 20.0 / (1.0 - gyro::Resonator(noise).decay()));
    const double stretch = comes_round(chain, setup) ? settling : turns_in(walk_read_after_s, setup);
    if ((2.0 * settling + stretches * stretch) * gyros_followed > most_turns) return std::nullopt;
    const auto turns = static_cast<std::int64_t>(stretch);
    std::vector<double> sum(blocks, 0.0);
    std::vector<double> squares(blocks, 0.0);
    tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t block) {
        Followed gyros(chain, setup, noise, block * simd::lanes);
        gyros.advance(static_cast<std::int64_t>(settling));  // the phases' beginning is forgotten
        for (std::size_t i = 0; i < stretches; ++i) {
            const simd::Lanes before = gyros.lockin_rad();
            gyros.advance(turns);
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                const double moved = gyros.lockin_rad()[lane] - before[lane];
                sum[block] += moved;
                squares[block] += moved * moved;
            }
        }
    });
    constexpr auto count = static_cast<double>(blocks * stretches * simd::lanes);
    const double mean = std::accumulate(sum.begin(), sum.end(), 0.0) / count;
    const double square = std::accumulate(squares.begin(), squares.end(), 0.0) / count;
    const auto length = static_cast<double>(turns);
    return KickDrift{mean / length, (square - mean * mean) * count / (count - 1.0) / length};
}

FollowedAngles followed_angles(const PhaseChain& chain, const gyro::Setup& setup, const gyro::DriveNoise& noise) {
    constexpr std::size_t blocks = 16;
    constexpr auto count = static_cast<double>(blocks * simd::lanes);
    const double settling = noise.amplitude_loop_hz > 0.0 ? 20.0 / (1.0 - gyro::Resonator(noise).decay()) : 0.0;
    std::vector<double> times_s;
    for (const double time_s : spread_times_s) {
        if ((settling + turns_in(time_s, setup)) * count <= most_turns) times_s.push_back(time_s);
    }
    std::vector<std::array<simd::Lanes, blocks>> angle_rad(times_s.size());
    if (!times_s.empty()) {
        tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t block) {
            Followed gyros(chain, setup, noise, block * simd::lanes);
            std::int64_t turn = 0;
            for (std::size_t i = 0; i < times_s.size(); ++i) {
                const std::int64_t end = std::llround(turns_in(times_s[i], setup));
                gyros.advance(end - turn);
                turn = end;
                angle_rad[i][block] = gyros.lockin_rad();
            }
        });
    }
    FollowedAngles followed;
    const double arcsec_per_rad = setup.scale_factor_arcsec / units::two_pi;
    for (std::size_t i = 0; i < times_s.size(); ++i) {
        double sum = 0.0;
        double squares = 0.0;
        for (const simd::Lanes& angles : angle_rad[i]) {
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                sum += angles[lane];
                squares += angles[lane] * angles[lane];
            }
        }
        const double variance = std::max(0.0, (squares - sum * sum / count) / (count - 1.0));
        followed.spread.push_back({times_s[i], arcsec_per_rad * std::sqrt(variance)});
        followed.mean_rate_deg_h = arcsec_per_rad * sum / count / times_s[i];
    }
    return followed;
}

}  // namespace ringlock::dither
