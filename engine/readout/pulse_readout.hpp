#pragma once
#include "engine/gyro/lane_drive.hpp"
#include "engine/readout/electronics.hpp"
#include "engine/readout/lane_readings.hpp"
#include "engine/readout/pulse_tables.hpp"
#include "engine/readout/readout_constants.hpp"

namespace ringlock::readout {

/// Readout by the signals of the hardware: comparators that switch where their noisy inputs pass the hysteresis, a
/// counter that follows them, pulses on a clock, detectors that are sampled half-way between the last pulse before and
/// the first after the turn and converted.
///
/// A comparator that switches at phase theta on the way to the extremum switches back at the same quarter fringe on the
/// way from it. With a first-order low-pass of time constant T everything is late by T, which has no effect on the
/// readings, and the extremum is blunted by psi'' T^2/2, which is taken into account (terms in T^3 are not). Noise acts
/// at each crossing by itself: pulses are tens of correlation times apart.
///
/// `tables`: one, or PulseTables::phases of them where the coupling's phase varies. False where the phase does not
/// reverse near a turn of the dither in some lane.
bool read_pulse_by_pulse(const ReadoutConstants& constants, std::span<const PulseTables> tables,
                         const Electronics& electronics, std::size_t lanes, const gyro::LaneDrive& drive,
                         const gyro::LaneTurns& turns, const ElectronicNoise& noise, LaneReadings& readings,
                         LaneAngles& angles);

/// Time constant of the low-pass [s].
double low_pass_s(const Electronics& electronics);
/// Nearest pulses that are closer to the extremum than this are not distinguished [rad].
double least_distance_rad(const Electronics& electronics);

}  // namespace ringlock::readout
