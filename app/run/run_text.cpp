#include "app/run/run_text.hpp"

#include <fmt/format.h>

#include <cmath>

namespace ringlock::app {

std::string duration_text(double seconds) {
    if (!(seconds < 1e9)) return "years";
    if (seconds < 10.0) return fmt::format("{:.2g} s", seconds);
    const auto s = static_cast<std::int64_t>(std::llround(seconds));
    if (s < 60) return fmt::format("{} s", s);
    if (s < 3600) return fmt::format("{} min {:02} s", s / 60, s % 60);
    return fmt::format("{} h {:02} min", s / 3600, s % 3600 / 60);
}

std::string gyros_text(std::int64_t gyros) { return fmt::format("{} gyro{}", gyros, gyros == 1 ? "" : "s"); }

}  // namespace ringlock::app
