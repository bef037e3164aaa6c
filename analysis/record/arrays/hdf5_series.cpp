#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <type_traits>
#include <vector>

#include "analysis/record/arrays/array_choice.hpp"
#include "analysis/record/arrays/array_column.hpp"
#include "analysis/record/arrays/hdf5_contents.hpp"
#include "analysis/record/arrays/hdf5_handle.hpp"
#include "analysis/record/readers.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/store/hdf5.hpp"
#include "engine/store/storage.hpp"

namespace ringlock::record {
namespace {

std::optional<double> rate_of(hid_t file, const std::string& path, const std::string& object) {
    if (H5Aexists_by_name(file, object.c_str(), "rate_hz", H5P_DEFAULT) <= 0) return std::nullopt;
    const Handle attribute(H5Aopen_by_name(file, object.c_str(), "rate_hz", H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    const Handle space(H5Aget_space(attribute), H5Sclose);
    double rate = 0.0;
    if (!attribute.valid() || H5Sget_simple_extent_npoints(space) != 1 ||
        H5Aread(attribute, H5T_NATIVE_DOUBLE, &rate) < 0) {
        throw InputError(
            fmt::format("{}: attribute rate_hz of {} is not a number", printable(path), printable(object)));
    }
    if (!(rate > 0.0) || !std::isfinite(rate)) {
        throw InputError(fmt::format("{}: attribute rate_hz of {} is {}: must be a positive number", printable(path),
                                     printable(object), rate));
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

/// Bytes of one chunk of a dataset, 0 for a dataset without chunks.
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
hid_t memory_number() {
    if constexpr (std::is_same_v<T, double>) return H5T_NATIVE_DOUBLE;
    if constexpr (std::is_same_v<T, std::int64_t>) return H5T_NATIVE_INT64;
    if constexpr (std::is_same_v<T, std::uint64_t>) return H5T_NATIVE_UINT64;
}

/// One series of a dataset or of a field of its records, read piece by piece.
class Hdf5Column final : public ArrayColumn {
   public:
    Hdf5Column(hid_t file, const std::string& path, const Slice& slice)
        : path_(path),
          slice_(slice),
          dataset_(open_for_pieces(file, slice.of.dataset), H5Dclose),
          type_(dataset_.valid() ? type_of_values(dataset_, slice.of) : H5I_INVALID_HID, H5Tclose),
          space_(dataset_.valid() ? H5Dget_space(dataset_) : H5I_INVALID_HID, H5Sclose) {
        if (!type_.valid() || !space_.valid()) {
            throw InputError(fmt::format("{}: cannot be opened; is the file damaged?", label()));
        }
        const store::Storage storage = store::check_storage(dataset_, path, slice.of.dataset);
        is_plain_ = storage.is_plain && slice.of.field.empty();
        dimensions_ = H5Sget_simple_extent_ndims(space_);
        hsize_t sides[most_dimensions] = {};
        if (dimensions_ < 1 || dimensions_ > most_dimensions || H5Sget_simple_extent_dims(space_, sides, nullptr) < 0) {
            throw InputError(fmt::format("{}: cannot be read; is the file damaged?", label()));
        }
        along_ = slice.of.field_is_array ? 0 : slice.along;
        length_ = sides[along_];
        if (!storage.is_written) {
            throw InputError(
                fmt::format("{}: was never written, although it has room for {} values", label(), length_));
        }
        const std::size_t most_bytes = kind() == Kind::real ? sizeof(long double) : sizeof(std::int64_t);
        if (H5Tget_size(type_) > most_bytes) {
            throw InputError(fmt::format("{}: holds {} of {} bytes each; allowed are up to {}. Is the file damaged?",
                                         label(), kind() == Kind::real ? "numbers" : "integers", H5Tget_size(type_),
                                         most_bytes));
        }
    }

    std::uint64_t length() const override { return length_; }
    Kind kind() const override {
        if (H5Tget_class(type_) == H5T_FLOAT) return Kind::real;
        return H5Tget_sign(type_) == H5T_SGN_NONE ? Kind::whole_unsigned : Kind::whole;
    }
    std::string name() const override { return slice_.name(); }
    std::string label() const override {
        return fmt::format("{}: dataset {}", printable(path_), printable(slice_.name()));
    }
    void read(std::uint64_t first, std::span<double> into) override { read_numbers(first, into); }
    void read(std::uint64_t first, std::span<std::int64_t> into) override { read_numbers(first, into); }
    void read(std::uint64_t first, std::span<std::uint64_t> into) override { read_numbers(first, into); }

   private:
    /// Type of the numbers: that of an enumeration is its integer, that of an array its element.
    static hid_t type_of_values(hid_t dataset, const Dataset& of) {
        hid_t type = H5Dget_type(dataset);
        const auto step = [&](hid_t next) {
            H5Tclose(type);
            type = next;
        };
        for (const std::string& name : of.field) {
            const int member = H5Tget_class(type) == H5T_COMPOUND ? H5Tget_member_index(type, name.c_str()) : -1;
            step(member < 0 ? H5I_INVALID_HID : H5Tget_member_type(type, static_cast<unsigned>(member)));
            if (type < 0) return type;
        }
        if (H5Tget_class(type) == H5T_ARRAY) step(H5Tget_super(type));
        if (H5Tget_class(type) == H5T_ENUM) step(H5Tget_super(type));
        return type;
    }

    template <class T>
    void read_numbers(std::uint64_t first, std::span<T> into) {
        constexpr std::uint64_t small = std::uint64_t{1} << 17;
        if (is_plain_ && length_ > small && store::is_trial()) {
            store::note_left_out();
            std::fill(into.begin(), into.end(), T{});
            return;
        }
        if (slice_.of.field_is_array) return read_of_arrays(first, into);
        const Handle memory_type(type_of_field(slice_.of.field, memory_number<T>(), 0), H5Tclose);
        read_block(first, into.size(), memory_type, into.data());
    }

    /// The records hold whole rows, of which one number each is wanted.
    template <class T>
    void read_of_arrays(std::uint64_t first, std::span<T> into) {
        const auto side = static_cast<std::size_t>(slice_.of.sides[1]);
        constexpr std::size_t at_once = std::size_t{1} << 20;
        const std::size_t rows = std::max<std::size_t>(1, at_once / side);
        const Handle memory_type(type_of_field(slice_.of.field, memory_number<T>(), side), H5Tclose);
        std::vector<T> block(std::min(rows, into.size()) * side);
        for (std::size_t done = 0; done < into.size(); done += rows) {
            const std::size_t now = std::min(rows, into.size() - done);
            read_block(first + done, now, memory_type, block.data());
            for (std::size_t i = 0; i < now; ++i) into[done + i] = block[i * side + slice_.at];
        }
    }

    void read_block(std::uint64_t first, std::size_t size, hid_t memory_type, void* into) const {
        hsize_t start[most_dimensions] = {0, 0};
        hsize_t count[most_dimensions] = {1, 1};
        if (dimensions_ == most_dimensions) start[1 - along_] = slice_.at;
        start[along_] = first;
        count[along_] = size;
        static_cast<void>(store::refused_link());  // of an earlier call
        const Handle memory(H5Screate_simple(dimensions_, count, nullptr), H5Sclose);
        if (H5Sselect_hyperslab(space_, H5S_SELECT_SET, start, nullptr, count, nullptr) < 0 ||
            H5Dread(dataset_, memory_type, memory, space_, H5P_DEFAULT, into) < 0) {
            throw InputError(
                fmt::format("{}: elements {} to {} cannot be read as numbers; "
                            "is the file damaged, or packed by a filter that is not installed?",
                            label(), first, first + size - 1));
        }
        // Of a virtual dataset the library reads zeros where it does not find the source.
        if (const std::string why = store::refused_link(); !why.empty()) {
            throw InputError(
                fmt::format("{}: elements {} to {}: {}, which is not read", label(), first, first + size - 1, why));
        }
    }

    std::string path_;
    Slice slice_;
    Handle dataset_;
    Handle type_;
    Handle space_;
    bool is_plain_ = false;
    int dimensions_ = 0;
    int along_ = 0;
    hsize_t length_ = 0;
};

/// In its own words: the attribute unit or units.
std::optional<std::string> unit_of(const store::File& file, const Dataset& of) {
    if (!of.field.empty()) return std::nullopt;
    const store::Dataset dataset = file.dataset(of.dataset);
    for (const char* name : {"unit", "units"}) {
        if (!dataset.has_attribute(name)) continue;
        try {
            return std::string(text::trimmed(dataset.string_attribute(name)));
        } catch (const InputError&) {
            continue;  // no text: not a unit
        }
    }
    return std::nullopt;
}

SeriesInfo stream_hdf5_file(const store::GuardedPath& guarded, const SeriesRequest& request, const TakePiece& take) {
    const store::File opened = store::File::open(guarded);
    const hid_t file = opened.library_id();
    const std::string& path = request.path;
    std::vector<std::string> asked;
    if (request.column) asked.push_back(*request.column);
    if (request.time) {
        for (const std::string& name : names_of_times(*request.time)) asked.push_back(name);
    }
    const Choice choice = choose_datasets(request, hdf5_contents(file, path, asked));
    const std::optional<double> rate_hz = rate_above(file, path, choice.column.of.dataset);
    const std::optional<std::string> unit = unit_of(opened, choice.column.of);
    SeriesInfo info = stream_choice(
        request, choice, [&](const Slice& slice) { return std::make_unique<Hdf5Column>(file, path, slice); }, take);
    info.rate_hz = rate_hz;
    info.unit = unit;
    return info;
}

}  // namespace

SeriesInfo stream_hdf5_series(const SeriesRequest& request, const TakePiece& take) {
    const auto links = request.follow_links ? store::Links::follow : store::Links::refuse;
    return store::guarded(request.path, links, [&](const store::GuardedPath& guarded) {
        const TakePiece nowhere = [](const SeriesPiece&) {};
        return stream_hdf5_file(guarded, request, store::is_trial() ? nowhere : take);
    });
}

}  // namespace ringlock::record
