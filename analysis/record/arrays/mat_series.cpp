#include <fmt/format.h>
#include <matio.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "analysis/record/arrays/array_choice.hpp"
#include "analysis/record/arrays/array_column.hpp"
#include "analysis/record/arrays/mat_elements.hpp"
#include "analysis/record/readers.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/store/guard.hpp"

/// Files of MATLAB 5 to 7 (and Octave's save -v7). Those of MATLAB 7.3 are HDF5.
namespace ringlock::record {
namespace {

using MatFile = std::unique_ptr<mat_t, int (*)(mat_t*)>;
using Variable = std::unique_ptr<matvar_t, void (*)(matvar_t*)>;

MatFile open_mat(const std::string& path) {
    check_mat_elements(path);
    // The library would print, and end the program.
    Mat_LogInitFunc("ringlock", [](int, char*) {});
    MatFile file(Mat_Open(path.c_str(), MAT_ACC_RDONLY), Mat_Close);
    if (!file) throw InputError(fmt::format("{}: cannot be read as a file of MATLAB; it is damaged", printable(path)));
    return file;
}

/// Bytes of a number of that class; 0 for a class without numbers.
std::size_t bytes_of(matio_classes of) {
    switch (of) {
        case MAT_C_DOUBLE:
        case MAT_C_INT64:
        case MAT_C_UINT64:
            return 8;
        case MAT_C_SINGLE:
        case MAT_C_INT32:
        case MAT_C_UINT32:
            return 4;
        case MAT_C_INT16:
        case MAT_C_UINT16:
            return 2;
        case MAT_C_INT8:
        case MAT_C_UINT8:
            return 1;
        default:
            return 0;
    }
}

/// Why a variable is no array of numbers of two dimensions; empty where it is one.
std::string why_not(const matvar_t& variable) {
    switch (variable.class_type) {
        case MAT_C_CHAR:
            return "holds text; write numbers";
        case MAT_C_CELL:
            return "is a cell array; write the numbers themselves into a variable of their own";
        case MAT_C_STRUCT:
        case MAT_C_OBJECT:
            return "is a struct; write its fields into variables of their own (save -struct)";
        case MAT_C_SPARSE:
            return "is a sparse matrix; write full(NAME)";
        default:
            break;
    }
    if (bytes_of(variable.class_type) == 0) return "holds no numbers";
    if (variable.isComplex != 0) {
        return "holds complex numbers; write real and imaginary part into variables of their own";
    }
    if (variable.rank != 2) return fmt::format("has {} dimensions; write two of them", variable.rank);
    return "";
}

/// The library may find another variable in a damaged file than check_mat_elements() has seen.
void check_mat_size(const std::string& path, const std::string& name, const std::vector<std::uint64_t>& sides) {
    std::error_code unknown;
    const auto there = static_cast<double>(std::filesystem::file_size(path, unknown));
    // MATLAB writes whole numbers with as few bytes as they need, and packs its data with deflate (RFC 1951).
    constexpr double greatest_ratio = 1032.0;
    const double values = static_cast<double>(sides[0]) * static_cast<double>(sides[1]);
    if (unknown || values <= greatest_ratio * there) return;
    throw InputError(
        fmt::format("{}: dataset {}: says that it has {:.10g} values, which the file of {:.4g} bytes cannot hold: "
                    "it is damaged",
                    printable(path), printable(name), values, there));
}

Contents variables_of(const std::string& path) {
    const MatFile file = open_mat(path);
    Contents contents;
    std::set<std::string> names;
    std::set<std::string> repeated;
    for (;;) {
        const Variable variable(Mat_VarReadNextInfo(file.get()), Mat_VarFree);
        if (!variable) break;
        const std::string name = fmt::format("/{}", variable->name != nullptr ? variable->name : "");
        if (!names.insert(name).second) repeated.insert(name);
        const std::string why = why_not(*variable);
        if (!why.empty()) {
            contents.others.push_back({name, why});
            continue;
        }
        Dataset dataset{name, {variable->dims[0], variable->dims[1]}, name};
        check_mat_size(path, name, dataset.sides);
        contents.datasets.push_back(std::move(dataset));
    }
    refuse_repeated(repeated, contents);
    return contents;
}

class MatColumn final : public ArrayColumn {
   public:
    MatColumn(const std::string& path, const Slice& slice)
        : path_(path),
          slice_(slice),
          file_(open_mat(path)),
          variable_(Mat_VarReadInfo(file_.get(), slice.of.dataset.substr(1).c_str()), Mat_VarFree) {
        if (!variable_ || !why_not(*variable_).empty()) {
            throw InputError(fmt::format("{}: cannot be read; is the file damaged?", label()));
        }
        length_ = slice.of.sides[static_cast<std::size_t>(slice.along)];
    }

