#include "analysis/export/matlab.hpp"

#include <fmt/format.h>
#include <matio.h>

#include <algorithm>
#include <cctype>
#include <concepts>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <set>

#include "analysis/export/unicode.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/version.hpp"

namespace ringlock::exports {
namespace {

struct FreesVariable {
    void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};
using Variable = std::unique_ptr<matvar_t, FreesVariable>;

Variable made(matvar_t* variable) {
    if (variable == nullptr) throw std::bad_alloc();
    return Variable(variable);
}

template <class T>
constexpr std::pair<matio_classes, matio_types> matlab_type() {
    if constexpr (std::same_as<T, double>) return {MAT_C_DOUBLE, MAT_T_DOUBLE};
    if constexpr (std::same_as<T, std::int64_t>) return {MAT_C_INT64, MAT_T_INT64};
    if constexpr (std::same_as<T, std::uint64_t>) return {MAT_C_UINT64, MAT_T_UINT64};
    if constexpr (std::same_as<T, std::int8_t>) return {MAT_C_INT8, MAT_T_INT8};
}

Variable text_variable(const std::string& text) {
    std::vector<std::uint16_t> units = utf16_units(text);
    std::size_t sides[2] = {units.empty() ? std::size_t{0} : std::size_t{1}, units.size()};
    return made(Mat_VarCreate(nullptr, MAT_C_CHAR, MAT_T_UINT16, 2, sides, units.data(), 0));
}

/// Rows one after the other, as HDF5 has them, become columns one after the other.
template <class T>
Variable array_variable(const std::vector<T>& values, std::size_t rows, std::size_t columns) {
    if constexpr (std::same_as<T, std::string>) {
        if (values.size() == 1) return text_variable(values.front());
        std::size_t sides[2] = {values.size(), 1};
        Variable cells = made(Mat_VarCreate(nullptr, MAT_C_CELL, MAT_T_CELL, 2, sides, nullptr, 0));
        for (std::size_t i = 0; i < values.size(); ++i) {
            Mat_VarSetCell(cells.get(), static_cast<int>(i), text_variable(values[i]).release());
        }
        return cells;
    } else {
        std::size_t sides[2] = {rows, columns};
        const auto [array_class, type] = matlab_type<T>();
        if (columns <= 1)
            return made(Mat_VarCreate(nullptr, array_class, type, 2, sides, const_cast<T*>(values.data()), 0));
        std::vector<T> turned(values.size());
        for (std::size_t r = 0; r < rows; ++r) {
            for (std::size_t c = 0; c < columns; ++c) turned[c * rows + r] = values[r * columns + c];
        }
        return made(Mat_VarCreate(nullptr, array_class, type, 2, sides, turned.data(), 0));
    }
}

Variable attribute_variable(const store::AttributeValue& value) {
    return std::visit(
        []<class T>(const T& v) {
            if constexpr (std::same_as<T, std::vector<double>>) {
                return array_variable(v, v.size(), 1);
            } else {
                return array_variable(std::vector<T>{v}, 1, 1);
            }
        },
        value);
}

/// A name as MATLAB allows it, at most 63 letters, digits and underscores that begin with a letter, different from
/// those that are taken.
std::string matlab_name(const std::string& name, const std::set<std::string>& taken) {
    constexpr std::size_t longest = 60;
    std::string out;
    for (const char c : name) out += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
    if (out.empty() || std::isalpha(static_cast<unsigned char>(out[0])) == 0) out = "x" + out;
    out.resize(std::min(out.size(), longest));
    std::string unique = out;
    for (int i = 2; taken.contains(unique); ++i) unique = fmt::format("{}_{}", out, i);
    return unique;
}

/// Fields in the order of the file.
struct Fields {
    std::vector<std::string> names;
    std::vector<Variable> values;
    std::set<std::string> taken;

    void add(const std::string& name, Variable value) {
        names.push_back(matlab_name(name, taken));
        taken.insert(names.back());
        values.push_back(std::move(value));
    }
    Variable as_struct() {
        std::vector<const char*> pointers;
        for (const std::string& name : names) pointers.push_back(name.c_str());
        std::size_t sides[2] = {1, 1};
        Variable out =
            made(Mat_VarCreateStruct(nullptr, 2, sides, pointers.data(), static_cast<unsigned>(names.size())));
        for (std::size_t i = 0; i < values.size(); ++i) {
            Mat_VarSetStructFieldByIndex(out.get(), i, 0, values[i].release());
        }
        return out;
    }
};

/// The variable that a group or dataset becomes: its value, its unit and its description.
struct Converted {
    Variable value, unit, description;
};

class MatlabTree {
   public:
    MatlabTree(const store::File& file, const std::vector<store::ListedObject>& objects)
        : file_(file), objects_(objects) {}

    /// Fields of the root: its attributes and members, then the labels.
    Fields root() {
        Fields values;
        Fields units;
        Fields descriptions;
        std::size_t next = 0;
        add_members(next, values, units, descriptions);
        values.add("unit", units.as_struct());
        values.add("description", descriptions.as_struct());
        return values;
    }

