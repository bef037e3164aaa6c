#include "analysis/record/arrays/hdf5_contents.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <set>
#include <utility>

#include "analysis/record/arrays/hdf5_handle.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/store/storage.hpp"

namespace ringlock::record {
namespace {

/// Why values of a type are no numbers; empty where they are.
std::string why_no_numbers(hid_t type) {
    switch (H5Tget_class(type)) {
        case H5T_INTEGER:
        case H5T_FLOAT:
        case H5T_ENUM:
            return "";
        case H5T_STRING:
            return "holds text; write numbers";
        case H5T_BITFIELD:
            return "holds bit fields; write them as integers";
        case H5T_REFERENCE:
            return "holds references to other datasets (of MATLAB a cell or an array of structs); "
                   "write the numbers themselves into a dataset of their own";
        case H5T_VLEN:
            return "holds rows of varying length; write one number an element";
        case H5T_ARRAY:
            return "holds an array in each element; write it as a dataset of two dimensions";
        case H5T_OPAQUE:
            return "holds bytes without a meaning; write numbers";
        default:
            return "holds no numbers";
    }
}

/// The text of an attribute of fixed length, as MATLAB writes its classes; empty without such an attribute.
std::string matlab_class(hid_t object) {
    if (H5Aexists(object, "MATLAB_class") <= 0) return "";
    const Handle attribute(H5Aopen(object, "MATLAB_class", H5P_DEFAULT), H5Aclose);
    const Handle type(H5Aget_type(attribute), H5Tclose);
    const std::size_t size = H5Tget_size(type);
    constexpr std::size_t longest = 256;
    if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) != 0 || size == 0 || size > longest) return "";
    std::string text(size, '\0');
    const Handle space(H5Aget_space(attribute), H5Sclose);
    if (H5Sget_simple_extent_npoints(space) != 1 || H5Aread(attribute, type, text.data()) < 0) return "";
    text.resize(std::min(text.find('\0'), text.size()));
    return text;
}

class Listing {
   public:
    Listing(hid_t file, std::string path) : file_(file), path_(std::move(path)) {}

    Contents of_all(const std::vector<std::string>& asked) {
        H5Ovisit2(file_, H5_INDEX_NAME, H5_ITER_INC, visit_object, this, H5O_INFO_BASIC);
        H5Lvisit(file_, H5_INDEX_NAME, H5_ITER_INC, visit_link, this);
        for (const std::string& name : asked) look_for(name);
        return std::move(found_);
    }

   private:
    struct Place {
        unsigned long file;
        haddr_t at;
        auto operator<=>(const Place&) const = default;
    };

    static herr_t visit_object(hid_t root, const char* name, const H5O_info_t* info, void* self) {
        if (info->type != H5O_TYPE_DATASET) return 0;
        return static_cast<Listing*>(self)->guarded_add(root, name, *info, false);
    }

    static herr_t visit_link(hid_t root, const char* name, const H5L_info_t* info, void* self) {
        if (info->type == H5L_TYPE_HARD) return 0;
        return static_cast<Listing*>(self)->add_link(root, name);
    }

    /// No exception may go through the library, which is written in C.
    herr_t guarded_add(hid_t root, const char* name, const H5O_info_t& info, bool by_link) noexcept {
        try {
            add(root, name, info, by_link);
        } catch (const InputError& error) {
            // The caller's message names the file and the dataset.
            const std::string what = error.what();
            const std::string head = fmt::format("{}: dataset {}: ", printable(path_), printable(shown_path(name)));
            found_.others.push_back({shown_path(name), what.starts_with(head) ? what.substr(head.size()) : what});
        } catch (const std::bad_alloc&) {
            return -1;
        }
        return 0;
    }

    herr_t add_link(hid_t root, const char* name) noexcept {
        static_cast<void>(store::refused_link());  // of an earlier call
        H5O_info_t info;
        const bool there = H5Oexists_by_name(root, name, H5P_DEFAULT) > 0 &&
                           H5Oget_info_by_name2(root, name, &info, H5O_INFO_BASIC, H5P_DEFAULT) >= 0;
        try {
            const std::string why = store::refused_link();
            if (!there && !why.empty()) {
                found_.others.push_back({shown_path(name), why + ", which is not read; name that file, "
                                                                 "or give --follow-links to a command that has it"});
            }
        } catch (const std::bad_alloc&) {
            return -1;
        }
        if (!there || info.type != H5O_TYPE_DATASET) return 0;
        return guarded_add(root, name, info, true);
    }

    static std::string shown_path(const std::string& name) {
        return name.starts_with("/") ? name : fmt::format("/{}", name);
    }

