#pragma once
#include <cstdint>
#include <random>
#include <span>
#include <vector>

/// Rates that vary in time, as their means over consecutive intervals.
namespace ringlock::test::closure {

/// What random numbers are for; each purpose of a seed has a generator of its own.
enum class Purpose : std::uint32_t {
    injected_noise = 1,
    wander_walk,
    wander_correlated,
    readout_noise,
    missed_counts,
    quantum_noise,
    flicker,
    rate_random_walk,
    telegraph,
    white_angle,
    case_motion,
    witness,
    residue_wander,
    slow_acceleration,
};

class Random {
   public:
    Random(std::uint64_t seed, Purpose purpose);
    double normal() { return normal_(engine_); }
    double uniform() { return uniform_(engine_); }
    double exponential() { return exponential_(engine_); }

   private:
    std::mt19937_64 engine_;
    std::normal_distribution<double> normal_;
    std::uniform_real_distribution<double> uniform_;
    std::exponential_distribution<double> exponential_;
};

struct RateStep {
    double step_deg_h = 0.0;
    double time_s = 0.0;
};
/// rate = amplitude sin(2 pi f t + phase).
struct RateLine {
    double frequency_hz = 10.0;
    double rate_deg_h = 0.0;
    double phase_rad = 0.0;
};
/// The same with the phase 2 pi (f t + chirp t^2/2) + phase.
struct RateChirp {
    double frequency_hz = 10.0;
    double chirp_hz_per_s = 0.0;
    double rate_deg_h = 0.0;
    double phase_rad = 0.0;
};
/// A rate that jumps between 0 and `step_deg_h`, dwelling in either state for an exponential time.
struct RateTelegraph {
    double step_deg_h = 0.0;
    double dwell_s = 10.0;
};
/// A rate that settles: `start_deg_h` at first, and an e-th part of it after every `constant_s`.
struct RateSettling {
    double start_deg_h = 0.0;
    double constant_s = 60.0;
};

struct RateTruth {
    RateStep bias_step;
    double bias_ramp_deg_h_per_h = 0.0;
    double bias_instability_deg_h =
        0.0;  ///< B: Allan deviation 0.664 B (IEEE Std 952-1997), correlated over 0.03 s to 3e5 s
    double rate_random_walk_deg_h_rt_h = 0.0;
    double quantum_noise_deg_rt_h = 0.0;
    RateLine base_vibration;
    RateTelegraph telegraph_bias;  ///< not in the library
    RateChirp chirped_line;        ///< not in the library
    RateSettling settling;         ///< not in the library
    RateLine slow_swing;           ///< of a few periods: not in the library
};

/// Mean rates [deg/h, which is arcsec/s] over the intervals between consecutive `edges_s`, the first at 0 or later.
std::vector<double> mean_rates(const RateTruth& truth, std::uint64_t seed, std::span<const double> edges_s);

/// Mean of the line over an interval; not for long ones.
double mean_of(const RateLine& line, double from_s, double to_s);

}  // namespace ringlock::test::closure
