#pragma once
#include <string>

namespace ringlock::record {

/// Holds the parts that a file of MATLAB 5 to 7 says it has against its size, before a library reads it: that one takes
/// zeros for what is cut off, and makes room for whatever a head claims. A packed variable may claim what its packed
/// bytes can unpack to, and no more. Throws InputError, naming the file.
void check_mat_elements(const std::string& path);

}  // namespace ringlock::record
