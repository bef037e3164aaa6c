#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace ringlock::closure {

/// Files that `ringlock closure -o` may write into a folder.
std::vector<std::filesystem::path> files_of(const std::filesystem::path& folder);

/// Refuses a folder in which the closed loop's files cannot be written or would replace others'. Replaced is only what
/// the closed loop has written itself and nobody has changed since: Markdown, TOML and SVG are known by their last line
/// (seal.hpp), closure.json by its keys and its form, closure.h5 by its attribute `format`. Throws InputError.
void check_folder(const std::filesystem::path& folder);

/// The same for a data chain: its page and its JSON, beside a folder for each record.
std::vector<std::filesystem::path> chain_files_of(const std::filesystem::path& folder);
void check_chain_folder(const std::filesystem::path& folder);
/// Names of the folders of its records, after their files and each another one.
std::vector<std::string> record_folders(const std::vector<std::string>& records);

}  // namespace ringlock::closure
