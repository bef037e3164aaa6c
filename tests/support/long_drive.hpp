#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "engine/gyro/setup.hpp"

namespace ringlock::test {

/// How far the tables of the turn map lead a gyro astray in a long run.
struct DriveDifference {
    double final_rad = 0.0;    ///< phase by the tables less phase by exact half cycles, after the last turn
    double largest_rad = 0.0;  ///< largest size on the way
};

struct LongDrive {
    std::int64_t turns = 20000;
    double noise_rms_rad = 4.0;  ///< injected noise, in optical phase
    double table_tolerance_rad = 1e-10;
    std::uint64_t seed = 2007;
};

/// Sends every gyro through the same noisy drive twice: by step_turns with tables, and with each half cycle solved by
/// itself from the equation of motion, without tables and by other formulas. Blocks of gyros run in parallel; the
/// result does not depend on how. About 6 us a gyro and turn.
std::vector<DriveDifference> drive_differences(std::span<const gyro::Setup> setups, const LongDrive& wanted);

/// Gyros as a production run has them: the device of Gao and Deng with thresholds within 20 %, amplitudes within 1 %,
/// asymmetries within 0.5 % and any coupling phase.
std::vector<gyro::Setup> long_drive_setups(std::size_t gyros, double rate_deg_h, std::uint64_t seed);

}  // namespace ringlock::test
