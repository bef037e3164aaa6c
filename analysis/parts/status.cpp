#include "analysis/parts/status.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "analysis/parts/folder.hpp"

namespace ringlock::parts {

void write_status(const std::filesystem::path& folder, const Status& status) {
    nlohmann::ordered_json json{
        {"process", status.process}, {"time_utc", status.time_utc},    {"elapsed_s", status.elapsed_s},
        {"gyros", status.gyros},     {"of_gyros", status.of_gyros},    {"turns_per_s", status.turns_per_s},
        {"left_s", nullptr},         {"last_block", status.last_block}};
    if (status.left_s) json["left_s"] = *status.left_s;
    // Renamed so that nobody reads half of it; not synced, since after a crash of the machine it is worth nothing.
    const std::filesystem::path partial = folder / fmt::format("{}{}", status_name, partial_suffix);
    std::ofstream out(partial);
    out << json.dump(2) << '\n';
    out.close();
    std::error_code ignored;
    if (out) std::filesystem::rename(partial, folder / status_name, ignored);
}

std::optional<Status> read_status(const std::filesystem::path& folder) try {
    std::ifstream in(folder / status_name);
    if (!in) return std::nullopt;
    const auto json = nlohmann::json::parse(in);
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
