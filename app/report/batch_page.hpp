#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "analysis/report/page/page.hpp"

namespace ringlock::app {

/// The page of a folder in which a batch has left batch.json: every scenario with its state, and the findings of each
/// result. Throws InputError where batch.json is damaged.
report::Page batch_page(const std::filesystem::path& folder);

/// The page of several results.
report::Page results_page(const std::vector<std::filesystem::path>& files, const std::string& title);

}  // namespace ringlock::app
