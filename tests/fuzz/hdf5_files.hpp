#pragma once
#include <string>
#include <vector>

/// Small HDF5 files of many kinds.
namespace ringlock::fuzz {

struct Hdf5File {
    std::string bytes;
    bool is_result = false;                 ///< of ringlock run
    std::vector<std::string> columns = {};  ///< of a log; a record and a result have none
};

/// Logs of plain and packed datasets, of records, of enumerations, with links and attributes, in the old and in the new
/// layout of the library; records with turns and with samples; results with and without angle records and a design.
std::vector<Hdf5File> hdf5_files();

}  // namespace ringlock::fuzz
