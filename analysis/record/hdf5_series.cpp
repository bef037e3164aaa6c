#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "analysis/record/hdf5_choice.hpp"
#include "analysis/record/probe.hpp"
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
        // At exit the library would print that objects of a damaged file do not close.
        [[maybe_unused]] static const herr_t left_at_exit = H5dont_atexit();
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

constexpr int most_dimensions = 2;

/// Sides of a dataset of one or two dimensions; else nothing.
std::optional<std::vector<std::uint64_t>> sides_of(hid_t dataset) {
    const Handle space(H5Dget_space(dataset), H5Sclose);
    const int dimensions = H5Sget_simple_extent_ndims(space);
    if (dimensions < 1 || dimensions > most_dimensions) return std::nullopt;
    hsize_t sides[most_dimensions] = {};
    if (H5Sget_simple_extent_dims(space, sides, nullptr) < 0) return std::nullopt;
    return std::vector<std::uint64_t>(sides, sides + dimensions);
}

herr_t collect(hid_t root, const char* name, const H5O_info_t* info, void* into) {
    if (info->type != H5O_TYPE_DATASET) return 0;
    const Handle dataset(H5Dopen2(root, name, H5P_DEFAULT), H5Dclose);
    if (!dataset.valid()) return 0;
    const Handle type(H5Dget_type(dataset), H5Tclose);
    const H5T_class_t kind = H5Tget_class(type);
    const auto sides = sides_of(dataset);
    if (sides && (kind == H5T_FLOAT || kind == H5T_INTEGER)) {
        static_cast<std::vector<Dataset>*>(into)->push_back({fmt::format("/{}", name), *sides});
    }
    return 0;
}

std::vector<Dataset> datasets_in(hid_t file) {
    std::vector<Dataset> found;
    H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_INC, collect, &found, H5O_INFO_BASIC);
    return found;
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

/// rate_hz may stand at the dataset, its group or any group above.
std::optional<double> rate_above(hid_t file, const std::string& path, std::string object) {
    for (;;) {
        const std::optional<double> rate = rate_of(file, path, object);
        if (rate || object == "/") return rate;
        const std::size_t slash = object.find_last_of('/');
        object = slash == 0 ? "/" : object.substr(0, slash);
    }
}

/// Bytes of one chunk of a dataset, 0 where it has none.
std::size_t chunk_bytes(hid_t file, const std::string& name) {
    const Handle dataset(H5Dopen2(file, name.c_str(), H5P_DEFAULT), H5Dclose);
    const Handle creation(H5Dget_create_plist(dataset), H5Pclose);
    const Handle type(H5Dget_type(dataset), H5Tclose);
    hsize_t sides[most_dimensions] = {1, 1};
    if (H5Pget_layout(creation) != H5D_CHUNKED || H5Pget_chunk(creation, most_dimensions, sides) < 0) return 0;
    return static_cast<std::size_t>(sides[0] * sides[1]) * H5Tget_size(type);
}

/// Opens a dataset to be read from front to back: a chunk that is larger than a piece must stay in the cache, or it is
/// unpacked anew for every piece. The cache is set when a dataset is first opened.
hid_t open_for_pieces(hid_t file, const std::string& name) {
    constexpr std::size_t least = std::size_t{1} << 20;  // the library's own
    constexpr std::size_t most = std::size_t{1} << 30;
    const std::size_t cache = std::clamp(2 * chunk_bytes(file, name), least, most);
    const Handle access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
    H5Pset_chunk_cache(access, H5D_CHUNK_CACHE_NSLOTS_DEFAULT, cache, H5D_CHUNK_CACHE_W0_DEFAULT);
    return H5Dopen2(file, name.c_str(), access);
}

template <class T>
hid_t memory_type() {
    if constexpr (std::is_same_v<T, double>) return H5T_NATIVE_DOUBLE;
    if constexpr (std::is_same_v<T, std::int64_t>) return H5T_NATIVE_INT64;
    if constexpr (std::is_same_v<T, std::uint64_t>) return H5T_NATIVE_UINT64;
}

/// One series of a dataset, read piece by piece.
class Column {
   public:
    Column(hid_t file, const std::string& path, const Slice& slice)
        : path_(path),
          slice_(slice),
          dataset_(open_for_pieces(file, slice.path), H5Dclose),
          type_(H5Dget_type(dataset_), H5Tclose),
          space_(H5Dget_space(dataset_), H5Sclose) {
        const auto sides = dataset_.valid() ? sides_of(dataset_) : std::nullopt;
        if (!sides) throw InputError(fmt::format("{}: cannot be opened; is the file damaged?", label()));
        dimensions_ = static_cast<int>(sides->size());
        length_ = sides->at(static_cast<std::size_t>(slice.along));
        // The library copies by this size, be it damaged, and from beyond what it has unpacked.
        const std::size_t most_bytes = is_whole() ? sizeof(std::int64_t) : sizeof(long double);
        if (H5Tget_size(type_) > most_bytes) {
            throw InputError(fmt::format("{}: holds {} of {} bytes each; allowed are up to {}. Is the file damaged?",
                                         label(), is_whole() ? "integers" : "numbers", H5Tget_size(type_), most_bytes));
        }
        if (length_ == 0) throw InputError(fmt::format("{}: is empty", label()));
        // Reading it would give zeros, as many as it says. Of a virtual dataset the library does not know.
        const Handle creation(H5Dget_create_plist(dataset_), H5Pclose);
        if (H5Pget_layout(creation) != H5D_VIRTUAL && H5Dget_storage_size(dataset_) == 0) {
            throw InputError(
                fmt::format("{}: was never written, although it has room for {} values", label(), length_));
        }
    }

