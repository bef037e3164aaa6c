#pragma once
#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/scenario/scenario.hpp"

namespace ringlock::parts {

/// One of several parts that a run is divided into.
struct Shard {
    std::int64_t count = 1;
    std::int64_t number = 1;  ///< from 1

    auto operator<=>(const Shard&) const = default;
};

/// "2/7"; throws InputError for anything else than two whole numbers, the first from 1 to the second.
Shard parse_shard(const std::string& text);
std::string to_string(const Shard& shard);

/// Which run finished gyros belong to. Gyros of two runs go together where all of it but the shard is equal.
struct Manifest {
    std::string program_version;
    std::string git_hash;
    scenario::Scenario scenario;  ///< as it was requested
    std::optional<Shard> shard;

    bool operator==(const Manifest&) const = default;
};

/// Of a run of this program.
Manifest manifest_of(const scenario::Scenario& scenario, const std::optional<Shard>& shard);

/// As JSON, canonical.
std::string to_json(const Manifest& manifest);
/// Reads it. Throws InputError naming the file `from` where the text is no manifest.
Manifest parse_manifest(std::string_view json, std::string_view from);

/// The differences of two runs, one line each; the shard is not compared.
std::vector<std::string> differences(const Manifest& before, const Manifest& now);

}  // namespace ringlock::parts
