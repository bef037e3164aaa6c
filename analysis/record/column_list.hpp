#pragma once
#include <string>
#include <vector>

#include "analysis/record/series/series.hpp"

namespace ringlock::record {

/// The names in a list of columns, divided at commas outside of quotes and brackets: x,y,z or 'imu[:,0],imu[:,1]'.
///
/// A name of the file that is the whole list goes before its parts, so that a column called "a,b" is found without
/// quotes; in a list with others it is quoted, x,"a,b". `request` says which file, and how a text is written; its
/// column is ignored. Numbers and names are not looked up otherwise. Throws InputError where a name is empty or a
/// quote does not close, and as read_series() does where the file cannot be opened.
std::vector<std::string> columns_of_list(const SeriesRequest& request, const std::string& list);

}  // namespace ringlock::record
