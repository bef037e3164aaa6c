#include "analysis/closure/report/folder.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <exception>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <system_error>

#include "analysis/closure/report/seal.hpp"
#include "analysis/record/record.hpp"
#include "engine/core/error.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/read_json.hpp"

namespace ringlock::closure {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 13> names = {
    "report.md",  "record.svg", "allan.svg",  "spectrum.svg", "folded.svg", "steps.svg",   "line-1.svg",
    "line-2.svg", "line-3.svg", "line-4.svg", "closed.toml",  "closure.h5", "closure.json"};

std::string text_of(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

/// Whether the text is an object of to_json(), of a record or of a data chain, in the form in which it is written.
bool is_closure_json(const std::string& text) {
    const auto object = parse_json(text, false);
    if (!object.is_object()) return false;
    const auto has = [&](std::initializer_list<const char*> keys) {
        return std::all_of(keys.begin(), keys.end(), [&](const char* key) { return object.contains(key); });
    };
    if (!has({"verdict", "base", "steps", "predictive"}) && !has({"chain", "records"})) return false;
    return json_text(object, 2) + "\n" == text;
}

bool is_ours(const fs::path& path) {
    std::error_code error;
    if (!fs::is_regular_file(path, error)) return false;
    if (path.extension() == ".json") return is_closure_json(text_of(path));
    if (path.extension() != ".h5") return is_sealed(text_of(path));
    try {
        return record::hdf5_format(path.string()) == "rlg-closure";
    } catch (const InputError&) {
        return false;
    }
}

/// Reason why the folder cannot be made, or nothing can be written into it; empty if there is none.
std::string why_not(fs::path folder) {
    std::error_code error;
    folder = fs::absolute(folder, error);
    while (!fs::exists(folder, error) && folder.has_relative_path()) folder = folder.parent_path();
    if (!fs::is_directory(folder, error)) return fmt::format("{} exists and is not a folder", printable(folder));
    if (access(folder.c_str(), W_OK | X_OK) == 0) return "";
    return fmt::format("{}: {}", printable(folder), std::generic_category().message(errno));
}

void check_files(const fs::path& folder, const std::vector<fs::path>& files) {
    if (const std::string why = why_not(folder); !why.empty()) {
        throw InputError(
            fmt::format("{}: the files of the closed loop cannot be written there: {}; give another folder with -o",
                        printable(folder), why));
    }
    std::string others;
    for (const fs::path& file : files) {
        std::error_code error;
        if (fs::symlink_status(file, error).type() == fs::file_type::not_found || is_ours(file)) continue;
        others += (others.empty() ? "" : ", ") + printable(file.filename());
    }
    if (others.empty()) return;
    throw InputError(
        fmt::format("{}: {} would be replaced, but ringlock closure did not write it, or it was changed since; "
                    "it is kept. Give another folder with -o, or move the file away",
                    printable(folder), others));
}

}  // namespace

std::vector<fs::path> files_of(const fs::path& folder) {
    std::vector<fs::path> files;
    for (const std::string_view name : names) files.push_back(folder / name);
    return files;
}

std::vector<fs::path> chain_files_of(const fs::path& folder) { return {folder / "report.md", folder / "closure.json"}; }

void check_folder(const fs::path& folder) { check_files(folder, files_of(folder)); }

void check_chain_folder(const fs::path& folder) { check_files(folder, chain_files_of(folder)); }

std::vector<std::string> record_folders(const std::vector<std::string>& records) {
    std::set<std::string> taken;
    for (const std::string_view name : names) taken.emplace(name);
    std::vector<std::string> folders;
    for (const std::string& record : records) {
        const std::string stem = fs::path(record).stem().string();
        std::string name = stem;
        for (int k = 2; !taken.insert(name).second; ++k) name = fmt::format("{}-{}", stem, k);
        folders.push_back(name);
    }
    return folders;
}

}  // namespace ringlock::closure
