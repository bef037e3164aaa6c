#pragma once
#include <Random123/philox.h>

#include <Random123/conventional/Engine.hpp>
#include <boost/random/normal_distribution.hpp>
#include <boost/random/uniform_real_distribution.hpp>
#include <cstdint>

/// Random streams named by purpose and keyed by identity (seed, gyro, purpose), never by thread or rank
/// (Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11).
namespace ringlock::random {

/// Purposes. A number once given is never given another meaning: it is part of what a seed stands for.
enum class Purpose : std::uint64_t {
    initial_phase = 1,
    dither_asymmetry = 2,
    lockin_threshold = 3,
    dither_amplitude = 4,
    noise_injection = 5,
    detector_noise = 6,
    quantum_noise = 7,
    rate_random_walk = 8,
    bias_instability = 9,
    bootstrap = 10,
    comparator_noise = 11,
    missed_counts = 12,
    amplitude_wander = 13,
    case_motion = 14,
    witness_motion = 15,
    fitted_parameters = 16,
    drive_noise = 17,
    drive_noise_phase = 18,
    design_scrambling = 19,
    design_strata = 20,
    sensitivity_bootstrap = 21,
    latched_detectors = 22,
    dither_reference = 23,
    white_rate_between_turns = 24,
    missing_rates = 25,
    lost_information = 26,
};

/// Who draws: the study's seed and the gyro's number.
struct Identity {
    std::uint64_t seed = 0;
    std::uint64_t gyro = 0;
};

/// A uniform random bit generator for one identity and purpose (Philox 4x64-10).
using Engine = r123::Engine<r123::Philox4x64>;

inline Engine make_engine(Identity who, Purpose purpose) {
    // The key is the seed and the purpose; the gyro's number sits in the top counter word, which the engine, counting
    // from the lowest word up, cannot reach: streams never overlap.
    r123::Philox4x64::key_type key = {{who.seed, static_cast<std::uint64_t>(purpose)}};
    Engine engine(key);
    r123::Philox4x64::ctr_type counter = {{0, 0, 0, who.gyro}};
    engine.setcounter(counter, 0);
    return engine;
}

/// Independent standard normal deviates of one identity and purpose.
class NormalStream {
   public:
    NormalStream(Identity who, Purpose purpose) : engine_(make_engine(who, purpose)) {}
    double operator()() { return normal_(engine_); }

   private:
    Engine engine_;
    boost::random::normal_distribution<double> normal_;
};

}  // namespace ringlock::random
