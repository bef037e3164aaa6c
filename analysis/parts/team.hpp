#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "analysis/study/study.hpp"
#include "engine/ensemble/block_source.hpp"
#include "engine/ensemble/progress/observer.hpp"

/// Several processes that simulate one run together. One of them leads: it holds the folder of the run, decides which
/// gyros are simulated next and writes the result. The others are its members; each writes the blocks that it has
/// finished into the same folder and reports them.
namespace ringlock::parts {

/// The gyros that all processes simulate next.
struct Order {
    std::string manifest;                   ///< of the run, as JSON: that of each member must be the same
    std::int64_t gyros = 0;                 ///< of each point, where the lot grows
    std::vector<study::Stretch> stretches;  ///< which gyros
};

/// The leader's side.
class Leader : public ensemble::BlockSource {
   public:
    virtual int members() const = 0;    ///< the leader apart
    virtual void use(int threads) = 0;  ///< of each process, the leader included
    /// Has the members simulate this, together with the leader.
    virtual void give(const Order& order) = 0;
    /// Waits until every member has carried out the order, and returns the files that they have written. Throws
    /// Interrupted.
    virtual std::vector<std::filesystem::path> wait_for_reports() = 0;
    /// Sets the observer of the members' blocks, from the next begin() on; null: no observer.
    virtual void tell(ensemble::Observer* observer) = 0;
};

/// A member's side.
class Member : public ensemble::BlockSource {
   public:
    virtual int rank() const = 0;  ///< from 1
    /// Waits for the next order; nothing when the run is over. Throws Interrupted.
    virtual std::optional<Order> next_order() = 0;
    /// The order is carried out, and these files have its gyros.
    virtual void report(const std::vector<std::filesystem::path>& files) = 0;
    /// Reports the progress of blocks to the leader.
    virtual ensemble::Observer& observer() = 0;
};

}  // namespace ringlock::parts
