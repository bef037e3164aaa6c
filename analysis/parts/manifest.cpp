#include "analysis/parts/manifest.hpp"

#include <fmt/format.h>

#include <charconv>
#include <nlohmann/json.hpp>

#include "engine/core/error.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/read_json.hpp"
#include "engine/core/version.hpp"
#include "engine/scenario/text/differences.hpp"
#include "engine/scenario/text/parse.hpp"
#include "engine/scenario/text/render.hpp"

namespace ringlock::parts {

namespace {

constexpr const char* format_name = "ringlock-parts";
constexpr int format_version = 1;

/// Scenarios of manifests were complete and checked when they were written.
std::vector<scenario::Complaint> no_rules(const scenario::Scenario&) { return {}; }

std::optional<std::int64_t> whole(std::string_view text) {
    std::int64_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return number;
}

}  // namespace

Shard parse_shard(const std::string& text) {
    const std::size_t slash = text.find('/');
    if (slash != std::string::npos) {
        const auto number = whole(std::string_view(text).substr(0, slash));
        const auto count = whole(std::string_view(text).substr(slash + 1));
        if (number && count && 1 <= *number && *number <= *count) return {*count, *number};
    }
    throw InputError(
        fmt::format("--shard {}: must be I/N, the I-th of N shards, such as 2/7; I goes from 1 to N", text));
}

std::string to_string(const Shard& shard) { return fmt::format("{}/{}", shard.number, shard.count); }

Manifest manifest_of(const scenario::Scenario& scenario, const std::optional<Shard>& shard) {
    return {std::string(version()), std::string(git_hash()), scenario, shard};
}

std::string to_json(const Manifest& manifest) {
    nlohmann::ordered_json json{{"format", format_name},
                                {"format_version", format_version},
                                {"program_version", manifest.program_version},
                                {"git_hash", manifest.git_hash},
                                {"shard", nullptr},
                                {"scenario", scenario::to_toml(manifest.scenario)}};
    if (manifest.shard) json["shard"] = to_string(*manifest.shard);
    return json_text(json, 2) + "\n";
}

Manifest parse_manifest(std::string_view text, std::string_view from) try {
    const auto json = parse_json(text);
    if (json.at("format") != format_name) throw InputError(fmt::format("{}: is not a part of a run of ringlock", from));
    if (json.at("format_version") != format_version) {
        throw InputError(fmt::format("{}: is of another version of ringlock (format {}, here {})", from,
                                     json_text(json.at("format_version")), format_version));
    }
    Manifest manifest;
    manifest.program_version = json.at("program_version");
    manifest.git_hash = json.at("git_hash");
    if (!json.at("shard").is_null()) manifest.shard = parse_shard(json.at("shard"));
    manifest.scenario = scenario::parse_string(json.at("scenario").get<std::string>(), from, {}, no_rules);
    return manifest;
} catch (const nlohmann::json::exception& error) {
    throw InputError(fmt::format("{}: does not say of which run it is: {}", from, error.what()));
}

std::vector<std::string> differences(const Manifest& before, const Manifest& now) {
    std::vector<std::string> found = scenario::differences(before.scenario, now.scenario);
    const auto compare = [&](const char* what, const std::string& then, const std::string& today) {
        if (then != today) found.push_back(fmt::format("{}: {} before, {} now", what, then, today));
    };
    compare("program version", before.program_version, now.program_version);
    compare("commit of the program", before.git_hash, now.git_hash);
    return found;
}

}  // namespace ringlock::parts
