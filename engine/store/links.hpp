#pragma once
#include <cstdint>
#include <string>
#include <vector>

/// For the sources of this room: how a file leads to others.
namespace ringlock::store::detail {

/// Lets external links lead nowhere unless links_in_force() says so: without that the library opens any file that a
/// link names, of any owner, and waits for a FIFO.
void take_over_external_links();

/// Why the last external link was not followed, in words; empty where none was met since the last call.
std::string refused_link();

/// Files outside that hold the raw data of a dataset of these creation properties, and files that a virtual dataset is
/// made of.
std::vector<std::string> external_files(std::int64_t creation);
std::vector<std::string> virtual_files(std::int64_t creation);

/// Whether a file of that name lies in the folder of the file that holds the object.
bool is_readable_in_same_folder(std::int64_t object, const std::string& name);

}  // namespace ringlock::store::detail
