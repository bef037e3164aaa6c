#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/ensemble/block.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::ensemble {

/// The outputs of the readers of a block side by side, as a sink takes them.
///
/// Turns of a noisy drive come late or early, so that one gyro has put out more than another when a piece ends. Outputs
/// that are ahead wait here until all gyros have reached them.
class ReadOutputs {
   public:
    /// \param gyros  of the block
    ReadOutputs(const Schedule& schedule, std::size_t arms, std::size_t gyros);

    /// Takes the outputs of the readers in the piece that the block has gone through; outputs during the readers'
    /// warm-up and after the record are left out.
    void take(const GyroBlock& block);

    /// Outputs of an arm that the last take() has completed: [output][gyro] in counts of 1/counts_per_fringe fringes
    /// that wrap round (output_counts.hpp).
    std::span<const simd::LaneCounts> rows(std::size_t arm) const;
    /// Whether all outputs of the record have come.
    bool complete() const;

   private:
    struct Arm {
        std::vector<simd::LaneCounts> rows;  ///< from output `first` on
        std::int64_t first = 0;
        std::vector<std::int64_t> next;  ///< of each gyro, its next output
        std::size_t ready = 0;           ///< rows that all gyros have
    };
    void take(const reader::Reader& reader, double scale_factor_arcsec, std::size_t gyro, Arm& arm) const;

    std::int64_t warm_up_outputs_;
    std::int64_t outputs_;
    std::vector<Arm> arms_;
};

}  // namespace ringlock::ensemble
