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

/// The dither's amplitude going up and down: what that adds to the phase at the turns, positive at maxima.
struct AmplitudeSwing {
    double hz, cosine_rad, sine_rad;

    bool operator==(const AmplitudeSwing&) const = default;
};

/// Everything that the phases of a turn record depend on.
struct TurnParameters {
    double bias_deg_h = 0.0;
    double threshold_deg_h = 0.0;
    double injected_sd_rad = 0.0;  ///< noise of the dither at the turns
    double wander_sd_rad = 0.0;    ///< what the dither's amplitude gains from turn to turn
    double wander_forgets = 0.0;   ///< interval over correlation time of that; 0: it walks
    double readout_sd_rad = 0.0;
    std::shared_ptr<const NoiseShape> shape = {};  ///< of the injected noise, where that is flatter than a normal one
    std::vector<AmplitudeSwing> swings;
    std::vector<ActiveEffect> effects;

    bool operator==(const TurnParameters&) const = default;
    ActiveEffect* find(std::string_view effect);
    const ActiveEffect* find(std::string_view effect) const;
    /// The same by the effect itself; null also for a null pointer, an effect that the library lacks.
    ActiveEffect* find(const effects::Effect* effect);
    const ActiveEffect* find(const effects::Effect* effect) const;
};

/// The phases that parameters foretell for the turns of a record, chance apart.
class TurnModel {
   public:
    /// Series and phases are kept by reference. What the lock-in adds is taken for linear in the phase about the one
    /// that was read, less what is known of the reading's errors; nothing but their scatter by the radii where not
    /// given.
    TurnModel(const TurnSeries& series, const std::vector<double>& phase_rad, ReadingErrors known = {});

    struct Prediction {
        std::vector<double> phase_rad;  ///< but for offset and dither
        TurnFrame frame;
        std::vector<double> turn_s;    ///< when the dither turned, from when the phase did
        std::vector<double> dither_s;  ///< the same by a resonator that drifts slowly
    };
    /// The half cycle of the dither that ends at that turn; the first is of no length.
    effects::Interval interval(const Prediction& prediction, std::size_t turn) const;
    Prediction predict(const TurnParameters& parameters) const;
    /// What a rate of its own adds to the predicted phases.
    std::vector<double> added_rad(const Prediction& prediction, const effects::Effect& effect,
                                  const effects::Values& values) const;
    TurnNoise noise(const TurnParameters& parameters) const;
    gyro::Setup setup(const TurnParameters& parameters) const;
    /// Kicks at the mean input rate.
    TurnKicks mean_kicks(const TurnParameters& parameters) const;

    /// Fringes a second by which the phase goes on from one turn of a kind to the next, in the mean over the record:
    /// the kicks' beat, but for multiples of the dither's frequency.
    double beat_hz() const;

    const TurnSeries& series() const { return series_; }
    const std::vector<double>& phase_rad() const { return phase_rad_; }

    /// Lets go of what is kept to be quick and is as long as the record. May be called while others predict.
    void forget() const;

   private:
    using Kicks = std::vector<TurnKicks::Kick>;
    using Shape = std::shared_ptr<const NoiseShape>;
    /// Kicks at the turns of a gyro of that setup, whose rate is that and the input's.
    std::shared_ptr<const Kicks> kicks(gyro::Setup setup, const Shape& shape) const;
    /// The same at any phase: without a value for each turn.
    std::shared_ptr<const KicksOverRange> kicks_over_input(const gyro::Setup& setup) const;
    /// What effects make of the coupling in a half cycle.
    struct Coupling {
        double threshold = 1.0;           ///< factor of the setup's threshold
        std::complex<double> turn = 1.0;  ///< exp(i phase) by which its phase moves

        bool operator==(const Coupling&) const = default;
    };
    /// The half cycles before and after each turn; none where the coupling stays what it is.
    struct Couplings {
        std::vector<Coupling> before, after;

        bool stay() const { return before.empty(); }
        Coupling before_turn(std::size_t turn) const { return stay() ? Coupling{} : before[turn]; }
        Coupling after_turn(std::size_t turn) const { return stay() ? Coupling{} : after[turn]; }
    };
    Couplings couplings(const TurnParameters& parameters) const;
    /// Kicks with such a rate at each turn, and such a coupling.
    Kicks kicks_at(const gyro::Setup& setup, const std::vector<double>& rate_deg_h, const Couplings& couplings,
                   const Shape& shape) const;
    Kicks kicks_at(const KicksOverRange& of, double setup_rate_deg_h, const std::vector<double>& rate_deg_h,
                   const Couplings& couplings, const Shape& shape) const;

    double temperature_change_k(std::size_t turn) const;
    /// What a gyro is exposed to at the turn, from a time on and for so long.
    effects::Interval exposure(std::size_t turn, double start_s, double duration_s) const;
    /// When the dither turned, from when the phase did, at these rates: the phase stands still where the dither's own
    /// rate and they, the lock-in's among them, add up to nothing.
    std::vector<double> dither_turns(const std::vector<double>& rate_deg_h, const Couplings& couplings,
                                     const std::vector<double>& swing, const gyro::Device& device) const;
    /// Those that effects add while the dither turns; none where no effect does.
    std::vector<double> added_rates_deg_h(const TurnParameters& parameters, const std::vector<double>& turn_s) const;
    /// Times of the dither's turns by a resonator that drifts slowly.
    std::vector<double> smooth(const std::vector<double>& turn_s) const;
    /// Swing of the dither after each turn over the mean one of its sign; with such rates at the turns beside the mean.
    std::vector<double> dither_swings(const Kicks& kicks, const std::vector<double>& rate_deg_h) const;

    const TurnSeries& series_;
    const std::vector<double>& phase_rad_;
    ReadingErrors known_;
    std::vector<std::complex<double>> turned_;  ///< exp(i phase)
    /// Gyros met lately, the latest first. Functions of the phase take long to find and little room; their values at
    /// all turns, which several predictions in a row ask for, are the other way round, so that few are kept.
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
