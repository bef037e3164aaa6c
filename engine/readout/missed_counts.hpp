#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/gyro/setup.hpp"
#include "engine/random/normal_lanes.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::readout {

/// Quarter fringes that the up/down counters of a block of gyros have missed. In the half cycle before each turn but
/// the first of the run a counter misses one pulse with Setup::missed_count_probability: on the way up it then stays
/// one too low, on the way down one too high.
class MissedCounts {
   public:
    MissedCounts(std::span<const gyro::Setup> setups, const random::LaneIdentities& who);

    /// Count less the true one at the next `turns` turns, [turn][gyro], in quarter fringes; empty where no counter of
    /// the block ever misses one.
    std::span<const simd::Lanes> next(std::size_t turns);

   private:
    struct Counter {
        double probability;
        random::Engine engine;
        std::int64_t next_miss;  ///< turn
        double quarters = 0.0;
    };

    std::vector<Counter> counters_;
    std::vector<simd::Lanes> quarters_;
    std::int64_t turn_ = 0;
};

}  // namespace ringlock::readout
