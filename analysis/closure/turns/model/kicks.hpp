#pragma once
#include <array>
#include <complex>
#include <cstddef>
#include <vector>

#include "engine/gyro/setup.hpp"

namespace ringlock::closure {

/// The phases that the lock-in adds on either side of a turn, as functions of the phase at its zero-rate point:
///
///     psi_{n+1} - psi_n = (drive and input between the dither's turns) + after_n(psi_n) + before_{n+1}(psi_{n+1}).
///
/// Exact for a dither of the setup's amplitude: from the equation of motion with coupling and dither of the setup
/// (docs/dev/closure-turns.md). Both are proportional to one over the root of the phase's acceleration, by which they
/// are scaled to amplitudes nearby.
class TurnKicks {
   public:
    /// No kicks, as of a gyro without lock-in.
    TurnKicks() = default;
    /// Throws RunError if half cycles of the setup have too few fringes.
    explicit TurnKicks(const gyro::Setup& setup);

    struct Kick {
        double before_rad, after_rad;
        double before_slope, after_slope;          ///< first derivatives by the phase
        double before_curvature, after_curvature;  ///< second derivatives by the phase
        double before_weighted;                    ///< before, with each harmonic replaced by its weight; else 0

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
    /// One weight for each exp(i k phase), k = 1, 2, ...
    using Weights = std::array<std::complex<double>, harmonics>;
    /// \param direction  +1 at a minimum, -1 at a maximum
    Kick at(int direction, double phase_rad) const { return at(direction, std::polar(1.0, phase_rad)); }
    /// The same with exp(i phase) given.
    Kick at(int direction, std::complex<double> turned, const Weights* weights = nullptr) const;
    /// The phase that follows from the phase `plain_rad` without the lock-in before the turn, by Newton's method. It is
    /// unique, since parameters with several solutions are refused.
    double phase_after(int direction, double plain_rad) const;

   private:
    friend class KicksOverRange;
    using Series = std::array<std::complex<double>, harmonics + 1>;  ///< value = Re sum_k c_k exp(i k psi)
    using Sides = std::array<Series, 2>;                             ///< before, after

    void add(double weight, const TurnKicks& other);
    void count_terms();
    /// Rate of the phase at the dither's turn.
    double turn_rate_rad_s(int direction, std::complex<double> turned) const;
    Kick at(int direction, std::complex<double> turned, bool late, const Weights* weights) const;

    std::array<std::array<Sides, 2>, 2> series_{};  ///< [minimum, maximum][zero rate before the dither's turn, after]
    /// Fourier series of the rate at the dither's turn, likewise
    std::array<std::array<std::complex<double>, 3>, 2> turn_rate_{};
    bool kinked_ = false;    ///< the series before and after the dither's turn differ
    std::size_t terms_ = 0;  ///< number of harmonics that are not negligible
};

/// Kicks of a gyro whose input rate and threshold change: exact at a few rates and thresholds, and interpolated by
/// polynomials between them.
class KicksOverRange {
   public:
    struct Range {
        double lowest, highest;
    };
    /// \param threshold  range of the factor to the setup's threshold
    KicksOverRange(const gyro::Setup& setup, Range rate_deg_h, Range threshold = {1.0, 1.0});
    /// Kicks at this rate in place of the setup's, and at the setup's threshold times `threshold`.
    TurnKicks::Kick at(int direction, std::complex<double> turned, double rate_deg_h, double threshold = 1.0,
                       const TurnKicks::Weights* weights = nullptr) const;

   private:
    /// Maps a range to [-1, 1].
    struct Scale {
        explicit Scale(Range range)
            : middle(0.5 * (range.lowest + range.highest)), reach(0.5 * (range.highest - range.lowest)) {}
        double of(double value) const { return reach == 0.0 ? 0.0 : (value - middle) / reach; }
        double middle, reach;
    };
    Scale rate_deg_h_, threshold_;
    /// Coefficients [power of the threshold][power of the rate], both scaled
    std::vector<std::vector<TurnKicks>> by_power_;
};

}  // namespace ringlock::closure
