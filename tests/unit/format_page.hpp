#pragma once
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

/// What an HDF5 file holds against the page that describes it.
namespace ringlock::test {

/// What the page says, or the file shows, of one dataset or attribute.
struct Entry {
    std::string type;
    std::string shape;
    std::string unit;
    bool operator==(const Entry&) const = default;
    friend std::ostream& operator<<(std::ostream& out, const Entry& e) {
        return out << e.type << " [" << e.shape << "] '" << e.unit << "'";
    }
};
/// Datasets by their path; attributes as "OBJECT @NAME"; groups as "OBJECT @".
using Entries = std::map<std::string, Entry>;

inline std::vector<std::string> cells(const std::string& line) {
    std::vector<std::string> out;
    std::istringstream in(line.substr(1));
    for (std::string cell; std::getline(in, cell, '|');) {
        cell.erase(std::remove(cell.begin(), cell.end(), '`'), cell.end());
        cell.erase(0, cell.find_first_not_of(' '));
        cell.erase(cell.find_last_not_of(' ') + 1);
        out.push_back(cell);
    }
    return out;
}

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
    if (const auto at = text.find(from); at != std::string::npos) text.replace(at, from.size(), to);
    return text;
}

/// Unit that a name ends in.
inline std::string unit_of_name(const std::string& name) {
    static const std::vector<std::pair<std::string, std::string>> units = {{"_per_s", "1/s"},
                                                                           {"arcsec", "arcsec"},
                                                                           {"_hz", "Hz"},
                                                                           {"deg_s", "deg/s"},
                                                                           {"deg_h_rt_h", "deg/h/sqrt(h)"},
                                                                           {"deg_rt_h", "deg/sqrt(h)"},
                                                                           {"deg_h", "deg/h"},
                                                                           {"_rad", "rad"},
                                                                           {"_s", "s"}};
    for (const auto& [part, unit] : units) {
        if (name.find(part + "_") != std::string::npos || name.ends_with(part)) return unit;
    }
    return "1";
}

/// Tables of the page; rows that name ARM count once for each arm.
///
/// \param title  of the part of the page that counts; empty: all of it
inline Entries page(const std::filesystem::path& path, const std::vector<std::string>& arms,
                    const std::string& title = "") {
    std::ifstream in(path);
    EXPECT_TRUE(in) << path;
    Entries out;
    std::string header;
    const auto add = [&](const std::string& name, const Entry& entry) {
        EXPECT_TRUE(out.emplace(name, entry).second) << "stands twice: " << name;
    };
    bool counts = title.empty();
    for (std::string line; std::getline(in, line);) {
        if (!title.empty() && line.starts_with("# ")) counts = line == "# " + title;
        if (!counts) continue;
        if (!line.starts_with('|')) {
            header.clear();
            continue;
        }
        const auto row = cells(line);
        if (header.empty()) {
            header = row[0];
            continue;
        }
        if (row[0].starts_with("---") || !row[0].starts_with('/')) continue;
        EXPECT_EQ(row.size(), 5U) << line;
        EXPECT_FALSE(row.back().empty()) << "no meaning: " << line;
        for (const std::string& arm : row[0].find("/ARM") == std::string::npos ? std::vector<std::string>{""} : arms) {
            const std::string object = replaced(row[0], "ARM", arm);
            if (header == "dataset") {
                add(object, {row[1], row[2], row[3]});
            } else if (row[1].empty()) {
                add(object + " @", {});
            } else {
                EXPECT_EQ(row[3], row[2] == "string" ? "-" : unit_of_name(row[1])) << line;
                add(object + " @" + row[1], {row[2], "", ""});
            }
        }
    }
    return out;
}

inline std::string type_name(hid_t type) {
    const std::size_t size = H5Tget_size(type);
    switch (H5Tget_class(type)) {
        case H5T_STRING:
            return H5Tis_variable_str(type) > 0 && H5Tget_cset(type) == H5T_CSET_UTF8 ? "string" : "other string";
        case H5T_FLOAT:
            return H5Tequal(type, H5T_IEEE_F64LE) > 0 ? "f64" : "other float";
        case H5T_INTEGER:
            if (H5Tget_order(type) == H5T_ORDER_BE) return "big-endian";
            return std::string(H5Tget_sign(type) == H5T_SGN_NONE ? "u" : "i") + std::to_string(8 * size);
        default:
            return "other";
    }
}

