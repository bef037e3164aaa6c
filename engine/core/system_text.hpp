#pragma once
#include <string>
#include <system_error>

namespace ringlock {

/// What the system calls an errno value: "No space left on device".
inline std::string system_text(int error) { return std::generic_category().message(error); }

}  // namespace ringlock
