#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "analysis/record/arrays/array_choice.hpp"

namespace ringlock::record {

/// Of a dataset that is a series or a table of series.
inline constexpr int most_dimensions = 2;

/// The datasets of an open HDF5 file and the fields of those whose elements are records; targets of soft links and,
/// where they are followed, of external links included. `asked` are names that may lead through links to groups.
Contents hdf5_contents(std::int64_t file, const std::string& path, const std::vector<std::string>& asked);

/// The type in which a field is read alone: records with this field only. Close it with H5Tclose.
///
/// \param element  HDF5's type in memory of the numbers
/// \param count    numbers that each record has of it; 0 where it is one number and no array
std::int64_t type_of_field(const std::vector<std::string>& field, std::int64_t element, std::uint64_t count);

}  // namespace ringlock::record
