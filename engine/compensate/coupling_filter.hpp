#pragma once
#include "engine/readout/fraction_recovery.hpp"

namespace ringlock::compensate {

/// Size and phase of one gyro's coupling from the bends of its pulses, by a Kalman filter: the size drifts, with a
/// slope that changes slowly; the phase depends on the mirrors and is nearly constant. The memory of the filter follows
/// from the information on the coupling in the turns: at the instrument's defaults some minutes for the size and hours
/// for the phase (docs/dev/compensation.md).
///
/// A mode hop may step the phase, which a filter with that memory would follow only slowly. The filter begins anew
/// where a mean over `short_memory_turns` contradicts it by more than six sigmas. While both agree, such a mean wanders
/// about the truth like exp(-|t|/memory) and passes z sigmas of either sign (2/memory) z/sqrt(2 pi) exp(-z^2/2) times a
/// second: six sigmas of 262 s once in a hundred years.
class CouplingFilter {
   public:
    using Coupling = readout::FractionRecovery::Coupling;
    using Bends = readout::FractionRecovery::Bends;

    /// \param start initial value; it has no influence once the bends determine the coupling better
    explicit CouplingFilter(const Coupling& start, double contradiction_sigmas = six_sigmas)
        : sigmas_(contradiction_sigmas), b_rad_s_(start.b_rad_s), phase_rad_(start.phase_rad) {}

    /// Takes the normal equations of `turns` turns over `duration_s` for the coupling of the tables. False where they
    /// contain too little information to begin with: further turns must be added first.
    bool observe(const Bends& bends, const Coupling& tables, double turns, double duration_s);

    Coupling coupling() const { return {b_rad_s_, phase_rad_}; }
    /// Times that the phase was begun anew.
    int restarts() const { return restarts_; }

    /// Allowed drift of a threshold from the beginning, 10 % an hour, and random walk of this drift: 2 % an hour in an
    /// hour.
    static constexpr double slope_rms_s = 0.1 / 3600.0;
    static constexpr double slope_walk_s_rt_s = 0.02 / 3600.0 / 60.0;
    /// 2.5e-5 rad in an hour.
    static constexpr double phase_walk_rad_rt_s = 2.5e-5 / 60.0;
    static constexpr double short_memory_turns = 65536.0;
    static constexpr double six_sigmas = 6.0;

   private:
    bool begin(const Bends& bends, const Coupling& tables);
    void predict(double duration_s);
    void correct(const Bends& bends, const Coupling& tables, double turns);
    void begin_anew_where_contradicted();

    double sigmas_;
    double b_rad_s_, phase_rad_;
    double slope_s_ = 0.0;                             ///< of the logarithm of b
    double ll_ = 0.0, ls_ = 0.0, ss_ = 0.0;            ///< covariances of the logarithm, its slope ...
    double le_ = 0.0, se_ = 0.0, ee_ = 0.0;            ///< ... and the phase
    double noise_ = 1.0;                               ///< variance of the bends over that by the electronics' noise
    double corrections_ = 0.0;                         ///< that it was seen in
    double pull_ = 0.0, weight_ = 0.0, square_ = 0.0;  ///< short memory: of the phase off the estimate
    bool size_begun_ = false;
    bool phase_begun_ = false;
    int restarts_ = 0;
};

}  // namespace ringlock::compensate
