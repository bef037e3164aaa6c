#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "analysis/parts/block_record.hpp"
#include "analysis/parts/manifest.hpp"
#include "analysis/study/experiment.hpp"
#include "engine/store/part_file.hpp"

/// Files of finished gyros: which records they have, and how their blocks come back into a study. Checkpoints and
/// shards are such files alike.
namespace ringlock::parts {

inline constexpr store::RecordKind manifest_record = 1;  ///< of the run, as JSON; the first record
inline constexpr store::RecordKind block_record = 2;     ///< a FinishedBlock
inline constexpr store::RecordKind samples_record = 3;   ///< SampledAngles, before the record of their block
inline constexpr store::RecordKind spent_record = 4;     ///< wall time that the run had taken then [s], a double

/// Adds the manifest: every file begins with it.
void add(store::PartWriter& writer, const Manifest& manifest);
void add_spent(store::PartWriter& writer, double wall_s);

/// The run that a file is of. Throws InputError where it is no such file.
Manifest read_manifest(const std::filesystem::path& file);

/// Finished blocks in files, each gyro once.
class FinishedGyros {
   public:
    explicit FinishedGyros(Manifest manifest) : manifest_(std::move(manifest)) {}

    /// Takes up a file after all of it is found whole and of this run. Blocks of gyros that are known already are left
    /// out. Returns the spent wall time in the file [s]. Throws InputError otherwise, having taken nothing.
    double add_file(const std::filesystem::path& file);
    /// Notes a block with the file that has it; `taken_up` where its point has it already.
    void add_block(std::size_t point, std::int64_t first_gyro, std::int64_t gyros, const std::filesystem::path& file,
                   bool taken_up);

    /// Puts finished gyros [first, last) of each point into the points, as far as these have them; each block once.
    /// Returns the missing gyros. Throws InputError where a block does not fit its point.
    std::vector<study::Stretch> take_up(std::span<study::Study> points, std::int64_t first, std::int64_t last);

    /// Gyros [first, last) of points of so many gyros that are not there.
    std::vector<study::Stretch> gaps(std::span<const std::int64_t> gyros_of_points, std::int64_t first,
                                     std::int64_t last) const;

    /// Hands on the samples of all blocks.
    void each_samples(const study::OnSamples& on_samples) const;

    /// Calls back with every record of the blocks, samples first.
    void each_record(const store::OnRecord& on_record) const;

    std::int64_t gyros() const;                        ///< finished, of all points
    std::vector<std::filesystem::path> files() const;  ///< that have them, sorted
    std::int64_t blocks() const { return static_cast<std::int64_t>(blocks_.size()); }
    double wall_s() const { return wall_s_; }  ///< longest spent time in a file

   private:
    struct Block {
        std::int64_t gyros = 0;
        std::filesystem::path file;
        bool taken_up = false;
    };
    bool overlaps(const BlockName& name, std::int64_t gyros) const;
    void put_into(study::Study& study, const study::FinishedBlock& block) const;

    Manifest manifest_;
    std::map<BlockName, Block> blocks_;
    double wall_s_ = 0.0;
};

}  // namespace ringlock::parts
