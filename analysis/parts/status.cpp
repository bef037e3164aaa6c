#include "analysis/parts/status.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <system_error>

#include "analysis/parts/folder.hpp"
#include "engine/core/error.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/read_json.hpp"
#include "engine/core/system_text.hpp"

namespace ringlock::parts {

void replace_text(const std::filesystem::path& file, const std::string& text) {
    const std::filesystem::path partial = file.string() + std::string(partial_suffix);
    errno = 0;
    std::ofstream out(partial, std::ios::binary);
    out << text;
    out.close();
    if (!out) throw RunError(fmt::format("{}: cannot be written: {}", printable(file), system_text(errno)));
    std::error_code error;
    std::filesystem::rename(partial, file, error);
    if (error) throw RunError(fmt::format("{}: cannot be named: {}", printable(file), error.message()));
}

void write_status(const std::filesystem::path& folder, const Status& status) {
    nlohmann::ordered_json json{
        {"process", status.process}, {"time_utc", status.time_utc},    {"elapsed_s", status.elapsed_s},
        {"gyros", status.gyros},     {"of_gyros", status.of_gyros},    {"turns_per_s", status.turns_per_s},
        {"left_s", nullptr},         {"last_block", status.last_block}};
    if (status.left_s) json["left_s"] = *status.left_s;
    try {
        replace_text(folder / status_name, json_text(json, 2) + "\n");
    } catch (const RunError&) {
        return;
    }
}

std::optional<Status> read_status(const std::filesystem::path& folder) try {
    std::ifstream in(folder / status_name);
    if (!in) return std::nullopt;
    const auto json = parse_json(std::string(std::istreambuf_iterator<char>(in), {}));
    Status status;
    status.process = json.at("process");
    status.time_utc = json.at("time_utc");
    status.elapsed_s = json.at("elapsed_s");
    status.gyros = json.at("gyros");
    status.of_gyros = json.at("of_gyros");
    status.turns_per_s = json.at("turns_per_s");
    if (!json.at("left_s").is_null()) status.left_s = json.at("left_s").get<double>();
    status.last_block = json.at("last_block");
    return status;
} catch (const nlohmann::json::exception&) {
    return std::nullopt;
}

}  // namespace ringlock::parts
