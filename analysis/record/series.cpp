#include "analysis/record/series.hpp"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "analysis/record/readers.hpp"
#include "engine/core/error.hpp"

namespace ringlock::record {

std::string listed(const std::vector<std::string>& names) {
    constexpr std::size_t most = 20;
    std::string out;
    for (std::size_t i = 0; i < names.size() && i < most; ++i) out += fmt::format("{}{}", i > 0 ? ", " : "", names[i]);
    if (names.size() > most) out += fmt::format(", ... ({} in all)", names.size());
    return out;
}

Series read_series(const std::string& path, const std::optional<std::string>& column) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) {
        throw InputError(fmt::format("{}: is a directory, must be a data file", path));
    }
    constexpr std::array<unsigned char, 8> signature = {0x89, 'H', 'D', 'F', '\r', '\n', 0x1a, '\n'};
    std::array<unsigned char, 8> head{};
    {
        const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), &std::fclose);
        if (!file) throw InputError(fmt::format("{}: cannot be opened: {}", path, std::strerror(errno)));
        // A pipe must be read once only and is always text.
        if (!std::filesystem::is_regular_file(path, ignored)) return read_text_series(path, column);
        if (std::fread(head.data(), 1, head.size(), file.get()) != head.size()) head = {};
    }
    return head == signature ? read_hdf5_series(path, column) : read_text_series(path, column);
}

}  // namespace ringlock::record