struct Walk {
    hid_t file;
    std::map<hsize_t, std::string> extents;
    Entries found;
};

inline std::string text_attribute(hid_t object, const char* name) {
    if (H5Aexists(object, name) <= 0) return "(none)";
    const hid_t attribute = H5Aopen(object, name, H5P_DEFAULT);
    const hid_t type = H5Aget_type(attribute);
    char* value = nullptr;
    H5Aread(attribute, type, &value);
    std::string text = value;
    H5free_memory(value);
    H5Tclose(type);
    H5Aclose(attribute);
    return text;
}

inline std::vector<std::string> attribute_names(hid_t object) {
    std::vector<std::string> names;
    H5Aiterate2(
        object, H5_INDEX_NAME, H5_ITER_INC, nullptr,
        [](hid_t, const char* name, const H5A_info_t*, void* out) -> herr_t {
            static_cast<std::vector<std::string>*>(out)->emplace_back(name);
            return 0;
        },
        &names);
    return names;
}

inline void note_dataset(Walk& walk, const std::string& path, hid_t dataset) {
    const hid_t type = H5Dget_type(dataset);
    const hid_t space = H5Dget_space(dataset);
    std::vector<hsize_t> extent(static_cast<std::size_t>(H5Sget_simple_extent_ndims(space)));
    H5Sget_simple_extent_dims(space, extent.data(), nullptr);
    std::string shape;
    for (const hsize_t n : extent) {
        const auto name = walk.extents.find(n);
        shape += (shape.empty() ? "" : " x ") + (name == walk.extents.end() ? std::to_string(n) : name->second);
    }
    walk.found[path] = {type_name(type), shape, text_attribute(dataset, "unit")};
    EXPECT_THAT(attribute_names(dataset), testing::ElementsAre("description", "unit")) << path;
    EXPECT_NE(text_attribute(dataset, "description"), "") << path;
    H5Sclose(space);
    H5Tclose(type);
}

inline void note_group(Walk& walk, const std::string& path, hid_t group) {
    const auto names = attribute_names(group);
    if (names.empty()) walk.found[path + " @"] = {};
    for (const std::string& name : names) {
        const hid_t attribute = H5Aopen(group, name.c_str(), H5P_DEFAULT);
        const hid_t type = H5Aget_type(attribute);
        const hid_t space = H5Aget_space(attribute);
        EXPECT_EQ(H5Sget_simple_extent_type(space), H5S_SCALAR) << path << " " << name;
        walk.found[path + " @" + name] = {type_name(type), "", ""};
        H5Sclose(space);
        H5Tclose(type);
        H5Aclose(attribute);
    }
}

inline void note(Walk& walk, const std::string& path) {
    const hid_t object = H5Oopen(walk.file, path.c_str(), H5P_DEFAULT);
    ASSERT_GE(object, 0) << path;
    if (H5Iget_type(object) == H5I_DATASET) {
        note_dataset(walk, path, object);
    } else {
        EXPECT_EQ(H5Iget_type(object), H5I_GROUP) << path;
        note_group(walk, path, object);
    }
    H5Oclose(object);
}

/// What the file holds; `extents` are the names of its lengths.
inline Entries walk(const std::filesystem::path& path, const std::map<hsize_t, std::string>& extents) {
    Walk state{H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), extents, {}};
    EXPECT_GE(state.file, 0);
    note(state, "/");
    H5Lvisit(
        state.file, H5_INDEX_NAME, H5_ITER_INC,
        [](hid_t, const char* name, const H5L_info_t* info, void* out) -> herr_t {
            EXPECT_EQ(info->type, H5L_TYPE_HARD) << name;
            note(*static_cast<Walk*>(out), std::string("/") + name);
            return 0;
        },
        &state);
    H5Fclose(state.file);
    return state.found;
}

inline void compare(const Entries& page, const Entries& file) {
    for (const auto& [name, entry] : page) {
        const auto found = file.find(name);
        if (found == file.end()) {
            ADD_FAILURE() << "on the page, not in the file: " << name;
        } else {
            EXPECT_EQ(entry, found->second) << name << ": page against file";
        }
    }
    for (const auto& [name, entry] : file) {
        EXPECT_TRUE(page.contains(name)) << "in the file, not on the page: " << name << " " << entry;
    }
}

}  // namespace ringlock::test
