#pragma once
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "analysis/record/series/series.hpp"

namespace ringlock::record {

/// A dataset of numbers, of one or two dimensions, or a field of one whose elements are records.
struct Dataset {
    std::string path;  ///< of a field with its name behind: "/imu/gyro_x"
    std::vector<std::uint64_t> sides;
    /// Path of the dataset itself, and the names that lead to the field in its records; no names if it is no field.
    std::string dataset = {};
    std::vector<std::string> field = {};
    bool field_is_array = false;  ///< each record has sides[1] numbers of it
    bool is_alias = false;        ///< another name of a dataset that is listed too

    /// One series and nothing else: of one dimension, or of two where one is 1, as MATLAB has them.
    bool is_series() const { return sides.size() == 1 || (!field_is_array && (sides[0] == 1 || sides[1] == 1)); }
};

/// Datasets that cannot be read as a series, each with the reason.
struct Unreadable {
    std::string path;
    std::string why;  ///< a sentence about it, without subject: "holds text"
};

/// Datasets of a file.
struct Contents {
    std::vector<Dataset> datasets;
    std::vector<Unreadable> others;
};

/// The series that is read of a dataset.
struct Slice {
    Dataset of;
    int along = 0;         ///< dimension that time runs along
    std::uint64_t at = 0;  ///< where, in the other one
    std::string brackets;  ///< "[3,:]" for row 3, "[:,3]" for column 3; empty where the dataset is one series

    std::string name() const { return of.path + brackets; }
};

struct Choice {
    Slice column;
    std::optional<Slice> time;
    std::optional<Slice> nanoseconds;  ///< behind the seconds of `time`, where --time names two
};

/// Makes datasets unreadable whose name occurs more than once in the file, because a request would mean any of them.
/// \param repeated  names of these datasets, without those of fields
void refuse_repeated(const std::set<std::string>& repeated, Contents& contents);

/// The names in `--time SECONDS,NANOSECONDS`; one where there is no comma outside of brackets.
std::vector<std::string> names_of_times(const std::string& asked);

/// A name without the brackets at its end.
std::string without_brackets(const std::string& name);

/// The requested series among the datasets of a file: by path, or by the end of the path where only one dataset ends in
/// it; for a two-dimensional dataset with row [I,:] or column [:,J] after it, counted from 0. Throws InputError where
/// that is no series, more than one or outside the dataset; the message lists the possible requests.
Choice choose_datasets(const SeriesRequest& request, const Contents& there);

}  // namespace ringlock::record
