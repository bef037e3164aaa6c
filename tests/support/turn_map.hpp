#pragma once
#include <cstdint>

#include "engine/propagate/phase_tables.hpp"
#include "engine/propagate/turn_tables.hpp"
#include "tests/support/propagator.hpp"

namespace ringlock::test {

/// One half cycle of one gyro at a time by the tables and the kernel of a run: Moebius maps or, where the coupling has
/// a second harmonic, series in the phase.
class TurnMap final : public Propagator {
   public:
    /// Half cycles outside `ranges` are solved exactly one by one, slowly, never extrapolated.
    TurnMap(const gyro::Device& device, const propagate::HalfCycleRanges& ranges, double tolerance_rad);

    /// `half` must have the durations and the harmonic of the device.
    double lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) override;

    /// Half cycles solved outside the tables so far.
    std::int64_t outside() const { return outside_; }
    double measured_error_rad() const {
        return is_moebius() ? tables_.measured_error_rad(0) : phase_tables_.measured_error_rad(0);
    }
    std::size_t nodes() const { return is_moebius() ? tables_.nodes() : phase_tables_.nodes(); }

   private:
    bool is_moebius() const { return device_.coupling.second_ratio == 0.0; }

    gyro::Device device_;
    double tolerance_rad_;
    propagate::TurnTables tables_;
    propagate::PhaseTables phase_tables_;
    std::int64_t outside_ = 0;
};

}  // namespace ringlock::test