   private:
    void add_members(std::size_t& number, Fields& values, Fields& units, Fields& descriptions) {
        const store::ListedObject& group = objects_[number++];
        const std::string inside = group.path == "/" ? "/" : group.path + "/";
        // Members keep their names; an attribute that is called as one of them gets another.
        std::set<std::string> members;
        for (std::size_t i = number; i < objects_.size() && objects_[i].path.starts_with(inside); ++i) {
            if (objects_[i].path.find('/', inside.size()) == std::string::npos) members.insert(objects_[i].name());
        }
        for (const store::ListedAttribute& attribute : group.attributes) {
            values.add(members.contains(attribute.name) ? attribute.name + "_attribute" : attribute.name,
                       attribute_variable(attribute.value));
        }
        while (number < objects_.size() && objects_[number].path.starts_with(inside)) {
            const std::string name = objects_[number].name();
            Converted member = converted(number);
            values.add(name, std::move(member.value));
            units.add(name, std::move(member.unit));
            descriptions.add(name, std::move(member.description));
        }
    }

    Converted converted(std::size_t& number) {
        const store::ListedObject& object = objects_[number];
        if (object.is_dataset) {
            ++number;
            check_interrupt();
            Variable value =
                std::visit([&](const auto& v) { return array_variable(v, object.rows(), object.columns()); },
                           store::read_values(file_, object));
            return {std::move(value), text_variable(object.unit), text_variable(object.description)};
        }
        Fields values;
        Fields units;
        Fields descriptions;
        add_members(number, values, units, descriptions);
        return {values.as_struct(), units.as_struct(), descriptions.as_struct()};
    }

    const store::File& file_;
    const std::vector<store::ListedObject>& objects_;
};

/// Text of the last variable.
std::string writer() { return fmt::format("ringlock {} ({})", version(), git_hash()); }

/// matio does not say whether the disk took what it wrote, so the file is looked at: the last variable is a text that
/// ends it.
bool is_complete(const std::string& path, std::uint64_t least_bytes) {
    std::ifstream in(path, std::ios::binary | std::ios::ate);
    const auto size = static_cast<std::uint64_t>(in.tellg());
    constexpr std::uint64_t tail = 256;
    if (!in || size < least_bytes + tail) return false;
    in.seekg(-static_cast<std::streamoff>(tail), std::ios::end);
    std::string text(tail, '\0');
    in.read(text.data(), static_cast<std::streamsize>(tail));
    std::erase(text, '\0');  // of units of 16 bits
    return in && text.find(writer()) != std::string::npos;
}

std::uint64_t bytes_of_element(const store::ListedObject& dataset) {
    return dataset.kind == store::ElementKind::small_integer ? 1 : 8;
}

}  // namespace

void check_matlab_size(const std::vector<store::ListedObject>& objects) {
    std::map<std::string, double> bytes;
    for (const store::ListedObject& object : objects) {
        if (!object.is_dataset) continue;
        const std::string top = object.path.substr(0, object.path.find('/', 1));
        bytes[top] += static_cast<double>(object.size()) * static_cast<double>(bytes_of_element(object));
    }
    constexpr double most = 2147483647.0 - 16e6;  // 2^31 - 1, and room for names and short texts
    for (const auto& [top, size] : bytes) {
        if (size <= most) continue;
        throw InputError(
            fmt::format("--matlab: {} takes {:.1f} GB, and a variable of a MAT-file has at most 2 GB. Choose a part "
                        "with --only, as in --only arms/ideal, or use --npz",
                        printable(top), size / 1e9));
    }
}

void write_matlab(const store::File& file, const std::vector<store::ListedObject>& objects, const std::string& path,
                  const std::string& shown_as) {
    check_matlab_size(objects);
    std::uint64_t least_bytes = 0;
    for (const store::ListedObject& object : objects) {
        if (object.is_dataset && object.kind != store::ElementKind::text) {
            least_bytes += object.size() * bytes_of_element(object);
        }
    }
    const auto fail = [&]() {
        throw RunError(fmt::format("{}: cannot be written; is the disk full?", printable(shown_as)));
    };
    Fields variables = MatlabTree(file, objects).root();
    variables.add("written_by", text_variable(writer()));
    std::unique_ptr<mat_t, int (*)(mat_t*)> mat(
        Mat_CreateVer(path.c_str(), "MATLAB 5.0 MAT-file, written by ringlock export", MAT_FT_MAT5), Mat_Close);
    if (!mat) fail();
    bool written = true;
    for (std::size_t i = 0; i < variables.values.size(); ++i) {
        matvar_t* const variable = variables.values[i].get();
        variable->name = strdup(variables.names[i].c_str());
        check_interrupt();
        if (Mat_VarWrite(mat.get(), variable, MAT_COMPRESSION_NONE) != 0) written = false;
        variables.values[i].reset();
    }
    mat.reset();
    if (!written || !is_complete(path, least_bytes)) fail();
}

}  // namespace ringlock::exports
