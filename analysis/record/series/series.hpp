#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/text/options.hpp"

/// Measured data from files.
namespace ringlock::record {

/// One column of a file, and how its rows follow each other.
struct SeriesRequest {
    /// Text of any dialect (docs/field-data.md), packed or not, the CSV form of an rlg-record (`# key = value` lines
    /// such as rate_hz), HDF5 (MATLAB 7.3 too), NumPy's .npy and .npz or MATLAB 5, distinguished by their content; "-"
    /// is text from standard input.
    std::string path;
    /// Name of the column, its number from 1, or the path of a dataset, array or variable, or the end of it, with [I,:]
    /// for row I or [:,J] for column J of a two-dimensional one, counted from 0. Fields of records in a dataset are
    /// columns: DATASET/FIELD. May be left out where there is only one in addition to the time.
    std::optional<std::string> column;
    /// Likewise, a column of the times of the rows. Of text it may be two, with a comma between: seconds and
    /// nanoseconds, or the date and the time of day. Without it rows follow each other without gaps.
    std::optional<std::string> time;
    double rate_hz = 0.0;  ///< samples a second; needed with `time`, else ignored
    /// Whether an HDF5 file may lead to others, by external links, raw data outside or virtual datasets.
    bool follow_links = false;
    /// Unit of the times, one of text::known_time_units; without it that which the header declares, ISO dates where
    /// they stand there, else seconds.
    std::optional<std::string> time_unit = {};
    text::Options text = {};  ///< what is said of the dialect of a text
};

/// A datum, counted from 0 with those that are missing, and the line of the file, from 1, on which it stands.
struct DatumLine {
    std::size_t datum = 0;
    std::size_t line = 0;
};

/// Properties of a series that are known once it has been read.
struct SeriesInfo {
    std::string column;                    ///< its name, or its number from 1 where columns have no names
    std::optional<double> rate_hz;         ///< where the file says so
    std::optional<std::string> unit = {};  ///< likewise, in its own words: of a header, or the attribute unit or units
    std::size_t n = 0;                     ///< values, those that are missing included
    std::size_t missing = 0;               ///< how many of them are
    bool rounded = false;                  ///< whole numbers of which some are beyond 2^53, where doubles lose digits
    /// Of a text, the first datum of each run of data that stand on lines one after the other; empty where there are
    /// more than 100 000 runs.
    std::vector<DatumLine> lines = {};

    /// Line of a datum that is in the file; nothing where the file has no lines.
    std::optional<std::size_t> line_of(std::size_t datum) const;
};

struct Series : SeriesInfo {
    std::vector<double> values;        ///< finite, or quiet NaN where missing; at least one is there
    std::vector<std::int64_t> counts;  ///< where `rounded`, the whole numbers themselves, 0 where missing; else empty
};

/// Reads one column of numbers.
///
/// A value is missing where the text says so (text::missing_words, in capitals or not, signed or not) or nothing
/// between delimiters, where HDF5 has a NaN, and, with time stamps, where no row stands at a point of the grid of
/// 1/rate_hz. Gaps at either end are kept. Stamps may lie a quarter of an interval off the grid, which follows a clock
/// that runs up to 1e-3 off the rate.
///
/// Throws InputError, naming file, line or element, and column, where the file cannot be read or is no text, a row is
/// ragged, a field is no number or infinite, a column of whole numbers goes beyond 64 bits, a time is missing, stands
/// still, goes backwards or lies off the grid, stamps contradict the rate or leave out more than 20 values for each row
/// so far and more than 1e6, the unit of the times contradicts the header, the column is not there, all values are
/// missing or there are more of them than memory.
Series read_series(const SeriesRequest& request);
Series read_series(const std::string& path, const std::optional<std::string>& column);

/// The same in pieces, one after the other, in memory that does not grow with the file. Where the file turns out wrong,
/// the pieces before have been handed on already.
SeriesInfo stream_series(const SeriesRequest& request, const std::function<void(std::span<const double>)>& piece);

}  // namespace ringlock::record
