#pragma once
#include <cstdint>

namespace ringlock::bench {

/// What a turn takes at the very least: draws one normal deviate and evaluates one sine-cosine pair, for a block of
/// gyros and so many turns. Returns something that depends on all of them.
double normal_and_sincos(std::uint64_t seed, std::int64_t first_turn, std::size_t turns);

}  // namespace ringlock::bench