    void add(hid_t root, const std::string& name, const H5O_info_t& info, bool by_link) {
        const std::string path = shown_path(name);
        const Handle dataset(H5Dopen2(root, name.c_str(), H5P_DEFAULT), H5Dclose);
        if (!dataset.valid()) {
            found_.others.push_back({path, "cannot be opened; is the file damaged?"});
            return;
        }
        const bool is_new = seen_.insert({info.fileno, info.addr}).second;
        store::check_files(dataset, path_, path);  // before its extent is read
        Dataset whole{path, {}, path};
        whole.is_alias = by_link && !is_new;
        const Handle space(H5Dget_space(dataset), H5Sclose);
        const int dimensions = H5Sget_simple_extent_ndims(space);
        if (dimensions < 1 || dimensions > most_dimensions) {
            found_.others.push_back(
                {path, dimensions == 0 ? "is a single value; a series has many"
                                       : fmt::format("has {} dimensions; write one or two of them", dimensions)});
            return;
        }
        hsize_t sides[most_dimensions] = {};
        if (H5Sget_simple_extent_dims(space, sides, nullptr) < 0) return;
        whole.sides.assign(sides, sides + dimensions);
        const Handle type(H5Dget_type(dataset), H5Tclose);
        if (matlab_class(dataset) == "char") {
            found_.others.push_back({path, "holds text of MATLAB; write numbers"});
        } else {
            add_values(whole, type, 0);
        }
    }

    /// A dataset or field whose values have that type.
    void add_values(const Dataset& of, hid_t type, int depth) {
        constexpr int deepest = 8;
        if (H5Tget_class(type) == H5T_COMPOUND && depth < deepest) return add_fields(of, type, depth);
        if (H5Tget_class(type) == H5T_ARRAY && !of.field.empty()) return add_array(of, type);
        const std::string why = why_no_numbers(type);
        if (why.empty()) {
            found_.datasets.push_back(of);
        } else {
            found_.others.push_back({of.path, why});
        }
    }

    void add_fields(const Dataset& of, hid_t type, int depth) {
        const int fields = H5Tget_nmembers(type);
        for (int i = 0; i < fields; ++i) {
            const auto number = static_cast<unsigned>(i);
            const std::unique_ptr<char, herr_t (*)(void*)> name(H5Tget_member_name(type, number), H5free_memory);
            const Handle member(H5Tget_member_type(type, number), H5Tclose);
            if (!name || !member.valid()) continue;
            Dataset field = of;
            field.path += fmt::format("/{}", name.get());
            field.field.emplace_back(name.get());
            if (of.sides.size() == 2 && !of.is_series()) {
                found_.others.push_back({field.path,
                                         "is a field of a table of two dimensions; "
                                         "write the records as a dataset of one dimension"});
                continue;
            }
            add_values(field, member, depth + 1);
        }
    }

    void add_array(const Dataset& of, hid_t type) {
        const Handle element(H5Tget_super(type), H5Tclose);
        const std::string why = why_no_numbers(element);
        hsize_t side = 0;
        if (!why.empty() || H5Tget_array_ndims(type) != 1 || H5Tget_array_dims2(type, &side) < 0 ||
            of.sides.size() != 1) {
            found_.others.push_back({of.path, why.empty() ? "is a field of arrays of several dimensions" : why});
            return;
        }
        Dataset table = of;
        table.sides.push_back(side);
        table.field_is_array = true;
        found_.datasets.push_back(std::move(table));
    }

    /// A name that no list of links has: through a link to a group, and of a field with its name behind.
    void look_for(const std::string& asked) {
        for (std::string name : {asked, without_brackets(asked)}) {
            while (name.size() > 1 && !is_listed(name)) {
                H5O_info_t info;
                if (exists(name) &&
                    H5Oget_info_by_name2(file_, name.c_str(), &info, H5O_INFO_BASIC, H5P_DEFAULT) >= 0) {
                    if (info.type == H5O_TYPE_DATASET) guarded_add(file_, name.c_str(), info, true);
                    break;
                }
                const std::size_t slash = name.rfind('/');
                name.resize(slash == std::string::npos ? 0 : slash);
            }
        }
    }

    bool is_listed(const std::string& name) const {
        const std::string path = shown_path(name);
        return std::any_of(found_.datasets.begin(), found_.datasets.end(),
                           [&](const Dataset& d) { return d.dataset == path; });
    }

    /// Step by step, as the library requires.
    bool exists(const std::string& name) const {
        for (std::size_t end = name.find('/', 1);; end = name.find('/', end + 1)) {
            const std::string step = name.substr(0, end);
            if (H5Lexists(file_, step.c_str(), H5P_DEFAULT) <= 0) return false;
            if (H5Oexists_by_name(file_, step.c_str(), H5P_DEFAULT) <= 0) return false;
            if (end == std::string::npos) return true;
        }
    }

    hid_t file_;
    std::string path_;
    std::set<Place> seen_;
    Contents found_;
};

}  // namespace

Contents hdf5_contents(std::int64_t file, const std::string& path, const std::vector<std::string>& asked) {
    return Listing(file, path).of_all(asked);
}

std::int64_t type_of_field(const std::vector<std::string>& field, std::int64_t element, std::uint64_t count) {
    const hsize_t side = count;
    hid_t type = count > 0 ? H5Tarray_create2(element, 1, &side) : H5Tcopy(element);
    for (auto name = field.rbegin(); name != field.rend(); ++name) {
        const hid_t inner = type;
        type = H5Tcreate(H5T_COMPOUND, H5Tget_size(inner));
        H5Tinsert(type, name->c_str(), 0, inner);
        H5Tclose(inner);
    }
    return type;
}

}  // namespace ringlock::record
