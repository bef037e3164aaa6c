#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "engine/random/stream.hpp"
#include "engine/simd/lanes.hpp"

/// Standard normal deviates for many gyros at once.
namespace ringlock::random {

/// Identity of the gyro in each lane.
struct LaneIdentities {
    std::uint64_t seed = 0;
    std::array<std::uint64_t, simd::lanes> gyro{};
};

/// Fills out[i][lane], i < steps, with the standard normal deviates of steps first_step + i of the gyros' streams of
/// that purpose. Any step can be requested at any time and always has the same deviate, independently of the adjacent
/// lanes, of the instruction set and of the other steps of the call.
///
/// Philox 4x32-10 (Salmon, Moraes, Dror, Shaw, SC11) with the seed as key and the counter {step / 2, gyro, purpose};
/// gyros are below 2^56; the 128 bits of a counter make two deviates by the method of Box and Muller (Ann. Math. Stat.
/// 29, 610, 1958), with 52 bits for the radius (at most 8.49) and 52 for the angle.
///
/// \param pair_stride  of the pairs of steps 2 k and 2 k + 1 only every so many, from first_step's on, are drawn; the
///                     rows of the others are left as they are
/// \param lanes  lanes to fill, 1...simd::lanes; rounded up to whole vectors, all of which are written
/// \param out    steps rows of simd::lanes, aligned to simd::alignment
void normals(const LaneIdentities& who, Purpose purpose, std::uint64_t first_step, std::size_t steps, std::size_t lanes,
             double* out, std::size_t pair_stride = 1);

/// The deviate of one step of one gyro, equal to that of normals().
double normal(Identity who, Purpose purpose, std::uint64_t step);

}  // namespace ringlock::random
