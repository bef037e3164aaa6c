#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/core/phase.hpp"
#include "engine/gyro/device.hpp"
#include "tests/support/propagator.hpp"

namespace ringlock::test {

/// The phase of one gyro under its noise-free dither at any time: from turn to turn by the exact map, from the nearest
/// turn to the time by the direct integrator. Time 0 is the first turn, a minimum of the phase.
///
/// A run of the program knows the phase at the turns only, which is where readings are taken. A counter that is read at
/// other times, by a clock that knows nothing of the dither, needs this.
class GyroPath {
   public:
    /// `tolerance_rad`: error of a half cycle.
    GyroPath(const gyro::Device& device, double tolerance_rad);

    /// Begins anew, with that phase at time 0.
    void restart(double initial_phase_rad);

    /// Time of a turn, turn 0 at time 0; even turns are minima.
    double turn_time_s(std::int64_t turn) const;
    /// The half cycle that begins at that turn.
    gyro::HalfCycle half_cycle_after(std::int64_t turn) const {
        return device_.half_cycle(turn % 2 == 0 ? 1.0 : -1.0, device_.dither_amplitude_rad);
    }
    /// psi at the dither's turn; `turn` >= 0.
    Phase at_turn(std::int64_t turn);
    /// psi at each of these times [s], 0 and later, in any order.
    std::vector<Phase> at(std::span<const double> times_s);
    /// What an up/down counter of quarter fringes gains in `intervals` consecutive intervals, the first of which begins
    /// at `first_s`.
    std::vector<std::int64_t> quarter_counts(double first_s, double interval_s, std::size_t intervals);

    const gyro::Device& device() const { return device_; }

   private:
    gyro::Device device_;
    double tolerance_rad_;
    std::unique_ptr<Propagator> propagator_;
    std::vector<Phase> turns_;
};

}  // namespace ringlock::test
