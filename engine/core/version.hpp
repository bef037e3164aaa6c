#pragma once
#include <string_view>

namespace ringlock {

/// Program version, e.g. "0.1.0".
std::string_view version();

/// Abbreviated commit the program was built from, with "-dirty" appended for a changed tree; "unknown" outside git.
std::string_view git_hash();

/// Day of that commit, "2026-01-31"; empty outside git.
std::string_view commit_date();

}  // namespace ringlock
