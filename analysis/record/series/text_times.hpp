#pragma once
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/record/series/series.hpp"
#include "analysis/text/stamps.hpp"
#include "analysis/text/table.hpp"

namespace ringlock::record {

/// The times of the rows of a text, from one column or from two: seconds and nanoseconds, or the date and the time of
/// day.
class TextTimes {
   public:
    /// Finds the columns of request.time and the unit: that of request.time_unit, else ISO dates where the first row
    /// has one, else the one that the header declares, which is said in a notice, else seconds. `first` holds the
    /// fields of the first row, none where there is no row. Throws InputError where there is no such column or option
    /// and header contradict each other.
    TextTimes(const text::Layout& layout, const std::vector<std::string_view>& first, const SeriesRequest& request,
              std::string file);

    const std::string& name() const { return name_; }
    std::size_t columns() const { return where_.size(); }
    bool has(std::size_t column) const;
    /// Of the stamps.
    const text::TimeUnit& unit() const { return unit_; }

    /// The time of the table's row; NaN where it is missing. Throws InputError where it is no time.
    text::Stamp of(const text::Table& table) const;

   private:
    void find_unit(const text::Layout& layout, const std::vector<std::string_view>& first,
                   const SeriesRequest& request);
    [[noreturn]] void fail(const text::Table& table, std::size_t column, const std::string& what) const;
    text::Stamp of_one(const text::Table& table, std::size_t column) const;
    text::Stamp of_two(const text::Table& table) const;

    std::string file_;
    std::string name_;
    std::vector<std::size_t> where_;
    std::vector<std::string> names_;
    text::TimeUnit unit_;
};

}  // namespace ringlock::record
