#pragma once
#include <optional>
#include <string>
#include <vector>

#include "analysis/record/series/series.hpp"
#include "app/allan/repeated_input.hpp"

namespace ringlock::app {

/// One column of one file.
struct SeriesName {
    std::string path;
    std::optional<std::string> column;
    bool read_before =
        false;  ///< another column of the same file comes first; what is to be noted of the file was said
};

/// Each column of `columns`, a list as --column has it, in each file; the only column of each where the list is empty.
///
/// \param series  how the files are to be read
/// Throws InputError where a file or a column is named twice, or the list cannot be understood.
std::vector<SeriesName> series_names(const std::vector<std::string>& files, const std::string& columns,
                                     const record::SeriesRequest& series, const RepeatedInput& input);

}  // namespace ringlock::app
