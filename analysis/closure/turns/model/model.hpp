#pragma once
#include <Eigen/Dense>
#include <complex>
#include <deque>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/turns/model/effect_roles.hpp"
#include "analysis/closure/turns/model/kicks.hpp"
#include "analysis/closure/turns/model/noise_shape.hpp"
#include "analysis/closure/turns/model/series.hpp"
#include "analysis/closure/turns/model/whitening.hpp"
#include "analysis/closure/types.hpp"
#include "engine/effects/effect.hpp"
#include "engine/gyro/device.hpp"

namespace ringlock::closure {

/// An oscillation of the dither's amplitude: the phase that it adds at the turns, positive at maxima.
struct AmplitudeSwing {
    double hz, cosine_rad, sine_rad;

    bool operator==(const AmplitudeSwing&) const = default;
};

/// Everything that the phases of a turn record depend on.
struct TurnParameters {
    double bias_deg_h = 0.0;
    double threshold_deg_h = 0.0;
    double injected_sd_rad = 0.0;  ///< noise of the dither at the turns
    double wander_sd_rad = 0.0;    ///< random change of the dither's amplitude from turn to turn
    double wander_forgets = 0.0;   ///< interval over correlation time of that wander; 0: a random walk
    double readout_sd_rad = 0.0;
    /// Density of the injected noise, where that is flatter than a normal one
    std::shared_ptr<const NoiseShape> shape = {};
    std::vector<AmplitudeSwing> swings;
    std::vector<ActiveEffect> effects;

    bool operator==(const TurnParameters&) const = default;
    ActiveEffect* find(std::string_view effect);
    const ActiveEffect* find(std::string_view effect) const;
    /// The same by the effect itself; also null for a null pointer, which means that the library lacks the effect.
    ActiveEffect* find(const effects::Effect* effect);
    const ActiveEffect* find(const effects::Effect* effect) const;
};

/// The phases that parameters predict for the turns of a record, without the random parts.
class TurnModel {
   public:
    /// References to series and phases are kept. The kicks are linear in the phase about the phase that was read less
    /// the known mean of the reading's error. If `known` is empty, the mean is zero and the variance is that of the
    /// radii.
    TurnModel(const TurnSeries& series, const std::vector<double>& phase_rad, ReadingErrors known = {});

    struct Prediction {
        std::vector<double> phase_rad;  ///< without offset and dither
        TurnFrame frame;
        std::vector<double> turn_s;    ///< times of the dither's turns, from the times of the phase's turns
        std::vector<double> dither_s;  ///< the same for a resonator that drifts slowly
    };
    /// The half cycle of the dither that ends at that turn; for the first turn it has no length.
    effects::Interval interval(const Prediction& prediction, std::size_t turn) const;
    Prediction predict(const TurnParameters& parameters) const;
    /// Phases that the angle added by an effect contributes to the prediction.
    std::vector<double> added_rad(const Prediction& prediction, const effects::Effect& effect,
                                  const effects::Values& values) const;
    TurnNoise noise(const TurnParameters& parameters) const;
    gyro::Setup setup(const TurnParameters& parameters) const;
    /// Kicks at the mean input rate.
    TurnKicks mean_kicks(const TurnParameters& parameters) const;

    /// Fringes a second by which the phase advances from one turn of a kind to the next, averaged over the record: the
    /// beat of the kicks, modulo the dither's frequency.
    double beat_hz() const;

    const TurnSeries& series() const { return series_; }
    const std::vector<double>& phase_rad() const { return phase_rad_; }

    /// Releases caches of the length of the record. May be called while other threads predict.
    void forget() const;

   private:
    using Kicks = std::vector<TurnKicks::Kick>;
    using Shape = std::shared_ptr<const NoiseShape>;
    /// Kicks at the turns of a gyro of that setup, whose rate is the setup's plus the input's.
    std::shared_ptr<const Kicks> kicks(gyro::Setup setup, const Shape& shape) const;
    /// The same as functions of the phase, without a value for each turn.
    std::shared_ptr<const KicksOverRange> kicks_over_input(const gyro::Setup& setup) const;
    /// Changes of the coupling by effects in a half cycle.
    struct Coupling {
        double threshold = 1.0;           ///< factor of the setup's threshold
        std::complex<double> turn = 1.0;  ///< exp(i phase), phase the change of the coupling's phase

        bool operator==(const Coupling&) const = default;
    };
    /// Changes in the half cycles before and after each turn; empty if the coupling is constant.
    struct Couplings {
        std::vector<Coupling> before, after;

        bool stay() const { return before.empty(); }
        Coupling before_turn(std::size_t turn) const { return stay() ? Coupling{} : before[turn]; }
        Coupling after_turn(std::size_t turn) const { return stay() ? Coupling{} : after[turn]; }
    };
    Couplings couplings(const TurnParameters& parameters) const;
    /// Kicks with this rate and this coupling at each turn.
    Kicks kicks_at(const gyro::Setup& setup, const std::vector<double>& rate_deg_h, const Couplings& couplings,
                   const Shape& shape) const;
    Kicks kicks_at(const KicksOverRange& of, double setup_rate_deg_h, const std::vector<double>& rate_deg_h,
                   const Couplings& couplings, const Shape& shape) const;

    double temperature_change_k(std::size_t turn) const;
    /// Conditions of the gyro at the turn, from `start_s` on for `duration_s`.
    effects::Interval exposure(std::size_t turn, double start_s, double duration_s) const;
    /// Times of the dither's turns from those of the phase at these rates: the phase stands still where the dither's
    /// rate cancels them and the rate of the lock-in.
    std::vector<double> dither_turns(const std::vector<double>& rate_deg_h, const Couplings& couplings,
                                     const std::vector<double>& swing, const gyro::Device& device) const;
    /// Rates that effects add at the dither's turns; empty if no effect adds a rate.
    std::vector<double> added_rates_deg_h(const TurnParameters& parameters, const std::vector<double>& turn_s) const;
    /// Times of the dither's turns by a resonator that drifts slowly.
    std::vector<double> smooth(const std::vector<double>& turn_s) const;
    /// Swing of the dither after each turn over the mean swing of its sign; with these rates at the turns in addition
    /// to the mean rate.
    std::vector<double> dither_swings(const Kicks& kicks, const std::vector<double>& rate_deg_h) const;

    const TurnSeries& series_;
    const std::vector<double>& phase_rad_;
    ReadingErrors known_;
    std::vector<std::complex<double>> turned_;  ///< exp(i phase)
    /// Recently computed gyros, the latest first. Functions of the phase take long to compute and little memory. Their
    /// values at all turns are quick to compute but long, and several successive predictions need them, so few are
    /// kept.
    struct MetGyro {
        gyro::Setup setup;
        std::shared_ptr<const KicksOverRange> kicks;
    };
    struct MetKicks {
        gyro::Setup setup;
        Shape shape;
        std::shared_ptr<const Kicks> kicks;
    };
    mutable std::deque<MetGyro> gyros_met_;
    mutable std::deque<MetKicks> kicks_met_;
    mutable std::mutex meeting_;
};

}  // namespace ringlock::closure
