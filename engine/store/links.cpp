#include "engine/store/links.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <cstring>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/core/printable.hpp"
#include "engine/store/guard.hpp"

namespace ringlock::store::detail {
namespace {

namespace fs = std::filesystem;

std::string refused;

/// Name of the file that holds an open object.
std::string file_of(hid_t object) {
    std::string name(static_cast<std::size_t>(std::max<ssize_t>(0, H5Fget_name(object, nullptr, 0))), '\0');
    if (!name.empty()) H5Fget_name(object, name.data(), name.size() + 1);
    return name;
}

/// Path of a file that another file names: relative to the folder of the latter, unless the name is absolute.
fs::path in_same_folder(const std::string& file, const std::string& name) {
    return fs::path(file).parent_path() / name;
}

/// Opens the target of an external link, where that is allowed: only a regular file, for a FIFO would wait.
hid_t open_external(hid_t group, const std::string& file, const std::string& object, hid_t access) {
    if (links_in_force() == Links::refuse) {
        refused = fmt::format("an external link leads to {} in another file, {}", printable(object), printable(file));
        return H5I_INVALID_HID;
    }
    const fs::path path = in_same_folder(file_of(group), file);
    std::error_code unreachable;
    if (!fs::is_regular_file(path, unreachable)) {
        refused = fmt::format("an external link leads to the file {}, which cannot be read", printable(path));
        return H5I_INVALID_HID;
    }
    const hid_t other = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
    if (other < 0) return H5I_INVALID_HID;
    const hid_t found = H5Oopen(other, object.c_str(), access);
    H5Fclose(other);  // stays open as long as the object does
    return found;
}

hid_t traverse(const char* /*link*/, hid_t group, const void* data, size_t size, hid_t access, hid_t /*transfer*/) {
    try {
        const char* file = nullptr;
        const char* object = nullptr;
        if (H5Lunpack_elink_val(data, size, nullptr, &file, &object) < 0) return H5I_INVALID_HID;
        return open_external(group, file, object, access);
    } catch (...) {
        return H5I_INVALID_HID;  // the library is written in C
    }
}

ssize_t query(const char* /*link*/, const void* data, size_t size, void* buffer, size_t room) {
    if (buffer != nullptr) std::memcpy(buffer, data, std::min(size, room));
    return static_cast<ssize_t>(size);
}

}  // namespace

void take_over_external_links() {
    static const H5L_class_t ours{H5L_LINK_CLASS_T_VERS,
                                  H5L_TYPE_EXTERNAL,
                                  "external links on request",
                                  nullptr,
                                  nullptr,
                                  nullptr,
                                  traverse,
                                  nullptr,
                                  query};
    H5Lregister(&ours);
}

std::string refused_link() { return std::exchange(refused, ""); }

std::vector<std::string> external_files(std::int64_t creation) {
    std::vector<std::string> files;
    std::string name(4096, '\0');
    const int count = H5Pget_external_count(creation);
    for (int i = 0; i < count; ++i) {
        off_t offset = 0;
        hsize_t size = 0;
        if (H5Pget_external(creation, static_cast<unsigned>(i), name.size(), name.data(), &offset, &size) < 0) break;
        name.back() = '\0';
        files.emplace_back(name.c_str());
    }
    return files;
}

std::vector<std::string> virtual_files(std::int64_t creation) {
    std::vector<std::string> files;
    std::size_t count = 0;
    if (H5Pget_virtual_count(creation, &count) < 0) return files;
    for (std::size_t i = 0; i < count; ++i) {
        const ssize_t length = H5Pget_virtual_filename(creation, i, nullptr, 0);
        if (length <= 0) continue;
        std::string name(static_cast<std::size_t>(length), '\0');
        H5Pget_virtual_filename(creation, i, name.data(), name.size() + 1);
        if (name != ".") files.push_back(std::move(name));
    }
    return files;
}

bool is_readable_in_same_folder(std::int64_t object, const std::string& name) {
    // "%b" in a name stands for the number of a block: there may be any number of files of that form.
    if (name.find('%') != std::string::npos) return true;
    std::error_code unreachable;
    return fs::is_regular_file(in_same_folder(file_of(object), name), unreachable);
}

}  // namespace ringlock::store::detail
