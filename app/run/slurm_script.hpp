#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace ringlock::app {

/// A run as an array of Slurm jobs, one for each shard, and a merge that depends on them.
struct SlurmJobs {
    std::string program;  ///< these three are absolute paths
    std::string scenario;
    std::string result;
    std::vector<std::string> options;  ///< of `ringlock run`, beyond those of its shard
    std::string note;                  ///< a comment: how the shards were sized
    std::int64_t shards = 1;
    int threads = 1;                   ///< of a shard
    std::int64_t memory_mb = 0;        ///< of a shard
    std::int64_t shard_limit_min = 0;  ///< after which Slurm ends a shard
    std::int64_t merge_limit_min = 0;  ///< after which it ends the merge
};

/// Times that shards are submitted before the merge gives up.
inline constexpr int slurm_tries = 3;

/// The word quoted for a POSIX shell, for any content.
std::string shell_quoted(const std::string& word);

/// A script for bash: run by hand it submits the shards and the merge; as a job of Slurm it simulates one shard or
/// merges, according to its arguments. The merge waits for the shards however they end (`afterany`; one that depends on
/// `afterok` waits for ever once a shard has failed), looks for missing shards, and submits these and itself again.
std::string slurm_script(const SlurmJobs& jobs);

}  // namespace ringlock::app
