#pragma once
#include <optional>
#include <string>
#include <vector>

/// Measured data from files.
namespace ringlock::record {

/// One column of a file.
struct Series {
    std::vector<double> values;     ///< all finite
    std::string column;             ///< its name, or its number from 1 where columns have no names
    std::optional<double> rate_hz;  ///< where the file says so
};

/// Reads one column of numbers.
///
/// \param path    text (`#` comments; commas or white space between columns; a first row that is not all numbers is a
///                header), the CSV form of an rlg-record (`# key = value` lines such as rate_hz) or an HDF5 file
/// \param column  name of the column, its number from 1, or the path of an HDF5 dataset (of an rlg-record also its name
///                alone); may be left out where there is only one
///
/// Throws InputError, naming file, line and column, where the file cannot be read, a row is ragged, a field is no
/// number or not finite (gaps are not handled yet), the column is not there or there is no data.
Series read_series(const std::string& path, const std::optional<std::string>& column);

}  // namespace ringlock::record
