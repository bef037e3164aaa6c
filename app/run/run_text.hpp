#pragma once
#include <cstdint>
#include <string>

namespace ringlock::app {

/// "40 s", "3 min 20 s", "2 h 05 min": for sentences.
std::string duration_text(double seconds);

/// "1 gyro", "16 gyros".
std::string gyros_text(std::int64_t gyros);

}  // namespace ringlock::app
