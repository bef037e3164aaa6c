#pragma once
#include <string_view>

namespace ringlock::app {

/// Writes to standard output, at once. Throws RunError where it cannot be written (a full disk, say): results that
/// nobody can read are no success.
void put(std::string_view text);

/// Writes to standard error what people may want to know. What nobody can read changes nothing about the run.
void tell(std::string_view text);

/// Opens standard streams that the caller has closed (on nothing), so that no file of ours gets their numbers and what
/// is told ends up in it.
void hold_standard_streams();

}  // namespace ringlock::app
