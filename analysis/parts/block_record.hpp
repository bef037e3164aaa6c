#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "analysis/study/study.hpp"

/// Results of a block of gyros as the content of a record.
namespace ringlock::parts {

std::vector<std::byte> pack(const study::FinishedBlock& block);
std::vector<std::byte> pack(const study::SampledAngles& samples);

/// Throws InputError where the bytes are not such a record.
study::FinishedBlock unpack_block(std::span<const std::byte> bytes);
study::SampledAngles unpack_samples(std::span<const std::byte> bytes);

/// The block that samples belong to.
struct BlockName {
    std::size_t study = 0;
    std::int64_t first_gyro = 0;

    auto operator<=>(const BlockName&) const = default;
};

/// That of a packed block or of packed samples, without unpacking them.
BlockName block_of(std::span<const std::byte> bytes);

}  // namespace ringlock::parts
