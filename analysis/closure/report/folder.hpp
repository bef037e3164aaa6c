#pragma once
#include <filesystem>
#include <vector>

namespace ringlock::closure {

/// Files that `ringlock closure -o` may write into a folder.
std::vector<std::filesystem::path> files_of(const std::filesystem::path& folder);

/// Refuses a folder in which the closed loop's files cannot be written or would replace others'. Replaced is only what
/// the closed loop has written itself and nobody has changed since: Markdown, TOML and SVG are known by their last line
/// (seal.hpp), closure.json by its keys and its form, closure.h5 by its attribute `format`. Throws InputError.
void check_folder(const std::filesystem::path& folder);

}  // namespace ringlock::closure
