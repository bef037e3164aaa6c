#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace ringlock::ensemble {

/// A block of gyros that is to be simulated.
struct PlannedBlock {
    std::int64_t gyros = 0;
    std::int64_t turns = 0;  ///< of all its gyros, as BlockResult::turns counts them
};

/// Stage of a block; it goes through all stages in this order, once.
enum class BlockStage {
    set_up,  ///< its gyros are drawn
    turns,   ///< goes through the turns
    output,  ///< its statistics are finished and handed on
    over,    ///< done, or failed
};

/// Receives the progress of a simulation while it runs. All functions may be called from any thread, those about one
/// block from one thread after the other.
class Observer {
   public:
    virtual ~Observer() = default;
    /// The stage `name` begins, which is not the simulation of gyros. It lasts until plan() or the next stage.
    virtual void stage(const std::string& name) = 0;
    /// These blocks are simulated next, as many at a time as there are threads. Blocks planned before are over.
    virtual void plan(std::span<const PlannedBlock> blocks, int threads) = 0;
    /// A block, by its place in the plan, is at this stage from now on.
    virtual void enter(std::size_t block, BlockStage stage) = 0;
    /// A block is done with so many gyros and turns more. `tabulated`: turn maps were tabulated on the way, which takes
    /// much longer than the turns themselves: at the first turns of a block, and wherever its drive leaves their
    /// ranges.
    virtual void advance(std::size_t block, std::int64_t gyros, std::int64_t turns, bool tabulated) = 0;
};

}  // namespace ringlock::ensemble
