#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace ringlock::closure {

/// Files that `ringlock closure -o` may write into a folder.
std::vector<std::filesystem::path> files_of(const std::filesystem::path& folder);

/// Throws InputError for a folder in which the closed loop's files cannot be written or would replace other files. Only
/// files are replaced that the closed loop has written itself and that have not been changed since: Markdown, TOML and
/// SVG are identified by their last line (seal.hpp), closure.json by its keys and its form, closure.h5 by its attribute
/// `format`.
void check_folder(const std::filesystem::path& folder);

/// The same for a data chain: its page and its JSON, next to a folder for each record.
std::vector<std::filesystem::path> chain_files_of(const std::filesystem::path& folder);
void check_chain_folder(const std::filesystem::path& folder);
/// Names of the folders of its records, from the names of their files, without repetitions.
std::vector<std::string> record_folders(const std::vector<std::string>& records);

}  // namespace ringlock::closure