    hsize_t length() const { return length_; }
    bool is_whole() const { return H5Tget_class(type_) == H5T_INTEGER; }
    bool is_signed() const { return H5Tget_sign(type_) != H5T_SGN_NONE; }

    std::string label() const { return fmt::format("{}: dataset {}", path_, slice_.name()); }
    std::string place(std::size_t element) const {
        return fmt::format("{}, element {} (counted from 0)", label(), element);
    }

    /// Elements from `first` on, as many as there is room for.
    template <class T>
    void read(hsize_t first, std::span<T> into) const {
        hsize_t start[most_dimensions] = {0, 0};
        hsize_t count[most_dimensions] = {1, 1};
        start[1 - slice_.along] = slice_.at;
        start[slice_.along] = first;
        count[slice_.along] = into.size();
        const Handle memory(H5Screate_simple(dimensions_, count, nullptr), H5Sclose);
        if (H5Sselect_hyperslab(space_, H5S_SELECT_SET, start, nullptr, count, nullptr) < 0 ||
            H5Dread(dataset_, memory_type<T>(), memory, space_, H5P_DEFAULT, into.data()) < 0) {
            throw InputError(
                fmt::format("{}: elements {} to {} cannot be read as numbers; is the file damaged, or "
                            "packed by a filter that is not installed?",
                            label(), first, first + into.size() - 1));
        }
    }

   private:
    std::string path_;
    Slice slice_;
    Handle dataset_;
    Handle type_;
    Handle space_;
    int dimensions_ = 0;
    hsize_t length_ = 0;
};

void hand_on(double value, const Column& column, std::size_t element, SeriesRows& rows) {
    if (std::isnan(value)) {
        rows.missing();
    } else if (std::isfinite(value)) {
        rows.value(value);
    } else {
        throw InputError(fmt::format("{} is {}; every value must be finite; where it is not known, write NaN",
                                     column.place(element), value));
    }
}

void hand_on(std::int64_t value, const Column&, std::size_t, SeriesRows& rows) { rows.count(value); }

void hand_on(std::uint64_t value, const Column& column, std::size_t element, SeriesRows& rows) {
    constexpr std::int64_t largest = std::numeric_limits<std::int64_t>::max();
    if (value > static_cast<std::uint64_t>(largest)) {
        throw InputError(
            fmt::format("{} is {}; allowed are counts up to {}. Subtract a constant; where it was a "
                        "negative number, write signed integers",
                        column.place(element), value, largest));
    }
    rows.count(static_cast<std::int64_t>(value));
}

template <class T>
void read_rows(const Column& column, const Column* time, SeriesRows& rows) {
    std::vector<T> values(SeriesRows::longest);
    std::vector<double> times_s(time != nullptr ? SeriesRows::longest : 0);
    for (hsize_t first = 0; first < column.length(); first += SeriesRows::longest) {
        const auto count = static_cast<std::size_t>(std::min<hsize_t>(SeriesRows::longest, column.length() - first));
        column.read(first, std::span<T>(values.data(), count));
        if (time != nullptr) time->read(first, std::span<double>(times_s.data(), count));
        for (std::size_t i = 0; i < count; ++i) {
            if (time != nullptr) rows.time(times_s[i], first + i);
            hand_on(values[i], column, first + i, rows);
        }
    }
}

void read_rows(const Column& column, const Column* time, SeriesRows& rows) {
    if (!column.is_whole()) return read_rows<double>(column, time, rows);
    if (column.is_signed()) return read_rows<std::int64_t>(column, time, rows);
    return read_rows<std::uint64_t>(column, time, rows);
}

SeriesInfo stream_file(const SeriesRequest& request, const TakePiece& take) {
    const QuietErrors quiet;
    const std::string& path = request.path;
    const Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
    if (!file.valid())
        throw InputError(fmt::format("{}: is not a readable HDF5 file (damaged, or open for writing)", path));
    const Choice choice = choose_datasets(request, datasets_in(file));
    const Column column(file, path, choice.column);
    std::optional<Column> time;
    SeriesRows rows(take);
    if (choice.time) {
        time.emplace(file, path, *choice.time);
        if (time->length() != column.length()) {
            throw InputError(fmt::format("{} has {} elements, {} has {}; must be as many times as values",
                                         time->label(), time->length(), choice.column.name(), column.length()));
        }
        rows.set_grid(TimeGrid(request.rate_hz, [&time](std::size_t element) { return time->place(element); }));
    }
    const std::optional<double> rate_hz = rate_above(file, path, choice.column.path);
    read_rows(column, time ? &*time : nullptr, rows);
    SeriesInfo info = rows.finish();
    info.column = choice.column.name();
    info.rate_hz = rate_hz;
    return info;
}

}  // namespace

SeriesInfo stream_hdf5_series(const SeriesRequest& request, const TakePiece& take) {
    try_reading(request.path, [&] { stream_file(request, [](const SeriesPiece&) {}); });
    return stream_file(request, take);
}

}  // namespace ringlock::record
