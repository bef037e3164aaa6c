#pragma once
#include <string_view>

namespace ringlock {

/// Version of the library, e.g. "0.1.0".
std::string_view version();

/// Abbreviated commit the library was built from, with "-dirty" appended for a changed tree; "unknown" outside git.
std::string_view git_hash();

}  // namespace ringlock
