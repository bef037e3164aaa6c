#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "analysis/record/series.hpp"

namespace ringlock::record {

/// A dataset of numbers, of one or two dimensions.
struct Dataset {
    std::string path;
    std::vector<std::uint64_t> sides;

    /// One series and nothing else: of one dimension, or of two where one is 1, as MATLAB has them.
    bool is_series() const { return sides.size() == 1 || sides[0] == 1 || sides[1] == 1; }
};

/// The series that is read of a dataset.
struct Slice {
    std::string path;
    int along = 0;         ///< dimension that time runs along
    std::uint64_t at = 0;  ///< where, in the other one
    std::string brackets;  ///< "[3,:]" for row 3, "[:,3]" for column 3; empty where the dataset is one series

    std::string name() const { return path + brackets; }
};

struct Choice {
    Slice column;
    std::optional<Slice> time;
};

/// What is asked for among the datasets of a file: by path, or by the end of it where only one ends so; of a
/// two-dimensional one with row [I,:] or column [:,J] after it, counted from 0. Throws InputError where that is
/// nothing, not one thing or outside the dataset, and says what could be asked for.
Choice choose_datasets(const SeriesRequest& request, const std::vector<Dataset>& there);

}  // namespace ringlock::record
