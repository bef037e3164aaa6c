#include "analysis/parts/shard.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>

#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::parts {

namespace {

using Gyros = std::span<const std::int64_t>;

std::int64_t blocks_of(Gyros gyros_of_points, std::int64_t size) {
    std::int64_t blocks = 0;
    for (const std::int64_t gyros : gyros_of_points) blocks += (gyros + size - 1) / size;
    return blocks;
}

/// Gyros of a block such that every shard gets one.
std::int64_t block_size(Gyros gyros_of_points, std::int64_t shards) {
    const std::int64_t all = std::accumulate(gyros_of_points.begin(), gyros_of_points.end(), std::int64_t{0});
    if (all < shards) throw InputError(fmt::format("{} gyros cannot be divided into {} shards", all, shards));
    std::int64_t size = simd::lanes;
    while (blocks_of(gyros_of_points, size) < shards) size /= 2;
    return size;
}

}  // namespace

std::vector<study::Stretch> stretches_of(const Shard& shard, Gyros gyros_of_points) {
    const std::int64_t size = block_size(gyros_of_points, shard.count);
    std::vector<study::Stretch> all;
    std::int64_t block = 0;
    for (std::size_t point = 0; point < gyros_of_points.size(); ++point) {
        const std::int64_t gyros = gyros_of_points[point];
        for (std::int64_t first = 0; first < gyros; first += size, ++block) {
            if (block % shard.count != shard.number - 1) continue;
            const std::int64_t last = std::min(first + size, gyros);
            if (!all.empty() && all.back().study == point && all.back().last == first) {
                all.back().last = last;
            } else {
                all.push_back({point, first, last});
            }
        }
    }
    return all;
}

std::vector<study::Stretch> within(std::span<const study::Stretch> stretches, Gyros gyros_of_points,
                                   const Shard& shard) {
    std::vector<study::Stretch> found;
    for (const study::Stretch& mine : stretches_of(shard, gyros_of_points)) {
        for (const study::Stretch& stretch : stretches) {
            const std::int64_t first = std::max(mine.first, stretch.first);
            const std::int64_t last = std::min(mine.last, stretch.last);
            if (stretch.study == mine.study && first < last) found.push_back({mine.study, first, last});
        }
    }
    return found;
}

void write_shard(const std::filesystem::path& file, const Manifest& manifest, const FinishedGyros& finished,
                 double wall_s) {
    store::PartWriter writer(file, store::PartWriter::Open::existing,
                             [](const std::string& problem, int) { throw RunError(problem); });
    add(writer, manifest);
    finished.each_record([&](store::RecordKind kind, std::span<const std::byte> content) {
        writer.add(kind, content);
        return true;
    });
    add_spent(writer, wall_s);
    writer.close();
}

namespace {

Manifest first_manifest(std::span<const std::filesystem::path> files) {
    if (files.empty()) throw InputError("no shard is given");
    return read_manifest(files.front());
}

}  // namespace

ShardSet::ShardSet(std::span<const std::filesystem::path> files)
    : manifest_(first_manifest(files)), finished_(manifest_) {
    const std::vector<std::string> other = differences(manifest_, manifest_of(manifest_.scenario, {}));
    if (!other.empty()) {
        throw InputError(fmt::format("{}: was run by another program: {}; merge with that one, or run the shards again",
                                     printable(files.front()), fmt::join(other, "; ")));
    }
    for (const std::filesystem::path& file : files) {
        const Manifest manifest = read_manifest(file);
        if (!manifest.shard || manifest.shard->count != manifest_.shard.value_or(Shard{}).count) {
            throw InputError(
                fmt::format("{}: is {}; all must be shards of one division, as {} is ({})", printable(file),
                            manifest.shard ? "shard " + to_string(*manifest.shard) : "no shard",
                            printable(files.front()), manifest_.shard ? to_string(*manifest_.shard) : "no shard"));
        }
        const std::vector<std::string> unlike = differences(manifest_, manifest);
        if (!unlike.empty()) {
            throw InputError(fmt::format("{}: is of another run than {}; they differ in\n  {}", printable(file),
                                         printable(files.front()), fmt::join(unlike, "\n  ")));
        }
        wall_s_ += finished_.add_file(file);
    }
}

std::vector<Shard> ShardSet::missing(const study::Experiment& plan) const {
    std::vector<std::int64_t> gyros;
    for (const study::Study& point : plan.points) gyros.push_back(static_cast<std::int64_t>(point.gyros.size()));
    const std::vector<study::Stretch> gaps = finished_.gaps(gyros, 0, std::numeric_limits<std::int64_t>::max());
    const std::int64_t count = manifest_.shard.value_or(Shard{}).count;
    std::vector<Shard> found;
    for (std::int64_t number = 1; number <= count; ++number) {
        if (!within(gaps, gyros, {count, number}).empty()) found.push_back({count, number});
    }
    return found;
}

}  // namespace ringlock::parts
