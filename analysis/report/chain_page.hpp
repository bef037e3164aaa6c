#pragma once
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "analysis/closure/chain.hpp"

namespace ringlock::report {

/// Writes report.md, a page about a data chain for people who have not read docs/closure.md, and closure.json into the
/// folder, in which each record has one of its own already.
///
/// Throws InputError where they cannot be written there, RunError where the disk refuses.
/// \param folders  names of the folders of the records
/// \param object   the object that --json prints
void write_chain_page(const std::filesystem::path& folder, const closure::Chain& chain,
                      const std::vector<std::string>& folders, const nlohmann::json& object);

}  // namespace ringlock::report
