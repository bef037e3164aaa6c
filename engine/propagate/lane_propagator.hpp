#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/gyro/device.hpp"
#include "engine/gyro/lane_drive.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "engine/propagate/phase_kernel.hpp"
#include "engine/propagate/phase_tables.hpp"
#include "engine/propagate/turn_kernel.hpp"
#include "engine/propagate/turn_tables.hpp"

namespace ringlock::propagate {

/// Takes a block of gyros through a run, piece after piece. The results of a gyro do not depend on the other gyros.
class LanePropagator {
   public:
    virtual ~LanePropagator() = default;
    /// Goes through the turns of `drive`, which follow those of the call before, and fills `turns`.
    /// Throws RunError where a half cycle cannot be solved to the required tolerance.
    virtual void step(const gyro::LaneDrive& drive, gyro::LaneTurns& turns) = 0;
    /// Largest error of a turn of that gyro's tables, measured between their nodes [rad]; 0 without tables.
    virtual double table_error_rad(std::size_t lane) const = 0;
    /// Times that a gyro's tables were made anew because the drive left their ranges.
    virtual std::int64_t tables_remade(std::size_t lane) const = 0;
    /// Times that tables of any gyro were made, the first ones included.
    virtual std::int64_t tables_made() const = 0;
};

/// How half cycles of a coupling are tabulated and gone through.
struct MoebiusTurns {
    using Tables = TurnTables;
    using State = TurnState;
    /// The half cycle under way between two pieces is evaluated by the later piece's tables, not kept in the state.
    static constexpr bool evaluates_first_half_cycle = false;
    static constexpr auto step = step_turns;
};
struct TabulatedTurns {
    using Tables = PhaseTables;
    using State = PhaseState;
    static constexpr bool evaluates_first_half_cycle = true;
    static constexpr auto step = step_phases;
};

/// How far amplitudes can go, which tables must hold [rad].
struct AmplitudeRoom {
    double margin_rad = 0.0;  ///< of the amplitude at a turn, from the device's
    double change_rad = 0.0;  ///< over a half cycle
};

/// The production propagator: the turn map. Tables are made over the ranges that the first piece needs, with room to
/// spare, and anew where a later piece leaves them.
template <class Turns>
class TurnMapLanes final : public LanePropagator {
   public:
    /// `room`: how far injected noise takes the amplitude of a half cycle from the device's, and changes it over one.
    /// `tolerance_rad`: interpolation error of a turn.
    TurnMapLanes(std::span<const gyro::Device> devices, const AmplitudeRoom& room, double tolerance_rad);

    void step(const gyro::LaneDrive& drive, gyro::LaneTurns& turns) override;
    double table_error_rad(std::size_t lane) const override { return tables_.measured_error_rad(lane); }
    std::int64_t tables_remade(std::size_t lane) const override { return remade_[lane]; }
    std::int64_t tables_made() const override { return tables_.made(); }

   private:
    void cover(const gyro::LaneDrive& drive);

    std::vector<gyro::Device> devices_;
    AmplitudeRoom room_;
    typename Turns::Tables tables_;
    typename Turns::State state_;
    std::array<std::int64_t, simd::lanes> remade_{};
    bool begun_ = false;
};

/// The exact Moebius map, or, where the coupling of one of the gyros has a second harmonic, the tabulated one.
std::unique_ptr<LanePropagator> make_turn_map(std::span<const gyro::Device> devices, const AmplitudeRoom& room,
                                              double tolerance_rad);

/// The reference: every fringe integrated.
class DirectPropagator final : public LanePropagator {
   public:
    /// `tolerance_rad`: error of a half cycle.
    DirectPropagator(std::span<const gyro::Device> devices, double tolerance_rad) : direct_(devices, tolerance_rad) {}

    void step(const gyro::LaneDrive& drive, gyro::LaneTurns& turns) override { direct_.step(drive, &turns); }
    double table_error_rad(std::size_t /*lane*/) const override { return 0.0; }
    std::int64_t tables_remade(std::size_t /*lane*/) const override { return 0; }
    std::int64_t tables_made() const override { return 0; }

   private:
    DirectLanes direct_;
};

}  // namespace ringlock::propagate
