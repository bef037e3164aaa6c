#pragma once
#include "analysis/record/series.hpp"

/// The two kinds of file behind read_series.
namespace ringlock::record {

Series read_text_series(const std::string& path, const std::optional<std::string>& column);
Series read_hdf5_series(const std::string& path, const std::optional<std::string>& column);

/// "a, b, c", at most the first 20.
std::string listed(const std::vector<std::string>& names);

}  // namespace ringlock::record
