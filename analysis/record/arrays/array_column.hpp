#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "analysis/record/arrays/array_choice.hpp"
#include "analysis/record/series/series.hpp"
#include "analysis/record/series/series_rows.hpp"

namespace ringlock::record {

/// One series of numbers in a file of arrays (HDF5, NumPy, MATLAB).
class ArrayColumn {
   public:
    enum class Kind { real, whole, whole_unsigned };

    virtual ~ArrayColumn() = default;
    virtual std::uint64_t length() const = 0;
    virtual Kind kind() const = 0;
    /// Path and brackets.
    virtual std::string name() const = 0;
    /// "FILE: dataset NAME", for messages.
    virtual std::string label() const = 0;
    std::string place(std::size_t element) const;

    /// Elements from `first` on, as many as there is room for; pieces are requested from front to back. Whole numbers
    /// in the type of kind(), any into double. Throws InputError.
    virtual void read(std::uint64_t first, std::span<double> into) = 0;
    virtual void read(std::uint64_t first, std::span<std::int64_t> into) = 0;
    virtual void read(std::uint64_t first, std::span<std::uint64_t> into) = 0;
};

/// Hands the values of a column on, by their times where there are some. Throws InputError, naming file, dataset and
/// element, where the two differ in length, a value is infinite, or a whole number beyond 63 bits.
SeriesInfo stream_column(const SeriesRequest& request, ArrayColumn& column, ArrayColumn* time, const TakePiece& take);

/// The same of the columns that were chosen, which `open` opens. Times in seconds and nanoseconds become nanoseconds:
/// throws InputError where the request has another unit.
SeriesInfo stream_choice(const SeriesRequest& request, const Choice& choice,
                         const std::function<std::unique_ptr<ArrayColumn>(const Slice&)>& open, const TakePiece& take);

}  // namespace ringlock::record
