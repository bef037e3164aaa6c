#pragma once
#include <cstring>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "engine/store/hdf5.hpp"
#include "tests/support/open_file.hpp"

/// The numbers of a result file, to be compared bit by bit.
namespace ringlock::test {

inline bool is_text(const std::string& name) {
    return name == "scenario" || name == "format" || name == "compensator" || name == "why" ||
           name.ends_with("_reason");
}

inline void collect(const store::Group& group, const std::string& path,
                    std::map<std::string, std::vector<double>>& out) {
    for (const std::string& name : group.children()) {
        if (name == "provenance") continue;
        if (group.has_group(name)) {
            collect(group.group(name), path + "/" + name, out);
        } else if (!is_text(name)) {
            out[path + "/" + name] = group.dataset(name).read<double>();
        }
    }
    for (const std::string& name : group.attribute_names()) {
        if (!is_text(name)) out[path + "@" + name] = {group.double_attribute(name)};
    }
}

/// Every dataset and attribute outside /provenance that holds numbers.
inline std::map<std::string, std::vector<double>> data(const std::filesystem::path& path) {
    std::map<std::string, std::vector<double>> out;
    collect(test::open_file(path), "", out);
    return out;
}

inline bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

}  // namespace ringlock::test
