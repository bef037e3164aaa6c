#include "analysis/export/blocks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::exports {
namespace {

bool lies_in(const std::string& path, const std::string& part) {
    return path == part || part == "/" || (path.starts_with(part) && path[part.size()] == '/');
}

std::string with_slash(std::string path) {
    while (path.size() > 1 && path.ends_with('/')) path.pop_back();
    return path.starts_with('/') ? path : "/" + path;
}

}  // namespace

std::uint64_t rows_of_block(std::uint64_t columns) {
    constexpr std::uint64_t values = std::uint64_t{1} << 17;
    return std::max<std::uint64_t>(1, values / std::max<std::uint64_t>(1, columns));
}

void each_block(const store::File& file, const store::ListedObject& dataset, const OnBlock& on_block) {
    if (dataset.shape.empty()) return on_block(store::read_values(file, dataset), 0, 1);
    const std::uint64_t step = rows_of_block(dataset.columns());
    for (std::uint64_t row = 0; row < dataset.rows(); row += step) {
        check_interrupt();
        const std::uint64_t rows = std::min(step, dataset.rows() - row);
        on_block(store::read_values(file, dataset, row, rows), row, rows);
    }
}

std::vector<store::ListedObject> part_of(const std::vector<store::ListedObject>& objects,
                                         const std::vector<std::string>& paths) {
    if (paths.empty()) return objects;
    std::vector<store::ListedObject> out;
    std::set<std::string> found;
    for (const store::ListedObject& object : objects) {
        bool inside = false;
        bool on_the_way = false;
        for (const std::string& given : paths) {
            const std::string path = with_slash(given);
            if (lies_in(object.path, path)) {
                inside = true;
                found.insert(given);
            }
            on_the_way = on_the_way || (!object.is_dataset && lies_in(path, object.path));
        }
        if (!inside && !on_the_way) continue;
        out.push_back(object);
        if (!inside) out.back().attributes.clear();
    }
    for (const std::string& path : paths) {
        if (found.contains(path)) continue;
        std::string known;
        for (const store::ListedObject& object : objects) {
            const bool is_group = !object.is_dataset && object.path != "/";
            if (is_group && std::count(object.path.begin(), object.path.end(), '/') <= 2)
                known += (known.empty() ? "" : ", ") + printable(object.path);
        }
        throw InputError(
            fmt::format("--only {}: the file has no such group or dataset; it has {} and what lies in these groups",
                        printable(path), known.empty() ? "none" : known));
    }
    return out;
}

void read_through(const store::File& file, const std::vector<store::ListedObject>& objects) {
    for (const store::ListedObject& object : objects) {
        if (object.is_dataset) each_block(file, object, [](const auto&, auto, auto) {});
    }
}

}  // namespace ringlock::exports
