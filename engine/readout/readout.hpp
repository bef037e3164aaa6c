#pragma once
#include <optional>

#include "engine/core/phase.hpp"
#include "engine/gyro/device.hpp"
#include "engine/random/stream.hpp"
#include "engine/readout/reading.hpp"
#include "engine/readout/turn_path.hpp"

/// From the true phase to what the electronics report.
namespace ringlock::readout {

/// Properties of the electronics.
struct Electronics {
    bool ideal = false;                    ///< exact phase, time and acceleration at every zero-rate point
    bool interpolate = true;               ///< angle from count and quadrature; otherwise whole quarter fringes
    double clock_hz = 0.0;                 ///< times are whole ticks; 0: continuous
    double detector_noise_relative = 0.0;  ///< rms of each detector sample over the fringe amplitude
    gyro::Ellipse ellipse;
};

/// A reading and, for scoring only, how far the phase read is from the true one.
struct ReadTurn {
    Reading reading;
    double phase_error_rad = 0.0;  ///< phase read - true phase at the zero-rate point
};

class Readout {
   public:
    Readout(const Electronics& electronics, random::Identity who);

    /// Reads the zero-rate point on `path`, that of turn number `turn`. `phase` is psi at the dither's turn, at
    /// `turn_time_s`; the phase at which the path was made must be its remainder. Turns may be left out: each has its
    /// own noise.
    ReadTurn read(const TurnPath& path, const Phase& phase, std::int64_t turn, double turn_time_s, int direction);

   private:
    double acceleration(const TurnPath& path, int side, int direction, double measured_rad, double turn_time_s) const;
    double tick(double turn_time_s, double offset_s) const;

    Electronics electronics_;
    std::optional<random::NormalStream> noise_;
};

/// The unwrapped phase [rad] of a reading: the quadrature's phase on the branch nearest to the middle of the quarter
/// fringe that the counter names, relative to the start of that fringe's count: value - fringes * 2 pi.
Phase joined_phase(const Reading& reading);

}  // namespace ringlock::readout
