#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "engine/store/hdf5.hpp"
#include "engine/store/library.hpp"
#include "engine/store/links.hpp"

namespace ringlock::store {

using detail::Lock;

namespace {

/// Files are written under a name of their own and read when complete: locks would guard nothing, and network file
/// systems often refuse them.
Id file_access() {
    Id access(H5Pcreate(H5P_FILE_ACCESS));
    H5Pset_file_locking(access.get(), false, true);
    H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG);
    return access;
}

/// Whether `name` leads to an object; checks step by step because the library requires it.
bool exists(hid_t group, const std::string& name) {
    if (name.empty() || name == "/") return true;
    for (std::size_t end = name.find('/', 1);; end = name.find('/', end + 1)) {
        const std::string step = name.substr(0, end);
        if (H5Lexists(group, step.c_str(), H5P_DEFAULT) <= 0) return false;
        if (H5Oexists_by_name(group, step.c_str(), H5P_DEFAULT) <= 0) return false;
        if (end == std::string::npos) return true;
    }
}

H5O_type_t type_of(hid_t group, const std::string& name) {
    H5O_info_t info;
    if (!exists(group, name) || H5Oget_info_by_name2(group, name.c_str(), &info, H5O_INFO_BASIC, H5P_DEFAULT) < 0)
        return H5O_TYPE_UNKNOWN;
    return info.type;
}

herr_t collect_name(hid_t /*group*/, const char* name, const H5L_info_t* /*info*/, void* names) {
    static_cast<std::vector<std::string>*>(names)->emplace_back(name);
    return 0;
}

}  // namespace

Node::Node(Id id, std::string file, std::string path)
    : id_(std::move(id)), file_(std::move(file)), path_(std::move(path)) {}

Group::Group(Id id, std::string file, std::string path) : Node(std::move(id), std::move(file), std::move(path)) {}

std::string Group::child_path(const std::string& name) const {
    if (name.starts_with('/')) return name;
    return path() == "/" ? "/" + name : path() + "/" + name;
}

Group Group::create_group(const std::string& name) {
    const Lock lock;
    const Id links(H5Pcreate(H5P_LINK_CREATE));
    H5Pset_create_intermediate_group(links.get(), true);
    const Id creation(H5Pcreate(H5P_GROUP_CREATE));
    H5Pset_obj_track_times(creation.get(), false);
    Id made(H5Gcreate2(id().get(), name.c_str(), links.get(), creation.get(), H5P_DEFAULT));
    if (!made.valid()) detail::fail_run(file(), child_path(name), "cannot be created");
    return Group(std::move(made), file(), child_path(name));
}

Id Group::open(const std::string& name, bool want_group) const {
    const int type = type_in_this_file(name);
    const std::string path = child_path(name);
    if (type == H5O_TYPE_UNKNOWN)
        detail::fail_input(file(), path, want_group ? "the group is missing" : "the dataset is missing");
    if ((type == H5O_TYPE_GROUP) != want_group || type == H5O_TYPE_NAMED_DATATYPE)
        detail::fail_input(file(), path, want_group ? "must be a group" : "must be a dataset");
    Id opened(H5Oopen(id().get(), name.c_str(), H5P_DEFAULT));
    if (!opened.valid()) detail::fail_input(file(), path, "cannot be opened");
    return opened;
}

Group Group::group(const std::string& name) const {
    const Lock lock;
    return Group(open(name, true), file(), child_path(name));
}

Dataset Group::dataset(const std::string& name) const {
    const Lock lock;
    return Dataset::opened(open(name, false), file(), child_path(name));
}

int Group::type_in_this_file(const std::string& name) const {
    static_cast<void>(detail::refused_link());  // of an earlier call
    const H5O_type_t type = type_of(id().get(), name);
    if (const std::string why = detail::refused_link(); type == H5O_TYPE_UNKNOWN && !why.empty()) {
        detail::fail_input(file(), child_path(name),
                           fmt::format("{}, and only the file that was named is read. Give --follow-links to a command "
                                       "that has it, or name that file",
                                       why));
    }
    return type;
}

bool Group::has(const std::string& name) const {
    const Lock lock;
    return name.empty() || name == "/" || type_in_this_file(name) != H5O_TYPE_UNKNOWN;
}

bool Group::has_group(const std::string& name) const {
    const Lock lock;
    return type_in_this_file(name) == H5O_TYPE_GROUP;
}

bool Group::has_dataset(const std::string& name) const {
    const Lock lock;
    return type_in_this_file(name) == H5O_TYPE_DATASET;
}

std::vector<std::string> Group::children() const {
    const Lock lock;
    std::vector<std::string> names;
    if (H5Literate(id().get(), H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, collect_name, &names) < 0)
        detail::fail_input(file(), path(), "the group cannot be listed");
    std::ranges::sort(names);
    return names;
}

File::File(Id file, Id root, std::string path)
    : Group(std::move(root), std::move(path), "/"), file_id_(std::move(file)) {}

File File::create(const std::filesystem::path& path, const std::filesystem::path& shown_as) {
    const Lock lock;
    const Id creation(H5Pcreate(H5P_FILE_CREATE));
    H5Pset_obj_track_times(creation.get(), false);
    Id file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation.get(), file_access().get()));
    if (!file.valid()) detail::fail_run(shown_as.string(), "HDF5 file", "cannot be created");
    Id root(H5Gopen2(file.get(), "/", H5P_DEFAULT));
    return File(std::move(file), std::move(root), shown_as.string());
}

File File::open(const GuardedPath& guarded_path) {
    const Lock lock;
    const std::string path = guarded_path.path().string();
    Id file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, file_access().get()));
    if (!file.valid())
        detail::fail_input(path, "", fmt::format("is not a readable HDF5 file ({})", detail::last_error()));
    Id root(H5Gopen2(file.get(), "/", H5P_DEFAULT));
    if (!root.valid()) detail::fail_input(path, "", "is damaged: the root group cannot be opened");
    return File(std::move(file), std::move(root), path);
}

void File::close() {
    const Lock lock;
    if (H5Fflush(file_id_.get(), H5F_SCOPE_LOCAL) < 0) detail::fail_run(file(), "HDF5 file", "cannot be written");
    if (H5Fclose(file_id_.get()) < 0) detail::fail_run(file(), "HDF5 file", "cannot be closed");
}

}  // namespace ringlock::store
