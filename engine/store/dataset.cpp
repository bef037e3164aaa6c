#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>
#include <new>
#include <stdexcept>
#include <utility>

#include "engine/store/hdf5.hpp"
#include "engine/store/library.hpp"
#include "engine/store/storage.hpp"

namespace ringlock::store {

using detail::Lock;

/// A part of a dataset: rows in the file and as many elements in memory.
struct Dataset::Selection {
    Id file_space;
    Id memory_space;
    std::uint64_t size = 0;
};

namespace {

std::uint64_t size_of(const Shape& shape) {
    std::uint64_t size = 1;
    for (const std::uint64_t extent : shape) {
        if (extent != 0 && size > std::numeric_limits<std::uint64_t>::max() / extent)
            throw std::length_error("number of elements");
        size *= extent;
    }
    return size;
}

/// Whether T can represent every value of the stored type.
template <Element T>
bool fits(hid_t stored) {
    const H5T_class_t stored_class = H5Tget_class(stored);
    if constexpr (std::same_as<T, std::string>) return stored_class == H5T_STRING;
    if constexpr (std::same_as<T, double>) return stored_class == H5T_FLOAT || stored_class == H5T_INTEGER;
    if constexpr (std::integral<T>) {
        if (stored_class != H5T_INTEGER) return false;
        const std::size_t size = H5Tget_size(stored);
        const bool is_signed = H5Tget_sign(stored) != H5T_SGN_NONE;
        if (is_signed == std::is_signed_v<T>) return size <= sizeof(T);
        return std::is_signed_v<T> && size < sizeof(T);
    }
}

template <Element T>
constexpr std::string_view name_of() {
    if constexpr (std::same_as<T, std::string>) return "text";
    if constexpr (std::same_as<T, double>) return "numbers";
    if constexpr (std::same_as<T, std::int8_t>) return "8-bit integers";
    if constexpr (std::same_as<T, std::int64_t>) return "integers";
    if constexpr (std::same_as<T, std::uint64_t>) return "integers from 0 on";
}

/// Strings of fixed length, padded with zeros or blanks, as other programs write them.
std::vector<std::string> cut(const std::string& block, std::size_t length, bool blanks) {
    std::vector<std::string> values;
    for (std::size_t start = 0; start < block.size(); start += length) {
        std::string value = block.substr(start, length);
        value.resize(std::min(value.find('\0'), value.size()));
        if (blanks) value.resize(value.find_last_not_of(' ') + 1);
        values.push_back(std::move(value));
    }
    return values;
}

}  // namespace

Dataset::Dataset(Id id, std::string file, std::string path) : Node(std::move(id), std::move(file), std::move(path)) {
    const Lock lock;
    const Id space(H5Dget_space(this->id().get()));
    const int rank = H5Sget_simple_extent_ndims(space.get());
    if (rank < 0 || rank > 2)
        detail::fail_input(this->file(), this->path(), fmt::format("must have 1 or 2 dimensions, not {}", rank));
    std::vector<hsize_t> extent(rank);
    H5Sget_simple_extent_dims(space.get(), extent.data(), nullptr);
    shape_.assign(extent.begin(), extent.end());
}

Dataset Dataset::opened(Id id, std::string file, std::string path) {
    // Before the constructor reads the extent: that of a virtual dataset may lie in other files.
    const Storage storage = check_storage(id.get(), file, path);
    Dataset dataset(std::move(id), std::move(file), std::move(path));
    dataset.is_plain_ = storage.is_plain;
    return dataset;
}

std::string Dataset::unit() const { return has_attribute("unit") ? string_attribute("unit") : ""; }

std::string Dataset::description() const { return has_attribute("description") ? string_attribute("description") : ""; }

Dataset::Selection Dataset::select_all() const {
    Selection all;
    all.file_space = Id(H5Dget_space(id().get()));
    all.memory_space = Id(H5Scopy(all.file_space.get()));
    all.size = size_of(shape_);
    return all;
}

Dataset::Selection Dataset::select(std::uint64_t first_row, std::uint64_t n_rows) const {
    return select(first_row, n_rows, 0, shape_.size() == 2 ? shape_[1] : 1);
}

Dataset::Selection Dataset::select(std::uint64_t first_row, std::uint64_t n_rows, std::uint64_t first_column,
                                   std::uint64_t n_columns) const {
    const std::uint64_t rows = shape_.empty() ? 0 : shape_[0];
    const std::uint64_t columns = shape_.size() == 2 ? shape_[1] : 1;
    if (first_row > rows || n_rows > rows - first_row)
        detail::fail_input(file(), path(),
                           fmt::format("has {} rows, no block of {} from row {}", rows, n_rows, first_row));
    if (first_column > columns || n_columns > columns - first_column)
        detail::fail_input(
            file(), path(),
            fmt::format("has {} columns, no block of {} from column {}", columns, n_columns, first_column));
    Selection block;
    std::vector<hsize_t> start{first_row};
    std::vector<hsize_t> count{n_rows};
    if (shape_.size() == 2) {
        start.push_back(first_column);
        count.push_back(n_columns);
    }
    block.file_space = Id(H5Dget_space(id().get()));
    block.memory_space = Id(H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr));
    block.size = n_rows * n_columns;
    if (block.size == 0)
        H5Sselect_none(block.file_space.get());
    else
        H5Sselect_hyperslab(block.file_space.get(), H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
    return block;
}

template <Element T>
void Dataset::write_selection(const Selection& selection, std::span<const T> values) {
    if (values.size() != selection.size)
        throw std::invalid_argument(
            fmt::format("{}: {}: {} values given for {} elements", file(), path(), values.size(), selection.size));
    if (values.empty()) return;
    const auto put = [&](hid_t type, const void* data) {
        return H5Dwrite(id().get(), type, selection.memory_space.get(), selection.file_space.get(), H5P_DEFAULT, data);
    };
    herr_t status = 0;
    if constexpr (std::same_as<T, std::string>) {
        std::vector<const char*> pointers;
        for (const std::string& value : values) pointers.push_back(value.c_str());
        status = put(detail::string_type().get(), pointers.data());
    } else {
        status = put(detail::Type<T>::memory(), values.data());
    }
    if (status < 0) detail::fail_run(file(), path(), "cannot be written");
}

template <Element T>
std::vector<T> Dataset::read_selection(const Selection& selection) const {
    const Id stored(H5Dget_type(id().get()));
    if (!fits<T>(stored.get())) detail::fail_input(file(), path(), fmt::format("must hold {}", name_of<T>()));
    if (selection.size == 0) return {};
    const auto get = [&](hid_t type, void* data) {
        if (H5Dread(id().get(), type, selection.memory_space.get(), selection.file_space.get(), H5P_DEFAULT, data) < 0)
            detail::fail_input(file(), path(), fmt::format("cannot be read ({})", detail::last_error()));
    };
    if constexpr (!std::same_as<T, std::string>) {
        constexpr std::uint64_t small = std::uint64_t{1} << 17;
        if (is_plain_ && size_of(shape_) > small && is_trial()) {
            note_left_out();
            expect_memory(static_cast<double>(selection.size * sizeof(T)));
            return std::vector<T>(selection.size);
        }
        std::vector<T> values(selection.size);
        get(detail::Type<T>::memory(), values.data());
        return values;
    } else if (H5Tis_variable_str(stored.get()) > 0) {
        std::vector<char*> pointers(selection.size, nullptr);
        get(stored.get(), pointers.data());
        std::vector<std::string> values;
        for (const char* text : pointers) values.emplace_back(text != nullptr ? text : "");
        H5Dvlen_reclaim(stored.get(), selection.memory_space.get(), H5P_DEFAULT, pointers.data());
        return values;
    } else {
        const std::size_t length = H5Tget_size(stored.get());
        std::string block(length * selection.size, '\0');
        get(stored.get(), block.data());
        return cut(block, length, H5Tget_strpad(stored.get()) == H5T_STR_SPACEPAD);
    }
}

template <Element T>
void Dataset::write(std::span<const T> values) {
    const Lock lock;
    write_selection(select_all(), values);
}

template <Element T>
void Dataset::write_rows(std::uint64_t first_row, std::uint64_t n_rows, std::span<const T> values) {
    const Lock lock;
    write_selection(select(first_row, n_rows), values);
}

template <Element T>
void Dataset::write_block(std::uint64_t first_row, std::uint64_t n_rows, std::uint64_t first_column,
                          std::uint64_t n_columns, std::span<const T> values) {
    const Lock lock;
    write_selection(select(first_row, n_rows, first_column, n_columns), values);
}

template <Element T>
bool Dataset::holds() const {
    const Lock lock;
    const Id stored(H5Dget_type(id().get()));
    return fits<T>(stored.get());
}

template <Element T>
std::vector<T> Dataset::read() const try {
    const Lock lock;
    return read_selection<T>(select_all());
} catch (const std::length_error&) {
    detail::fail_input(file(), path(), "is too large to be read into memory");
} catch (const std::bad_alloc&) {
    detail::fail_input(file(), path(), "is too large to be read into memory");
}

template <Element T>
std::vector<T> Dataset::read_rows(std::uint64_t first_row, std::uint64_t n_rows) const {
    const Lock lock;
    return read_selection<T>(select(first_row, n_rows));
}

template <Element T>
std::vector<T> Dataset::read_block(std::uint64_t first_row, std::uint64_t n_rows, std::uint64_t first_column,
                                   std::uint64_t n_columns) const {
    const Lock lock;
    return read_selection<T>(select(first_row, n_rows, first_column, n_columns));
}

namespace {

/// Chunks of so many rows, compressed where the library can: bytes of one place in the numbers stand together.
void store_in_chunks(hid_t creation, std::vector<hsize_t> extent, std::uint64_t rows) {
    if (size_of({extent.begin(), extent.end()}) == 0) return;
    extent[0] = std::clamp<hsize_t>(rows, 1, extent[0]);
    H5Pset_chunk(creation, static_cast<int>(extent.size()), extent.data());
    if (H5Zfilter_avail(H5Z_FILTER_DEFLATE) <= 0) return;
    constexpr unsigned fastest = 1;
    H5Pset_shuffle(creation);
    H5Pset_deflate(creation, fastest);
}

/// Chunks go to the disk at once, so that a full one shows where they are written.
Id without_cache() {
    Id access(H5Pcreate(H5P_DATASET_ACCESS));
    H5Pset_chunk_cache(access.get(), 0, 0, H5D_CHUNK_CACHE_W0_DEFAULT);
    return access;
}

}  // namespace

template <Element T>
Dataset Group::make_dataset(const std::string& name, const Shape& shape, const Label& label, Space space,
                            std::uint64_t chunk_rows) {
    const Lock lock;
    const std::string path = child_path(name);
    if (shape.empty() || shape.size() > 2) throw std::invalid_argument(path + ": a dataset has 1 or 2 dimensions");
    const std::vector<hsize_t> extent(shape.begin(), shape.end());
    const Id file_space(H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr));
    const Id creation(H5Pcreate(H5P_DATASET_CREATE));
    H5Pset_obj_track_times(creation.get(), false);
    if (space == Space::at_once) H5Pset_alloc_time(creation.get(), H5D_ALLOC_TIME_EARLY);
    if (space == Space::in_chunks) store_in_chunks(creation.get(), extent, chunk_rows);
    const Id access = space == Space::in_chunks ? without_cache() : Id(H5Pcreate(H5P_DATASET_ACCESS));
    if constexpr (std::same_as<T, double>) {
        const double nan = std::numeric_limits<double>::quiet_NaN();
        H5Pset_fill_value(creation.get(), H5T_NATIVE_DOUBLE, &nan);
    }
    const Id links(H5Pcreate(H5P_LINK_CREATE));
    H5Pset_create_intermediate_group(links.get(), true);
    const auto create = [&](hid_t type) {
        return H5Dcreate2(id().get(), name.c_str(), type, file_space.get(), links.get(), creation.get(), access.get());
    };
    Id made;
    if constexpr (std::same_as<T, std::string>)
        made = Id(create(detail::string_type().get()));
    else
        made = Id(create(detail::Type<T>::stored()));
    if (!made.valid()) detail::fail_run(file(), path, "cannot be created");
    Dataset dataset(std::move(made), file(), path);
    dataset.set_attribute("unit", label.unit);
    dataset.set_attribute("description", label.description);
    return dataset;
}

