#include <fmt/format.h>
#include <hdf5.h>

#include <cmath>

#include "analysis/record/readers.hpp"
#include "engine/core/error.hpp"

namespace ringlock::record {
namespace {

/// Owns one HDF5 identifier.
class Handle {
   public:
    Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
    Handle(const Handle&) = delete;
    Handle& operator=(const Handle&) = delete;
    ~Handle() {
        if (id_ >= 0) close_(id_);
    }
    operator hid_t() const { return id_; }
    bool valid() const { return id_ >= 0; }

   private:
    hid_t id_;
    herr_t (*close_)(hid_t);
};

/// Keeps the library from printing its error stack; ours says what a user can act on.
class QuietErrors {
   public:
    QuietErrors() {
        H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
        H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    }
    QuietErrors(const QuietErrors&) = delete;
    QuietErrors& operator=(const QuietErrors&) = delete;
    ~QuietErrors() { H5Eset_auto2(H5E_DEFAULT, function_, data_); }

   private:
    H5E_auto2_t function_ = nullptr;
    void* data_ = nullptr;
};

herr_t collect(hid_t root, const char* name, const H5O_info_t* info, void* into) {
    if (info->type != H5O_TYPE_DATASET) return 0;
    const Handle dataset(H5Dopen2(root, name, H5P_DEFAULT), H5Dclose);
    const Handle space(H5Dget_space(dataset), H5Sclose);
    const Handle type(H5Dget_type(dataset), H5Tclose);
    const H5T_class_t kind = H5Tget_class(type);
    if (H5Sget_simple_extent_ndims(space) == 1 && (kind == H5T_FLOAT || kind == H5T_INTEGER)) {
        static_cast<std::vector<std::string>*>(into)->push_back(fmt::format("/{}", name));
    }
    return 0;
}

std::vector<std::string> series_in(hid_t file) {
    std::vector<std::string> names;
    H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_INC, collect, &names, H5O_INFO_BASIC);
    return names;
}

/// The dataset asked for: by path, or by the last part of its path where only one ends so.
std::string choose(const std::string& path, const std::vector<std::string>& there,
                   const std::optional<std::string>& asked) {
    if (there.empty()) throw InputError(fmt::format("{}: holds no one-dimensional dataset of numbers", path));
    if (!asked) {
        if (there.size() == 1) return there.front();
        throw InputError(
            fmt::format("{}: has {} datasets; say which with --column ({})", path, there.size(), listed(there)));
    }
    const std::string absolute = asked->starts_with("/") ? *asked : fmt::format("/{}", *asked);
    std::vector<std::string> matches;
    for (const std::string& name : there) {
        if (name == absolute) return name;
        if (name.ends_with(absolute)) matches.push_back(name);
    }
    if (matches.size() == 1) return matches.front();
    if (matches.size() > 1) {
        throw InputError(
            fmt::format("{}: '{}' is the name of several datasets; say which: {}", path, *asked, listed(matches)));
    }
    throw InputError(
        fmt::format("{}: has no one-dimensional dataset of numbers '{}'; there are {}", path, *asked, listed(there)));
}

std::optional<double> rate_of(hid_t file, const std::string& path, const std::string& object) {
    if (H5Aexists_by_name(file, object.c_str(), "rate_hz", H5P_DEFAULT) <= 0) return std::nullopt;
    const Handle attribute(H5Aopen_by_name(file, object.c_str(), "rate_hz", H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    const Handle space(H5Aget_space(attribute), H5Sclose);
    double rate = 0.0;
    if (!attribute.valid() || H5Sget_simple_extent_npoints(space) != 1 ||
        H5Aread(attribute, H5T_NATIVE_DOUBLE, &rate) < 0) {
        throw InputError(fmt::format("{}: attribute rate_hz of {} is not a number", path, object));
    }
    if (!(rate > 0.0) || !std::isfinite(rate)) {
        throw InputError(
            fmt::format("{}: attribute rate_hz of {} is {}: must be a positive number", path, object, rate));
    }
    return rate;
}

}  // namespace

Series read_hdf5_series(const std::string& path, const std::optional<std::string>& column) {
    const QuietErrors quiet;
    const Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
    if (!file.valid())
        throw InputError(fmt::format("{}: is not a readable HDF5 file (damaged, or open for writing)", path));
    Series out;
    out.column = choose(path, series_in(file), column);

    const Handle dataset(H5Dopen2(file, out.column.c_str(), H5P_DEFAULT), H5Dclose);
    const Handle space(H5Dget_space(dataset), H5Sclose);
    const hssize_t length = H5Sget_simple_extent_npoints(space);
    if (length <= 0) throw InputError(fmt::format("{}: dataset {} is empty", path, out.column));
    out.values.resize(static_cast<std::size_t>(length));
    if (H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, out.values.data()) < 0) {
        throw InputError(fmt::format("{}: dataset {} cannot be read as numbers", path, out.column));
    }
    for (std::size_t i = 0; i < out.values.size(); ++i) {
        if (!std::isfinite(out.values[i])) {
            throw InputError(
                fmt::format("{}: dataset {}, element {} (counted from 0) is {}; every value must be finite, for gaps "
                            "are not handled yet",
                            path, out.column, i, out.values[i]));
        }
    }
    // rate_hz may stand at the dataset, its group or any group above.
    std::string object = out.column;
    for (;;) {
        out.rate_hz = rate_of(file, path, object);
        if (out.rate_hz || object == "/") break;
        const std::size_t slash = object.find_last_of('/');
        object = slash == 0 ? "/" : object.substr(0, slash);
    }
    return out;
}

}  // namespace ringlock::record
