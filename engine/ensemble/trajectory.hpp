#pragma once
#include <memory>

#include "engine/gyro/setup.hpp"
#include "engine/propagate/propagator.hpp"
#include "engine/random/stream.hpp"
#include "engine/readout/readout.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::ensemble {

/// One physical trajectory, turn after turn, with its readings.
///
/// Rates that vary in time, noise included, enter as phase steps in the middle of each half cycle; the stripping of the
/// dither is exact and refers each angle to the nominal time of its turn.
class Trajectory {
   public:
    enum class Kind { ideal, plain, noise_injected };

    Trajectory(const scenario::Scenario& scenario, const gyro::Setup& setup, random::Identity who, Kind kind);
    Trajectory(Trajectory&&) noexcept;
    Trajectory& operator=(Trajectory&&) noexcept;
    ~Trajectory();

    /// Reads the current turn.
    readout::ReadTurn read();
    /// Angle [arcsec] that the reading gives: rotation of the case, noise-like rates, lock-in error and readout error.
    double angle_arcsec(const readout::ReadTurn& turn) const;
    /// Lock-in error [rad] at the zero-rate point last read.
    double lockin_error_rad() const;
    /// Goes through the half cycle to the next turn.
    void advance();

    const propagate::Propagator* propagator() const;

   private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace ringlock::ensemble
