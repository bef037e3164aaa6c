#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "engine/propagate/half_turn.hpp"
#include "engine/propagate/propagator.hpp"

namespace ringlock::propagate {

/// Half turns of one sign of half cycle as polynomials in the amplitude.
class HalfTurnTable {
   public:
    HalfTurnTable() = default;
    /// Fits polynomials over amplitudes [lowest, highest] [rad] with as many Chebyshev nodes as hold the interpolation
    /// error of shift and z, measured between the nodes, below `tolerance_rad`. `half` gives duration and rate and has
    /// sign +1.
    HalfTurnTable(const gyro::HalfCycle& half, double b_rad_s, double lowest_rad, double highest_rad,
                  double tolerance_rad);

    bool covers(double amplitude_rad) const { return amplitude_rad >= lowest_rad_ && amplitude_rad <= highest_rad_; }
    HalfTurn at(double amplitude_rad) const;
    /// Largest difference from the exact map found at points between the nodes [rad].
    double measured_error_rad() const { return measured_error_rad_; }
    std::size_t nodes() const { return coefficients_.size(); }

   private:
    void fit(const gyro::HalfCycle& half, double b_rad_s, std::size_t nodes);
    double lowest_rad_ = 0.0;
    double highest_rad_ = -1.0;
    double measured_error_rad_ = 0.0;
    std::vector<std::array<double, 3>> coefficients_;  // of Chebyshev polynomials; shift, Re z, Im z
};

/// The production propagator: the flow over a half cycle is one Moebius map of the unit circle, exact for any phase,
/// made of the half turn at its beginning and, by time reversal, the same half turn at its end.
class TurnMap final : public Propagator {
   public:
    /// Amplitudes that a drive will ask for.
    struct Range {
        double lowest_rad;
        double highest_rad;
    };

    /// `positive` and `negative` give duration, sign and rate of the half cycles of either sign. Amplitudes outside the
    /// range and rates other than theirs are solved exactly one by one, slowly, never extrapolated.
    TurnMap(gyro::Coupling coupling, const gyro::HalfCycle& positive, const gyro::HalfCycle& negative, Range range,
            double tolerance_rad);

    double lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half, double mid_step_rad) override;

    /// Half cycles solved outside the tables so far.
    std::int64_t outside() const { return outside_; }
    double measured_error_rad() const;
    std::size_t nodes() const;

   private:
    struct Side {
        double duration_s;
        double rate_rad_s;
        HalfTurnTable table;
    };

    double without_dither_rad(double phase_rad, const gyro::HalfCycle& half, double mid_step_rad) const;
    /// A step of the phase psi in the middle, seen from the fast frame: what it adds to the frame's phase beyond
    /// itself.
    double step_in_frame_rad(const gyro::HalfCycle& half, double gained_rad, double step_rad) const;

    gyro::Coupling coupling_;
    Side positive_;
    Side negative_;
    std::int64_t outside_ = 0;
};

}  // namespace ringlock::propagate
