#include "analysis/parts/part_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string_view>
#include <utility>

#include "analysis/parts/archive.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::parts {

void add(store::PartWriter& writer, const Manifest& manifest) {
    const std::string json = to_json(manifest);
    writer.add(manifest_record, std::as_bytes(std::span(json)));
}

void add_spent(store::PartWriter& writer, double wall_s) {
    writer.add(spent_record, std::as_bytes(std::span(&wall_s, 1)));
}

namespace {

std::string_view as_text(std::span<const std::byte> content) {
    return {reinterpret_cast<const char*>(content.data()), content.size()};
}

}  // namespace

Manifest read_manifest(const std::filesystem::path& file) {
    std::optional<Manifest> manifest;
    store::read_part(file, [&](store::RecordKind kind, std::span<const std::byte> content) {
        if (kind == manifest_record) manifest = parse_manifest(as_text(content), printable(file));
        return false;
    });
    if (!manifest) throw InputError(fmt::format("{}: does not say of which run it is", printable(file)));
    return *manifest;
}

double FinishedGyros::add_file(const std::filesystem::path& file) {
    const Manifest of = read_manifest(file);
    const std::vector<std::string> other = differences(of, manifest_);
    if (!other.empty()) throw InputError(fmt::format("{}: is of another run: {}", printable(file), other.front()));
    std::vector<std::pair<BlockName, std::int64_t>> found;
    double spent_s = 0.0;
    store::read_part(file, [&](store::RecordKind kind, std::span<const std::byte> content) {
        if (kind == block_record) {
            const study::FinishedBlock block = unpack_block(content);
            found.push_back({{block.study, block.first_gyro}, static_cast<std::int64_t>(block.gyros.size())});
        } else if (kind == spent_record) {
            Unpacker archive(content);
            archive(spent_s);
        }
        return true;
    });
    for (const auto& [name, gyros] : found) add_block(name.study, name.first_gyro, gyros, file, false);
    wall_s_ = std::max(wall_s_, spent_s);
    return spent_s;
}

void FinishedGyros::add_block(std::size_t point, std::int64_t first_gyro, std::int64_t gyros,
                              const std::filesystem::path& file, bool taken_up) {
    const BlockName name{point, first_gyro};
    if (gyros > 0 && !overlaps(name, gyros)) blocks_.emplace(name, Block{gyros, file, taken_up});
}

bool FinishedGyros::overlaps(const BlockName& name, std::int64_t gyros) const {
    const auto after = blocks_.lower_bound(name);
    if (after != blocks_.end() && after->first.study == name.study &&
        after->first.first_gyro < name.first_gyro + gyros) {
        return true;
    }
    if (after == blocks_.begin()) return false;
    const auto& [before, block] = *std::prev(after);
    return before.study == name.study && before.first_gyro + block.gyros > name.first_gyro;
}

void FinishedGyros::put_into(study::Study& study, const study::FinishedBlock& block) const {
    bool fits = block.first_gyro >= 0 && block.arms.size() == study.arms.size() &&
                static_cast<std::size_t>(block.first_gyro) + block.gyros.size() <= study.gyros.size();
    for (const auto& arm : block.arms) fits = fits && arm.size() == block.gyros.size();
    if (!fits) throw InputError("a block of gyros does not fit the scenario that its file names");
    study::take_up(study, block);
}

std::vector<study::Stretch> FinishedGyros::take_up(std::span<study::Study> points, std::int64_t first,
                                                   std::int64_t last) {
    const auto end_of = [&](std::size_t point) {
        return std::min(last, static_cast<std::int64_t>(points[point].gyros.size()));
    };
    const auto wanted = [&](const BlockName& name, const Block& block) {
        return name.study < points.size() && name.first_gyro >= first &&
               name.first_gyro + block.gyros <= end_of(name.study);
    };
    std::set<std::filesystem::path> files;
    for (const auto& [name, block] : blocks_) {
        if (wanted(name, block) && !block.taken_up) files.insert(block.file);
    }
    for (const auto& file : files) {
        store::read_part(file, [&](store::RecordKind kind, std::span<const std::byte> content) {
            if (kind != block_record) return true;
            const auto known = blocks_.find(block_of(content));
            if (known == blocks_.end() || known->second.file != file || known->second.taken_up) return true;
            if (!wanted(known->first, known->second)) return true;
            put_into(points[known->first.study], unpack_block(content));
            known->second.taken_up = true;
            return true;
        });
    }
    std::vector<std::int64_t> gyros_of_points;
    for (const study::Study& point : points) gyros_of_points.push_back(static_cast<std::int64_t>(point.gyros.size()));
    return gaps(gyros_of_points, first, last);
}

std::vector<study::Stretch> FinishedGyros::gaps(std::span<const std::int64_t> gyros_of_points, std::int64_t first,
                                                std::int64_t last) const {
    std::vector<std::vector<study::Stretch>> there(gyros_of_points.size());
    const auto end_of = [&](std::size_t point) { return std::min(last, gyros_of_points[point]); };
    for (const auto& [name, block] : blocks_) {
        const std::int64_t end = name.first_gyro + block.gyros;
        if (name.study >= there.size() || name.first_gyro < first || end > end_of(name.study)) continue;
        there[name.study].push_back({name.study, name.first_gyro, end});
    }
    std::vector<study::Stretch> all;
    for (std::size_t point = 0; point < there.size(); ++point) {
        const std::vector<study::Stretch> more = study::missing(point, first, end_of(point), std::move(there[point]));
        all.insert(all.end(), more.begin(), more.end());
    }
    return all;
}

void FinishedGyros::each_record(const store::OnRecord& on_record) const {
    for (const auto& file : files()) {
        const auto from_here = [&](const BlockName& name) {
            const auto known = blocks_.find(name);
            return known != blocks_.end() && known->second.file == file;
        };
        store::read_part(file, [&](store::RecordKind kind, std::span<const std::byte> content) {
            if (kind != block_record && kind != samples_record) return true;
            return !from_here(block_of(content)) || on_record(kind, content);
        });
    }
}

void FinishedGyros::each_samples(const study::OnSamples& on_samples) const {
    each_record([&](store::RecordKind kind, std::span<const std::byte> content) {
        if (kind == samples_record) on_samples(unpack_samples(content));
        return true;
    });
}

std::int64_t FinishedGyros::gyros() const {
    std::int64_t sum = 0;
    for (const auto& [name, block] : blocks_) sum += block.gyros;
    return sum;
}

std::vector<std::filesystem::path> FinishedGyros::files() const {
    std::set<std::filesystem::path> files;
    for (const auto& [name, block] : blocks_) files.insert(block.file);
    return {files.begin(), files.end()};
}

}  // namespace ringlock::parts
