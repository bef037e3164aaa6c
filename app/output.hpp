#pragma once
#include <string_view>

namespace ringlock::app {

/// Writes to standard output, at once. Throws RunError where it cannot be written (a full disk, say): results that
/// nobody can read are no success.
void put(std::string_view text);

}  // namespace ringlock::app
