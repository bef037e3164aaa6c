#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/closure/turns/model/filter.hpp"

namespace ringlock::closure {

/// A stationary rate with an exponential autocorrelation, in optical phase.
struct PhaseRateTerm {
    double time_s;  ///< of correlation
    double variance_rad2_s2;
};

/// What is random in the phase at the turns of one gyro (docs/dev/closure-turns.md). With s = -1 at minima and 1 at
/// maxima
///
///     psi_n = a_n + before_n(psi_n) + s m_n + w_n,            z_n = psi_n + v_n,
///     a_{n+1} = a_n + kick_n(psi_n) + (rates over the interval),
///     m_{n+1} = exp(-forgets) m_n + ...:
///
/// w is the injected noise, v the readout's, m the wander of the dither's amplitude.
struct TurnNoise {
    double injected_rad2 = 0.0;     ///< variance of w
    double readout_rad2 = 0.0;      ///< variance of v
    double wander_rad2 = 0.0;       ///< variance that m gains from turn to turn
    double wander_forgets = 0.0;    ///< m is exp(-this) of itself a turn later: a resonator's amplitude; 0: a walk
    double white_rad2_per_s = 0.0;  ///< variance that white rate noise adds to a
    double walk_rad2_per_s3 = 0.0;  ///< variance a second of a rate that walks [(rad/s)^2/s]
    std::vector<PhaseRateTerm> rates;
};

/// The turns as the filter needs to know them.
struct TurnFrame {
    double interval_s = 0.0;           ///< mean time from turn to turn
    std::vector<double> sign;          ///< -1 at minima, 1 at maxima
    std::vector<double> before_slope;  ///< derivative of what the lock-in adds before the turn to its phase
    std::vector<double> kick_slope;    ///< of all that it adds at the turn
    std::vector<double> shape_left;    ///< what |1 - before'| leaves of injected noise that is not normal (NoiseShape);
                                       ///< none where it is
    std::vector<double> readout;       ///< variance of v over `readout_rad2`; none: 1 at all turns

    double readout_at(std::size_t turn) const { return readout.empty() ? 1.0 : readout[turn]; }
};

/// What the reading is thought to have added to each phase, and the variance of what it may have added beside, turn by
/// turn.
struct ReadingErrors {
    std::vector<double> mean_rad, variance_rad2;
};

/// The Kalman filter that turns phases into innovations, independent and of unit variance where the noise is as said.
///
/// Lock-in is computed from phases that were read, z; what the reading's error v makes of it is in the filter: it
/// enters the measurement as (1 - before') v and a as -kick' v (Jazwinski, "Stochastic Processes and Filtering Theory",
/// 1970, section 7.3: correlated noises).
class Whitening {
   public:
    Whitening(const TurnFrame& frame, const TurnNoise& noise);

    /// Minus the log-likelihood of the phases that leave this series, but for a constant: sum over the turns that count
    /// (1, not 0) of half the square of the innovation plus the logarithm of its standard deviation. As the innovation
    /// has before_n of the phase itself in it, the density of the phase has |1 - before'| beside that of the
    /// innovation. In one pass that keeps nothing.
    static double minus_log_likelihood(const TurnFrame& frame, const TurnNoise& noise, std::span<const double> series,
                                       std::span<const std::uint8_t> counts);

    /// The same under each of several noises with as many rates each, in much less time than one after the other.
    static std::vector<double> minus_log_likelihoods(const TurnFrame& frame, std::span<const TurnNoise> noises,
                                                     std::span<const double> series,
                                                     std::span<const std::uint8_t> counts);

    /// Innovations over their standard deviations. Linear in `series`: columns of a regression go the same way.
    std::vector<double> apply(std::span<const double> series) const;
    /// The same in place, of a part of a series that begins with the turn `first`; `state` is how the part before has
    /// left it.
    void apply(std::size_t first, std::span<double> part, FilterState& state) const;
    /// Innovations over their standard deviations and these [rad], of one series: without what whitens a second one.
    struct Innovations {
        std::vector<double> white, sd_rad;
    };
    static Innovations innovations(const TurnFrame& frame, const TurnNoise& noise, std::span<const double> series);
    /// What all phases that leave this series tell of the reading's errors (Durbin and Koopman, "Time Series Analysis
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
