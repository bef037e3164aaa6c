#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

/// Measured data from files.
namespace ringlock::record {

/// One column of a file, and how its rows follow each other.
struct SeriesRequest {
    /// Text (`#` comments; commas or white space between columns; a first row that is not all numbers is a header), the
    /// CSV form of an rlg-record (`# key = value` lines such as rate_hz) or HDF5; "-" is text from standard input.
    std::string path;
    /// Name of the column, its number from 1, or the path of an HDF5 dataset or the end of it, with [I,:] for row I or
    /// [:,J] for column J of a two-dimensional one, counted from 0. May be left out where there is only one beside the
    /// time.
    std::optional<std::string> column;
    /// Likewise, a column of the times of the rows [s]. Without it rows follow each other without gaps.
    std::optional<std::string> time;
    double rate_hz = 0.0;  ///< samples a second; needed with `time`, else of no account
};

/// What is known of a series once it has been read.
struct SeriesInfo {
    std::string column;             ///< its name, or its number from 1 where columns have no names
    std::optional<double> rate_hz;  ///< where the file says so
    std::size_t n = 0;              ///< values, those that are missing included
    std::size_t missing = 0;        ///< how many of them are
    bool rounded = false;           ///< whole numbers of which some are beyond 2^53, where doubles lose digits
};

struct Series : SeriesInfo {
    std::vector<double> values;        ///< finite, or quiet NaN where missing; at least one is there
    std::vector<std::int64_t> counts;  ///< where `rounded`, the whole numbers themselves, 0 where missing; else empty
};

/// Reads one column of numbers.
///
/// A value is missing where the text says nan or NA (in capitals or not, signed or not) or nothing between commas,
/// where HDF5 has a NaN, and, with time stamps, where no row stands at a point of the grid of 1/rate_hz. Gaps at either
/// end are kept. Stamps may lie a quarter of an interval off the grid, which follows a clock that runs up to 1e-3 off
/// the rate.
///
/// Throws InputError, naming file, line or element, and column, where the file cannot be read, a row is ragged, a field
/// is no number or infinite, a column of whole numbers goes beyond 64 bits, a time is missing, stands still, goes
/// backwards or lies off the grid, stamps contradict the rate or leave out more than 1e9 values, the column is not
/// there, all values are missing or there are more of them than memory.
Series read_series(const SeriesRequest& request);
Series read_series(const std::string& path, const std::optional<std::string>& column);

/// The same in pieces, one after the other, in memory that does not grow with the file. Where the file turns out wrong,
/// the pieces before have been handed on already.
SeriesInfo stream_series(const SeriesRequest& request, const std::function<void(std::span<const double>)>& piece);

}  // namespace ringlock::record
