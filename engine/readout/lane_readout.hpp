#pragma once
#include <span>
#include <vector>

#include "engine/gyro/device.hpp"
#include "engine/gyro/lane_drive.hpp"
#include "engine/random/normal_lanes.hpp"
#include "engine/readout/electronics.hpp"
#include "engine/readout/lane_readings.hpp"
#include "engine/readout/pulse_tables.hpp"
#include "engine/readout/readout_constants.hpp"

/// From the true phase to the readings of the electronics.
namespace ringlock::readout {

/// Content of readings in addition to the phase.
enum class Wanted {
    phase,
    accelerations,  ///< from two pulses on either side unless the electronics are ideal
    pulses,         ///< these, too, and the detectors sampled at the instant that the pulses determine; every property
                    ///< of the electronics
};

/// Readout of a block of gyros.
///
/// The dither turns at its own zero-rate point; the phase turns where input rate and lock-in are added, a little before
/// or after. From the dither's turn the phase's is found by Taylor series of the equation of motion, in as many steps
/// as it takes; pulses next to it come from PulseTables.
class LaneReadout {
   public:
    /// \param devices     of each gyro, at most simd::lanes; with b = 0 for a gyro without lock-in
    /// \param ellipses    errors of each gyro's detectors; not used by ideal electronics
    /// \param wanted      content of the readings
    /// \param phases_vary whether drives say that the coupling's phase varies
    LaneReadout(std::span<const gyro::Device> devices, std::span<const gyro::Ellipse> ellipses,
                const Electronics& electronics, Wanted wanted, bool phases_vary = false);

    /// From now on readings hold the times of the zero-rate points and the counter, too. Not where only the phase is
    /// wanted.
    void keep_times() { times_ = true; }
    /// From now on angles hold the true phase and the true times of the zero-rate points, too.
    void keep_truth() { truth_ = true; }

    /// Reads every `stride`-th turn of the piece, from the first; rows of turns in between are left as they are. With
    /// pulses, every turn is read. Throws RunError where the phase does not reverse near a turn.
    void read(const gyro::LaneDrive& drive, const gyro::LaneTurns& turns, const ElectronicNoise& noise,
              std::size_t stride, LaneReadings& readings, LaneAngles& angles) const;

   private:
    std::size_t lanes_;
    Electronics electronics_;
    Wanted wanted_;
    bool times_ = false;
    bool truth_ = false;
    ReadoutConstants constants_;
    std::vector<PulseTables> pulses_;  // at one phase of the coupling, or where that varies at PulseTables::phases
};

}  // namespace ringlock::readout
