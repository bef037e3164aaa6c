#pragma once
#include <cstddef>
#include <optional>

namespace ringlock::ensemble {

/// Hands out the blocks of a simulation that several processes share. All of them simulate the same jobs; each block is
/// given to one of them.
class BlockSource {
   public:
    virtual ~BlockSource() = default;
    /// Threads of all processes together. The size of the blocks follows from it, so all processes must agree on it.
    virtual int threads() const = 0;
    /// A simulation of so many blocks begins. Each process calls this before it requests its first block.
    virtual void begin(std::size_t blocks) = 0;
    /// A block that no other process has, by its place in the plan; nothing when all are given out. From any thread.
    virtual std::optional<std::size_t> next() = 0;
};

}  // namespace ringlock::ensemble
