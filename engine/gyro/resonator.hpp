#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

/// The dithered body as a mechanical resonator with a noisy drive.
///
/// The dither angle x obeys
///
///     x'' + (w/Q) x' + w^2 x = (F_0 + e(t)) sin(w t),
///
/// w the undamped natural frequency and that of the drive. Without noise x = -A cos(w t) with A = Q F_0/w^2, and the
/// turns are where the force is zero, the nominal turns. A force F is given here as its stationary amplitude, Q F/w^2,
/// in any unit.
///
/// The contribution of the noise is linear in e. Upright, that is with the sign of the turn taken out, its angle u and
/// its velocity over w, q, at nominal turns obey exact linear recursions.
namespace ringlock::gyro {

enum class NoiseForm { held, white, sinusoidal };
enum class NoiseDistribution { gaussian, uniform, binary };

/// Noise on the amplitude of the drive's force.
struct DriveNoise {
    double frequency_hz = 400.0;
    double resonator_q = 100.0;
    NoiseForm form = NoiseForm::held;
    NoiseDistribution distribution = NoiseDistribution::gaussian;
    std::int64_t hold_half_cycles = 1;  ///< of `held`: number of half cycles for which a level is kept
    double modulation_hz = 0.0;         ///< of `sinusoidal`
    /// Where the gain of the amplitude loop's open loop is one; 0: there is no loop.
    double amplitude_loop_hz = 0.0;
};

/// Levels of the force within a half cycle that `white` draws independently.
inline constexpr int white_levels = 32;

/// The linear recursion from a nominal turn to the next, and its stationary moments.
class Resonator {
   public:
    explicit Resonator(const DriveNoise& noise);

    /// Deviation (u, q) at a nominal turn, of the case where the force has no noise over the half cycle to the next.
    const Eigen::Matrix2d& step() const { return step_; }
    /// Contribution of a constant force over the half cycle to (u, q).
    const Eigen::Vector2d& held_input() const { return held_input_; }
    /// Contributions of the levels within a half cycle.
    const std::array<Eigen::Vector2d, white_levels>& white_inputs() const { return white_inputs_; }
    /// Share of the amplitude's deviation at a turn by which the loop lowers the force from the next nominal turn on.
    double loop_gain() const { return loop_gain_; }
    /// Damping over natural frequency: 1/(2 Q).
    double damping() const { return damping_; }
    /// `sinusoidal`: amplitude of u with a force sin(2 pi modulation_hz t) of amplitude 1, and by how much its phase
    /// lags [rad]; the same for q. The loop's share is not among it.
    struct Response {
        double u, u_lag_rad, q, q_lag_rad;
    };
    const Response& response() const { return response_; }

    /// Largest modulus of the recursion's eigenvalues: the factor by which a deviation decreases in a half cycle. With
    /// a loop that is too fast it is 1 or more, and nothing is stationary.
    double decay() const { return decay_; }
    /// Half cycles after which 1e-9 is left of a deviation, loop included; 0 where no chance is in it.
    double settling_half_cycles() const;
    /// E[u_n u_{n+lag}] for lags 0...`lags`, levels of rms 1, over all phases of the hold and of the modulation.
    std::vector<double> autocovariance(int lags) const;
    /// Rms of u at the turns, for levels of rms 1.
    double rms() const { return rms_; }
    /// Rms change of u from a turn to the next, and to the next but one, for u of rms 1.
    double change_per_half_cycle() const { return change_[0]; }
    double change_per_cycle() const { return change_[1]; }

   private:
    Eigen::Matrix4d advance() const;

    DriveNoise noise_;
    double damping_;
    double loop_gain_ = 0.0;
    double decay_ = 1.0;
    double rms_ = 0.0;
    std::array<double, 2> change_{};
    Eigen::Matrix2d step_;
    Eigen::Vector2d held_input_;
    std::array<Eigen::Vector2d, white_levels> white_inputs_;
    Response response_{};
    double looped_ = 0.0;  ///< amplitude of u with the loop's share
};

}  // namespace ringlock::gyro
