#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/closure/turns/model/filter.hpp"

namespace ringlock::closure {

/// A stationary rate with an exponential autocorrelation, in optical phase.
struct PhaseRateTerm {
    double time_s;  ///< correlation time
    double variance_rad2_s2;
};

/// The random parts of the phase at the turns of one gyro (docs/dev/closure-turns.md). With s = -1 at minima and 1 at
/// maxima
///
///     psi_n = a_n + before_n(psi_n) + s m_n + w_n,            z_n = psi_n + v_n,
///     a_{n+1} = a_n + kick_n(psi_n) + (rates over the interval),
///     m_{n+1} = exp(-forgets) m_n + ...:
///
/// w is the injected noise, v the readout's, m the wander of the dither's amplitude.
struct TurnNoise {
    double injected_rad2 = 0.0;  ///< variance of w
    double readout_rad2 = 0.0;   ///< variance of v
    double wander_rad2 = 0.0;    ///< variance that is added to m from turn to turn
    /// The state m decays by exp(-this) from turn to turn, as the amplitude of a resonator; 0: a random walk.
    double wander_forgets = 0.0;
    double white_rad2_per_s = 0.0;  ///< variance that white rate noise adds to a
    double walk_rad2_per_s3 = 0.0;  ///< variance a second that is added to the rate of a random walk [(rad/s)^2/s]
    std::vector<PhaseRateTerm> rates;
};

/// Properties of the turns that the filter needs.
struct TurnFrame {
    double interval_s = 0.0;           ///< mean time from turn to turn
    std::vector<double> sign;          ///< -1 at minima, 1 at maxima
    std::vector<double> before_slope;  ///< derivative of the phase that the lock-in adds before the turn
    std::vector<double> kick_slope;    ///< the same of the phase that it adds on both sides of the turn
    /// Residual score that |1 - before'| leaves of injected noise that is not normal (NoiseShape); empty for normal
    /// noise.
    std::vector<double> shape_left;
    std::vector<double> readout;  ///< variance of v over `readout_rad2`; empty: 1 at all turns

    double readout_at(std::size_t turn) const { return readout.empty() ? 1.0 : readout[turn]; }
};

/// Estimate of the reading's error in each phase, and its variance.
struct ReadingErrors {
    std::vector<double> mean_rad, variance_rad2;
};

/// The Kalman filter that transforms phases to innovations, which are independent and of unit variance if the noise is
/// correct.
///
/// The lock-in is computed from the phases that were read, z. The filter includes the contribution of the reading's
/// error v: it enters the measurement as (1 - before') v and a as -kick' v (Jazwinski, "Stochastic Processes and
/// Filtering Theory", 1970, section 7.3: correlated noises).
class Whitening {
   public:
    Whitening(const TurnFrame& frame, const TurnNoise& noise);

    /// Minus the log-likelihood of the residual phases `series`, except for a constant: the sum over the turns that
    /// count (1, not 0) of half the square of the innovation plus the logarithm of its standard deviation. Since the
    /// innovation contains before_n of the phase itself, the density of the phase is that of the innovation times |1 -
    /// before'|. One pass, which stores nothing.
    static double minus_log_likelihood(const TurnFrame& frame, const TurnNoise& noise, std::span<const double> series,
                                       std::span<const std::uint8_t> counts);

    /// The same under each of several noises with equal numbers of rates, much faster than one after the other.
    static std::vector<double> minus_log_likelihoods(const TurnFrame& frame, std::span<const TurnNoise> noises,
                                                     std::span<const double> series,
                                                     std::span<const std::uint8_t> counts);

    /// Innovations over their standard deviations. Linear in `series`: columns of a regression are whitened in the same
    /// way.
    std::vector<double> apply(std::span<const double> series) const;
    /// The same in place for a part of a series that begins with the turn `first`; `state` is that after the part
    /// before.
    void apply(std::size_t first, std::span<double> part, FilterState& state) const;
    /// Innovations over their standard deviations, and these [rad], of one series, without storing the gains.
    struct Innovations {
        std::vector<double> white, sd_rad;
    };
    static Innovations innovations(const TurnFrame& frame, const TurnNoise& noise, std::span<const double> series);
    /// Estimate of the reading's errors given all residual phases `series` (Durbin and Koopman, "Time Series Analysis
    /// by State Space Methods", 2nd ed. 2012, section 4.5).
    ReadingErrors reading_errors(std::span<const double> series) const;
    /// Standard deviation of each innovation [rad].
    const std::vector<double>& sd_rad() const { return sd_; }

   private:
    const TurnFrame& frame_;
    FilterNoises noises_;
    std::vector<double> gains_;  // [turn][state]
    std::vector<double> sd_;
};

}  // namespace ringlock::closure
