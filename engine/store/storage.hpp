#pragma once
#include <cstdint>
#include <string>

/// Checks that a file can hold the data that it claims for a dataset.
namespace ringlock::store {

/// How a dataset lies in its file.
struct Storage {
    double bytes = 0.0;      ///< of its values, unpacked
    bool is_written = true;  ///< false where it has room for values alone
    bool is_plain = false;   ///< one block of numbers in this file: reading only copies and converts
};

/// Checks an open dataset of HDF5, before its extent or its values are read.
///
/// Claims of the file are not trusted: a contiguous dataset must lie in the file with its whole length, and one in
/// chunks, which may be packed or never written, may claim at most as many bytes as the file has times the greatest
/// ratio of deflate (1032 by RFC 1951: 258 bytes from two bits). A trial gets as much more memory.
///
/// Throws InputError, naming file and dataset, where the dataset claims more values than that, was never written and is
/// large, has numbers of impossible size, or has its data in another file while links_in_force() refuses that.
Storage check_storage(std::int64_t dataset, const std::string& file, const std::string& name);

/// Only the last of these checks, for a dataset that is listed but not read.
void check_files(std::int64_t dataset, const std::string& file, const std::string& name);

/// Whether an external link was met, and refused or found to lead nowhere, since the last call: why, in words.
std::string refused_link();

}  // namespace ringlock::store
