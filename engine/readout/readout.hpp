#pragma once
#include <optional>

#include "engine/core/phase.hpp"
#include "engine/gyro/device.hpp"
#include "engine/random/stream.hpp"
#include "engine/readout/lane_readout.hpp"
#include "engine/readout/reading.hpp"
#include "engine/readout/turn_path.hpp"

/// From the true phase to what the electronics report.
namespace ringlock::readout {

/// A reading and, for scoring only, how far the phase read is from the true one.
struct ReadTurn {
    Reading reading;
    double phase_error_rad = 0.0;  ///< phase read - true phase at the zero-rate point
};

class Readout {
   public:
    Readout(const Electronics& electronics, const gyro::Ellipse& ellipse, random::Identity who);

    /// Reads the zero-rate point on `path`, that of turn number `turn`. `phase` is psi at the dither's turn, at
    /// `turn_time_s`; the phase at which the path was made must be its remainder. Turns may be left out: each has its
    /// own noise.
    ReadTurn read(const TurnPath& path, const Phase& phase, std::int64_t turn, double turn_time_s, int direction);

   private:
    double acceleration(const TurnPath& path, int side, int direction, double measured_rad, double turn_time_s) const;
    double tick(double turn_time_s, double offset_s) const;

    Electronics electronics_;
    gyro::Ellipse ellipse_;
    std::optional<random::NormalStream> noise_;
};

/// The unwrapped phase [rad] of a reading: the quadrature's phase on the branch nearest to the middle of the quarter
/// fringe that the counter names, relative to the start of that fringe's count: value - fringes * 2 pi.
Phase joined_phase(const Reading& reading);

}  // namespace ringlock::readout
