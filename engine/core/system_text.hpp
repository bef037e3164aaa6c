#pragma once
#include <string>
#include <system_error>

namespace ringlock {

/// The system's message for an errno value: "No space left on device".
inline std::string system_text(int error) { return std::generic_category().message(error); }

}  // namespace ringlock
