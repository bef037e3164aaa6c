#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "engine/compensate/compensator.hpp"
#include "engine/effects/effect.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/propagate/propagator.hpp"
#include "engine/readout/readout.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::ensemble {

/// One gyro through all arms of a study.
struct GyroRecord {
    gyro::Setup setup;
    /// [arm][sample]: angle output of the gyro with the dither stripped [arcsec], sampled as Schedule says.
    std::vector<std::vector<double>> angle_arcsec;
    std::int64_t turns = 0;            ///< zero-rate points of the trajectories simulated, without that of `ideal`
    std::int64_t turns_off_table = 0;  ///< half cycles that the turn map solved outside its tables
    double turn_map_error_rad = 0.0;   ///< largest interpolation error measured when the tables were made; 0: no tables
};

/// What a simulation tells while it runs, and asks; both may be empty, and are called from any thread.
struct Monitor {
    std::function<bool()> cancelled;  ///< true stops the simulation with Interrupted
    std::function<void(std::int64_t)>
        on_turns;  ///< so many turns more are done, of those that GyroRecord::turns counts
};

/// Turns that the whole ensemble will count.
std::int64_t expected_turns(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms);

/// Simulates gyro g of the scenario. The result depends on the scenario, its seed and g alone.
/// Throws RunError where the trajectory cannot be finished, Interrupted when cancelled.
GyroRecord simulate_gyro(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t gyro,
                         const Monitor& monitor);

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