    std::uint64_t length() const override { return length_; }
    Kind kind() const override {
        switch (variable_->class_type) {
            case MAT_C_DOUBLE:
            case MAT_C_SINGLE:
                return Kind::real;
            case MAT_C_UINT8:
            case MAT_C_UINT16:
            case MAT_C_UINT32:
            case MAT_C_UINT64:
                return Kind::whole_unsigned;
            default:
                return Kind::whole;
        }
    }
    std::string name() const override { return slice_.name(); }
    std::string label() const override {
        return fmt::format("{}: dataset {}", printable(path_), printable(slice_.name()));
    }
    void read(std::uint64_t first, std::span<double> into) override { read_numbers(first, into); }
    void read(std::uint64_t first, std::span<std::int64_t> into) override { read_numbers(first, into); }
    void read(std::uint64_t first, std::span<std::uint64_t> into) override { read_numbers(first, into); }

   private:
    /// Reads all of the series at once: the library unpacks a variable anew from its start for every part of it.
    void load() {
        const std::size_t bytes = bytes_of(variable_->class_type);
        store::expect_memory(2.0 * static_cast<double>(length_) * static_cast<double>(bytes));
        data_.resize(static_cast<std::size_t>(length_) * bytes);
        // Column by column: from one row to the next is one element, from one column to the next as many as rows.
        const std::uint64_t rows = slice_.of.sides[0];
        const std::uint64_t start = slice_.along == 0 ? slice_.at * rows : slice_.at;
        const std::uint64_t stride = slice_.along == 0 ? 1 : rows;
        constexpr std::uint64_t most = std::numeric_limits<int>::max();
        if (std::max({start, stride, length_}) > most) {
            throw InputError(
                fmt::format("{}: has more values than the library reads ({}); write HDF5 (save -v7.3)", label(), most));
        }
        if (Mat_VarReadDataLinear(file_.get(), variable_.get(), data_.data(), static_cast<int>(start),
                                  static_cast<int>(stride), static_cast<int>(length_)) != 0) {
            throw InputError(fmt::format("{}: its values cannot be read; the file is cut off or damaged", label()));
        }
    }

    template <class Stored, class T>
    void convert(std::uint64_t first, std::span<T> into) const {
        for (std::size_t i = 0; i < into.size(); ++i) {
            Stored value;
            std::memcpy(&value, &data_[(static_cast<std::size_t>(first) + i) * sizeof value], sizeof value);
            into[i] = static_cast<T>(value);
        }
    }

    template <class T>
    void read_numbers(std::uint64_t first, std::span<T> into) {
        if (data_.empty()) load();
        switch (variable_->class_type) {
            case MAT_C_DOUBLE:
                return convert<double>(first, into);
            case MAT_C_SINGLE:
                return convert<float>(first, into);
            case MAT_C_INT8:
                return convert<std::int8_t>(first, into);
            case MAT_C_UINT8:
                return convert<std::uint8_t>(first, into);
            case MAT_C_INT16:
                return convert<std::int16_t>(first, into);
            case MAT_C_UINT16:
                return convert<std::uint16_t>(first, into);
            case MAT_C_INT32:
                return convert<std::int32_t>(first, into);
            case MAT_C_UINT32:
                return convert<std::uint32_t>(first, into);
            case MAT_C_INT64:
                return convert<std::int64_t>(first, into);
            default:
                return convert<std::uint64_t>(first, into);
        }
    }

    std::string path_;
    Slice slice_;
    MatFile file_;
    Variable variable_;
    std::uint64_t length_ = 0;
    std::vector<char> data_;
};

SeriesInfo stream_mat_file(const SeriesRequest& request, const TakePiece& take) {
    const Choice choice = choose_datasets(request, variables_of(request.path));
    return stream_choice(
        request, choice, [&](const Slice& slice) { return std::make_unique<MatColumn>(request.path, slice); }, take);
}

}  // namespace

SeriesInfo stream_mat_series(const SeriesRequest& request, const TakePiece& take) {
    return store::guarded(request.path, [&](const store::GuardedPath&) {
        const TakePiece nowhere = [](const SeriesPiece&) {};
        return stream_mat_file(request, store::is_trial() ? nowhere : take);
    });
}

}  // namespace ringlock::record