template <Element T>
Dataset Group::create_dataset(const std::string& name, const Shape& shape, const Label& label) {
    return make_dataset<T>(name, shape, label, Space::at_once);
}

template <Element T>
Dataset Group::create_chunked(const std::string& name, const Shape& shape, std::uint64_t chunk_rows,
                              const Label& label) {
    return make_dataset<T>(name, shape, label, Space::in_chunks, chunk_rows);
}

template <Element T>
Dataset Group::write(const std::string& name, std::span<const T> values, const Shape& shape, const Label& label) {
    Dataset dataset = make_dataset<T>(name, shape, label, Space::on_writing);
    dataset.write(values);
    return dataset;
}

template <Element T>
Dataset Group::write(const std::string& name, std::span<const T> values, const Label& label) {
    return write(name, values, Shape{values.size()}, label);
}

#define RINGLOCK_INSTANTIATE(T)                                                                                       \
    template void Dataset::write<T>(std::span<const T>);                                                              \
    template void Dataset::write_rows<T>(std::uint64_t, std::uint64_t, std::span<const T>);                           \
    template void Dataset::write_block<T>(std::uint64_t, std::uint64_t, std::uint64_t, std::uint64_t,                 \
                                          std::span<const T>);                                                        \
    template bool Dataset::holds<T>() const;                                                                          \
    template std::vector<T> Dataset::read<T>() const;                                                                 \
    template std::vector<T> Dataset::read_rows<T>(std::uint64_t, std::uint64_t) const;                                \
    template std::vector<T> Dataset::read_block<T>(std::uint64_t, std::uint64_t, std::uint64_t, std::uint64_t) const; \
    template Dataset Group::create_dataset<T>(const std::string&, const Shape&, const Label&);                        \
    template Dataset Group::create_chunked<T>(const std::string&, const Shape&, std::uint64_t, const Label&);         \
    template Dataset Group::write<T>(const std::string&, std::span<const T>, const Label&);                           \
    template Dataset Group::write<T>(const std::string&, std::span<const T>, const Shape&, const Label&);
RINGLOCK_INSTANTIATE(double)
RINGLOCK_INSTANTIATE(std::int64_t)
RINGLOCK_INSTANTIATE(std::uint64_t)
RINGLOCK_INSTANTIATE(std::int8_t)
RINGLOCK_INSTANTIATE(std::string)
#undef RINGLOCK_INSTANTIATE

}  // namespace ringlock::store
