#include "analysis/record/container.hpp"

#include <array>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string_view>

#include "analysis/record/arrays/npy_header.hpp"
#include "analysis/record/record.hpp"
#include "analysis/text/words.hpp"

namespace ringlock::record {
namespace {

/// Head of MAT-files of version 5: 124 bytes of text, then 0x0100 and "MI" in the byte order of the writer.
bool is_mat(std::string_view head) {
    constexpr std::size_t text_bytes = 124;
    if (head.size() < text_bytes + 4 || !head.starts_with("MATLAB")) return false;
    const std::string_view mark = head.substr(text_bytes, 4);
    return mark == std::string_view("\x00\x01IM", 4) || mark == std::string_view("\x01\x00MI", 4);
}

}  // namespace

Container container_of(const std::string& path) {
    if (path == text::standard_input) return Container::text;
    if (is_hdf5(path)) return Container::hdf5;
    std::error_code unknown;
    if (!std::filesystem::is_regular_file(path, unknown)) return Container::text;
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), &std::fclose);
    if (!file) return Container::text;  // the reader of text reports the error
    std::array<char, 128> bytes{};
    const std::string_view head(bytes.data(), std::fread(bytes.data(), 1, bytes.size(), file.get()));
    if (head.starts_with(npy_magic)) return Container::npy;
    // An entry of a zip archive, or the end of one without entries.
    if (head.starts_with("PK\x03\x04") || head.starts_with("PK\x05\x06")) return Container::npz;
    return is_mat(head) ? Container::mat : Container::text;
}

const char* name_of(Container container) {
    switch (container) {
        case Container::hdf5:
            return "HDF5";
        case Container::npy:
            return "an array of NumPy (.npy)";
        case Container::npz:
            return "an archive of arrays of NumPy (.npz)";
        case Container::mat:
            return "a file of MATLAB (.mat)";
        case Container::text:
            break;
    }
    return "text";
}

}  // namespace ringlock::record
