#pragma once
#include <optional>
#include <string>
#include <vector>

#include "analysis/record/record.hpp"
#include "analysis/text/options.hpp"

namespace ringlock::record {

/// A column of a file, and the dataset of a record that it becomes.
struct MappedColumn {
    std::string column;    ///< name, number from 1 or dataset, as in SeriesRequest
    std::string quantity;  ///< a name of quantities_to_map()
};

/// A log of any layout, and how to read it as a record of samples.
struct MappedLog {
    std::string path;
    std::vector<MappedColumn> columns;
    double rate_hz = 0.0;
    double to_arcsec = 1.0;                     ///< unit of the angle; of rates to arcsec/s
    std::optional<std::string> time = {};       ///< column of the times of the samples, as in SeriesRequest
    std::optional<std::string> time_unit = {};  ///< likewise
    text::Options text = {};                    ///< likewise
    bool follow_links = false;                  ///< likewise
};

/// Quantities that a column can become: the kinds of samples, "rate" (integrated over each sample) and the witnesses.
std::vector<std::string> quantities_to_map();
/// Whether that quantity is a rate of rotation; its unit then is one of rates.
bool is_rate(const std::string& quantity);
/// Whether the quantity has a unit: a count or a witness has no unit.
bool has_unit(const std::string& quantity);

/// Reads the columns as a record; missing values in a column of floats are NaN. Throws InputError, naming file and
/// column, where none or two of them are samples, a quantity is unknown or stands twice, columns differ in length, or a
/// count is missing.
Record read_mapped(const MappedLog& log);

/// Sets a declared constant by its name in a record. Throws InputError where there is no such name.
void declare(Record& record, const std::string& name, double value);

}  // namespace ringlock::record
