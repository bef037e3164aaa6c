#pragma once
#include <cstdint>

#include "engine/propagate/propagator.hpp"
#include "engine/propagate/turn_tables.hpp"

namespace ringlock::propagate {

/// The production propagator for one half cycle of one gyro at a time: tables and kernel are those of a run.
class TurnMap final : public Propagator {
   public:
    /// Half cycles outside `ranges` are solved exactly one by one, slowly, never extrapolated.
    TurnMap(const gyro::Device& device, const HalfCycleRanges& ranges, double tolerance_rad);

    /// `half` must have the durations and the harmonic of the device.
    double lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) override;

    /// Half cycles solved outside the tables so far.
    std::int64_t outside() const { return outside_; }
    double measured_error_rad() const { return tables_.measured_error_rad(0); }
    std::size_t nodes() const { return tables_.nodes(); }

   private:
    gyro::Device device_;
    double tolerance_rad_;
    TurnTables tables_;
    std::int64_t outside_ = 0;
};

}  // namespace ringlock::propagate
