#pragma once
#include <cstddef>
#include <cstdint>

/// Many gyros at once: every array of a block of gyros has one column for each of `lanes` of them.
namespace ringlock::simd {

/// Gyros of a block. Two vectors of AVX-512, four of AVX2: enough independent work to hide the latency of one turn.
inline constexpr std::size_t lanes = 16;
/// Alignment of such arrays [bytes].
inline constexpr std::size_t alignment = 64;

/// One value for each gyro of a block.
struct alignas(alignment) Lanes {
    double values[lanes] = {};
    double& operator[](std::size_t lane) { return values[lane]; }
    double operator[](std::size_t lane) const { return values[lane]; }
    double* data() { return values; }
    const double* data() const { return values; }
};

/// One whole number for each gyro of a block.
struct alignas(alignment) LaneCounts {
    std::int64_t values[lanes] = {};
    std::int64_t& operator[](std::size_t lane) { return values[lane]; }
    std::int64_t operator[](std::size_t lane) const { return values[lane]; }
    std::int64_t* data() { return values; }
    const std::int64_t* data() const { return values; }
};

}  // namespace ringlock::simd
