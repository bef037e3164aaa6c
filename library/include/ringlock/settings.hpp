#pragma once
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace ringlock {
inline namespace v1 {

/// Value of a key of a scenario. Whole numbers are accepted for keys that are real numbers.
using Value = std::variant<bool, std::int64_t, double, std::string, std::vector<double>, std::vector<std::string>>;

/// A key of a scenario, as docs/scenario.md lists them, and the value that replaces the one in force.
struct Setting {
    std::string key;  ///< "gyro.lockin_threshold_deg_h"; "device" for a device of the library
    Value value;
};
using Settings = std::vector<Setting>;

/// Progress of a simulation.
struct Progress {
    std::string stage;           ///< what is being done, in a few words
    std::int64_t gyros = 0;      ///< finished
    std::int64_t all_gyros = 0;  ///< of all points; at most, where a stopping rule decides
    std::int64_t turns = 0;      ///< finished zero-rate points
    std::int64_t all_turns = 0;  ///< likewise
    double wall_s = 0.0;         ///< since the start
};

}  // namespace v1
}  // namespace ringlock
