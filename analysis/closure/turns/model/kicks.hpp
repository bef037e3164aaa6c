#pragma once
#include <array>
#include <complex>
#include <cstddef>
#include <vector>

#include "engine/gyro/setup.hpp"

namespace ringlock::closure {

/// What the lock-in adds to the phase on either side of a turn, as functions of the phase at its zero-rate point:
///
///     psi_{n+1} - psi_n = (drive and input between the dither's turns) + after_n(psi_n) + before_{n+1}(psi_{n+1}).
///
/// Exact for a dither of the setup's amplitude: from the equation of motion, with all that the setup knows of coupling
/// and dither (docs/dev/closure-turns.md). Half turns go with one over the root of the phase's acceleration, which
/// carries them to amplitudes nearby.
class TurnKicks {
   public:
    /// None, as of a gyro without lock-in.
    TurnKicks() = default;
    /// Throws RunError where half cycles of the setup have too few fringes.
    explicit TurnKicks(const gyro::Setup& setup);

    struct Kick {
        double before_rad, after_rad;
        double before_slope, after_slope;          ///< derivatives to the phase
        double before_curvature, after_curvature;  ///< second ones
        double before_weighted;                    ///< before, each harmonic by a weight in place of itself; else 0

        Kick plus(double times, const Kick& other) const {
            return {before_rad + times * other.before_rad,
                    after_rad + times * other.after_rad,
                    before_slope + times * other.before_slope,
                    after_slope + times * other.after_slope,
                    before_curvature + times * other.before_curvature,
                    after_curvature + times * other.after_curvature,
                    before_weighted + times * other.before_weighted};
        }
    };
    static constexpr std::size_t harmonics = 12;
    /// One for each exp(i k phase), k = 1, 2, ..
    using Weights = std::array<std::complex<double>, harmonics>;
    /// `direction`: +1 at a minimum, -1 at a maximum.
    Kick at(int direction, double phase_rad) const { return at(direction, std::polar(1.0, phase_rad)); }
    /// The same from exp(i phase).
    Kick at(int direction, std::complex<double> turned, const Weights* weights = nullptr) const;
    /// The phase that comes of `plain_rad` by what the lock-in adds before the turn, by Newton's method; lock-in so
    /// strong that there are several has been turned away.
    double phase_after(int direction, double plain_rad) const;

   private:
    friend class KicksOverRange;
    using Series = std::array<std::complex<double>, harmonics + 1>;  ///< value = Re sum_k c_k exp(i k psi)
    using Sides = std::array<Series, 2>;                             ///< before, after

    void add(double weight, const TurnKicks& other);
    void count_terms();
    /// Of the phase, where the dither turns.
    double turn_rate_rad_s(int direction, std::complex<double> turned) const;
    Kick at(int direction, std::complex<double> turned, bool late, const Weights* weights) const;

    std::array<std::array<Sides, 2>, 2> series_{};  ///< [minimum, maximum][zero rate before the dither's turn, after]
    std::array<std::array<std::complex<double>, 3>, 2> turn_rate_{};  ///< Fourier series, likewise
    bool kinked_ = false;                                             ///< the two differ
    std::size_t terms_ = 0;                                           ///< harmonics that matter
};

/// Kicks of a gyro whose input rate and threshold change: between a few rates and thresholds that are exact, by
/// polynomials through them.
class KicksOverRange {
   public:
    struct Range {
        double lowest, highest;
    };
    /// `threshold`: by what factor it differs from the setup's.
    KicksOverRange(const gyro::Setup& setup, Range rate_deg_h, Range threshold = {1.0, 1.0});
    /// At this rate, in place of the setup's, and the setup's threshold times this.
    TurnKicks::Kick at(int direction, std::complex<double> turned, double rate_deg_h, double threshold = 1.0,
                       const TurnKicks::Weights* weights = nullptr) const;

   private:
    /// Onto [-1, 1].
    struct Scale {
        explicit Scale(Range range)
            : middle(0.5 * (range.lowest + range.highest)), reach(0.5 * (range.highest - range.lowest)) {}
        double of(double value) const { return reach == 0.0 ? 0.0 : (value - middle) / reach; }
        double middle, reach;
    };
    Scale rate_deg_h_, threshold_;
    std::vector<std::vector<TurnKicks>> by_power_;  ///< [of the threshold][of the rate], both scaled
};

}  // namespace ringlock::closure
