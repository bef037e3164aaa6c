#pragma once
#include <cstdint>
#include <span>
#include <string>

#include "engine/store/hdf5.hpp"

namespace ringlock::store {

/// Where a result comes from: all that may differ between two runs of one scenario and seed.
struct Provenance {
    std::string program_version;
    std::string git_hash;
    std::string compiler;
    std::string hdf5_version;
    std::string command_line;   ///< quoted so that a shell would take it
    std::string scenario_file;  ///< as named on the command line
    std::string host;
    std::string date_utc;  ///< start of the run, ISO 8601, e.g. 2024-02-29T12:00:00Z
    std::int64_t threads = 0;
    double wall_s = 0.0;          ///< duration of the run, known at its end
    double turns_per_s = 0.0;     ///< turns that the result counts over that
    std::string instruction_set;  ///< of the vector code
};

/// Provenance of a run that starts now. `arguments` begin with the program's name.
Provenance collect_provenance(std::span<const char* const> arguments, std::int64_t threads, std::string scenario_file);

/// Writes the group /provenance, one attribute for each member.
void write_provenance(Group& root, const Provenance& provenance);

/// Reads it back. Throws InputError where the group or a member is missing; turns_per_s and instruction_set, which
/// earlier programs did not write, are then 0 and empty.
Provenance read_provenance(const Group& root);

}  // namespace ringlock::store
