#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "analysis/parts/manifest.hpp"
#include "analysis/parts/part_files.hpp"
#include "analysis/study/experiment.hpp"

/// A run divided into shards, which other processes and machines simulate.
namespace ringlock::parts {

/// Gyros of a shard. Blocks go round: block k of all points belongs to shard k mod N + 1, so that points that cost more
/// than others are shared alike. Blocks are full ones, or smaller where there would be fewer of them than shards.
/// Throws InputError where there are fewer gyros than shards.
std::vector<study::Stretch> stretches_of(const Shard& shard, std::span<const std::int64_t> gyros_of_points);

/// The parts of the stretches that belong to the shard.
std::vector<study::Stretch> within(std::span<const study::Stretch> stretches,
                                   std::span<const std::int64_t> gyros_of_points, const Shard& shard);

/// Writes a shard into a file that is there and empty. Throws RunError where the disk refuses.
///
/// \param wall_s  time that the shard took
void write_shard(const std::filesystem::path& file, const Manifest& manifest, const FinishedGyros& finished,
                 double wall_s);

/// Shards of one run.
class ShardSet {
   public:
    /// Reads which gyros the shards have. Throws InputError where a file is not a whole shard, where they are of
    /// different runs or of another number of shards, or where the program is another one than that which ran them.
    explicit ShardSet(std::span<const std::filesystem::path> files);

    const Manifest& manifest() const { return manifest_; }
    FinishedGyros& finished() { return finished_; }
    double wall_s() const { return wall_s_; }  ///< of all shards together

    /// Shards that have to be run again: their gyros are not all there.
    std::vector<Shard> missing(const study::Experiment& plan) const;

   private:
    Manifest manifest_;
    FinishedGyros finished_;
    double wall_s_ = 0.0;
};

}  // namespace ringlock::parts
