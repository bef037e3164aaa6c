#pragma once
#include <cstdint>
#include <string>

/// Whether a file can hold what it says of a dataset.
namespace ringlock::store {

/// How a dataset lies in its file.
struct Storage {
    double bytes = 0.0;      ///< of its values, unpacked
    bool is_written = true;  ///< false where it has room for values alone
    bool is_plain = false;   ///< one block of numbers in this file: reading only copies and converts
};

/// Checks an open dataset of HDF5, before its extent or its values are asked for.
///
/// Nothing is believed that the file alone claims: a contiguous dataset lies in the file as long as it is, and one in
/// chunks, which may be packed or never written, says at most as many bytes as the file has times the greatest ratio of
/// deflate (1032 by RFC 1951: 258 bytes from two bits). A trial gets as much more memory.
///
/// Throws InputError, naming file and dataset, where it says more values than that, was never written and is large, has
/// numbers of impossible size, or has its data in another file while links_in_force() refuses that.
Storage check_storage(std::int64_t dataset, const std::string& file, const std::string& name);

/// Of that the last alone, for a dataset that is only listed.
void check_files(std::int64_t dataset, const std::string& file, const std::string& name);

/// Whether an external link was met, and refused or found to lead nowhere, since the last call: why, in words.
std::string refused_link();

}  // namespace ringlock::store
