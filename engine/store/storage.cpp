#include "engine/store/storage.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/store/guard.hpp"
#include "engine/store/library.hpp"
#include "engine/store/links.hpp"

namespace ringlock::store {
namespace {

constexpr double greatest_ratio = 1032.0;
constexpr double small_bytes = 1048576.0;  // a dataset up to this size is not refused, since it costs little memory

class StorageCheck {
   public:
    StorageCheck(std::int64_t dataset, const std::string& file, const std::string& name)
        : dataset_(dataset), creation_(H5Dget_create_plist(dataset)), file_(file), name_(name) {
        if (!creation_.valid()) fail("cannot be opened; is the file damaged?");
        layout_ = H5Pget_layout(creation_.get());
    }

    Storage run() const {
        const bool outside = check_outside();
        const Id type(H5Dget_type(dataset_));
        check_type(type.get());
        const Id space(H5Dget_space(dataset_));
        Storage storage;
        storage.bytes = values_in(space.get()) * static_cast<double>(H5Tget_size(type.get()));
        if (storage.bytes == 0.0) return storage;
        storage.is_written = layout_ == H5D_VIRTUAL || H5Dget_storage_size(dataset_) > 0;
        if (!outside) check_size(storage.bytes);
        const H5T_class_t kind = H5Tget_class(type.get());
        storage.is_plain = !outside && layout_ == H5D_CONTIGUOUS && (kind == H5T_FLOAT || kind == H5T_INTEGER);
        if (!storage.is_plain || !is_trial()) expect_memory(2.0 * storage.bytes + chunk_bytes());
        return storage;
    }

    /// Whether values lie in other files. Throws InputError where they may not.
    bool check_outside() const {
        std::vector<std::string> files = detail::external_files(creation_.get());
        const char* how = "its values lie in";
        if (layout_ == H5D_VIRTUAL) {
            files = detail::virtual_files(creation_.get());
            how = "it is made of datasets in";
        }
        if (files.empty()) return false;
        std::vector<std::string> names;
        constexpr std::size_t most = 5;
        for (std::size_t i = 0; i < std::min(most, files.size()); ++i) names.push_back(printable(files[i]));
        if (files.size() > most) names.push_back(fmt::format("{} more", files.size() - most));
        if (links_in_force() == Links::refuse) {
            fail(
                fmt::format("{} another file ({}), and only the file that was named is read. "
                            "Give --follow-links to a command that has it, or make one file with h5repack",
                            how, fmt::join(names, ", ")));
        }
        for (const std::string& other : files) {
            if (!detail::is_readable_in_same_folder(dataset_, other)) {
                fail(fmt::format("{} the file {}, which does not exist or is not a regular file", how,
                                 printable(other)));
            }
        }
        return true;
    }

   private:
    [[noreturn]] void fail(const std::string& what) const {
        throw InputError(fmt::format("{}: dataset {}: {}", printable(file_), printable(name_), what));
    }

    /// The library copies as many bytes as these sizes state even if they are damaged, and then reads beyond the data
    /// that it has unpacked.
    void check_type(hid_t type) const {
        const H5T_class_t kind = H5Tget_class(type);
        const std::size_t size = H5Tget_size(type);
        if (kind == H5T_NO_CLASS || size == 0) fail("its type cannot be read; is the file damaged?");
        if (kind == H5T_INTEGER && size > sizeof(std::int64_t)) fail_size("integers", size, sizeof(std::int64_t));
        if (kind == H5T_FLOAT && size > sizeof(long double)) fail_size("numbers", size, sizeof(long double));
    }
    [[noreturn]] void fail_size(const char* what, std::size_t size, std::size_t most) const {
        fail(fmt::format("holds {} of {} bytes each; allowed are up to {}. Is the file damaged?", what, size, most));
    }

    static double values_in(hid_t space) {
        std::array<hsize_t, H5S_MAX_RANK> sides{};
        const int dimensions = H5Sget_simple_extent_ndims(space);
        if (H5Sget_simple_extent_type(space) == H5S_NULL) return 0.0;
        if (dimensions < 0 || H5Sget_simple_extent_dims(space, sides.data(), nullptr) < 0) return 0.0;
        double values = 1.0;
        for (int i = 0; i < dimensions; ++i) values *= static_cast<double>(sides[static_cast<std::size_t>(i)]);
        return values;
    }

    /// Bytes of one chunk, unpacked; 0 for a dataset without chunks.
    double chunk_bytes() const {
        if (layout_ != H5D_CHUNKED) return 0.0;
        std::array<hsize_t, H5S_MAX_RANK> sides{};
        const int dimensions = H5Pget_chunk(creation_.get(), H5S_MAX_RANK, sides.data());
        const Id type(H5Dget_type(dataset_));
        auto bytes = static_cast<double>(H5Tget_size(type.get()));
        for (int i = 0; i < std::min<int>(dimensions, H5S_MAX_RANK); ++i) {
            bytes *= static_cast<double>(sides[static_cast<std::size_t>(i)]);
        }
        return bytes;
    }

    void check_size(double bytes) const {
        const Id of(H5Iget_file_id(dataset_));
        hsize_t size = 0;
        if (H5Fget_filesize(of.get(), &size) < 0) fail("cannot be read");
        const auto file_bytes = static_cast<double>(size);
        const auto stored = static_cast<double>(H5Dget_storage_size(dataset_));
        if (stored == 0.0 && layout_ != H5D_VIRTUAL) {
            // Reading gives as many fill values as the dataset claims: harmless where they are few.
            if (bytes > small_bytes) fail("was never written, although it has room for values");
            return;
        }
        if (layout_ == H5D_CONTIGUOUS) {
            const haddr_t at = H5Dget_offset(dataset_);
            if (at == HADDR_UNDEF || static_cast<double>(at) + bytes > file_bytes) fail_more(bytes, file_bytes);
        }
        if (std::max(bytes, chunk_bytes()) > std::max(small_bytes, greatest_ratio * file_bytes)) {
            fail_more(std::max(bytes, chunk_bytes()), file_bytes);
        }
    }
    [[noreturn]] void fail_more(double bytes, double file_bytes) const {
        fail(
            fmt::format("says that its values take {:.4g} bytes, which the file of {:.4g} bytes cannot hold: "
                        "it is damaged",
                        bytes, file_bytes));
    }

    std::int64_t dataset_;
    Id creation_;
    const std::string& file_;
    const std::string& name_;
    H5D_layout_t layout_ = H5D_LAYOUT_ERROR;
};

}  // namespace

Storage check_storage(std::int64_t dataset, const std::string& file, const std::string& name) {
    const detail::Lock lock;
    return StorageCheck(dataset, file, name).run();
}

void check_files(std::int64_t dataset, const std::string& file, const std::string& name) {
    const detail::Lock lock;
    static_cast<void>(StorageCheck(dataset, file, name).check_outside());
}

std::string refused_link() { return detail::refused_link(); }

}  // namespace ringlock::store
