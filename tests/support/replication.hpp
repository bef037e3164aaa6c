#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/gyro/setup.hpp"
#include "tests/support/gyro_path.hpp"

/// Table 1 of Gao and Deng (2007) against what the equation of motion does: the figures of docs/replication.md.
namespace ringlock::test::replication {

/// What is cited of the paper's Table 1; nothing else of it is used.
inline constexpr std::array<double, 6> applied_deg_h = {-2.14, -1.10, 1.12, 4.17, 4.80, 4.22};
inline constexpr double reading_interval_s = 8e-3;
inline constexpr double reading_step_deg_h = 15.625;
inline constexpr double worst_error_after_deg_h = 2.489;
inline constexpr double column_4_over_input = 1.0062;

/// The paper's device at an input rate.
gyro::Setup paper_device(double rate_deg_h);

/// One dither cycle, from where to where.
enum class Span {
    minimum_to_minimum,  ///< half of a minimum, a maximum, half of a minimum
    maximum_to_maximum,
    minimum_and_maximum,  ///< two whole turns, from the middle of a half cycle on; the minimum first
    maximum_and_minimum,
};
inline constexpr std::array spans = {Span::minimum_to_minimum, Span::maximum_to_maximum, Span::minimum_and_maximum,
                                     Span::maximum_and_minimum};

/// Rate of the kick of one whole turn, over a cycle, to first order [deg/h]: kappa K/(2 pi T).
double turn_kick_deg_h(const gyro::Setup& setup);

/// Largest correction over all phases that the corrected first-order formula can apply over one cycle [deg/h]; for any
/// depth of modulation at most twice turn_kick_deg_h(). `shift_rad` is added to the depth of modulation.
double largest_correction_deg_h(const gyro::Setup& setup, Span span, double shift_rad = 0.0);

/// The corrected first-order formula over one cycle [deg/h] where the phase at the first extremum is `phase_rad`.
double first_order_correction_deg_h(const gyro::Setup& setup, Span span, double phase_rad, double shift_rad = 0.0);

/// One cycle of the exact motion.
struct Cycle {
    double lockin_deg_h = 0.0;     ///< what the lock-in adds to the rate
    double corrected_deg_h = 0.0;  ///< what the first-order formula takes away; the printed one takes twice that
};

/// With a clock, the phase accelerations are those of two pulses timed in its ticks; without, those of the drive.
Cycle exact_cycle(GyroPath& path, Span span, double clock_hz = 0.0);

/// psi at the extremum near a turn of the dither, within a fringe.
double extremum_phase_rad(GyroPath& path, std::int64_t turn);

/// A half of a turn by integration, fitted over `phases` phases of the extremum:
/// lock-in = constant + sine sin(psi_0) + cosine cos(psi_0) + harmonics of 2 psi_0, the coefficients of the first in
/// units of b sqrt(pi/psi'').
struct HalfTurnFit {
    double constant_rad = 0.0;
    double sine = 0.0;
    double cosine = 0.0;
    double second_cosine_rad = 0.0;  ///< of cos(2 psi_0)
    double second_sine_rad = 0.0;
};
HalfTurnFit fit_half_turn(bool minimum, bool after, int phases);

/// The lock-in term averaged over a dither cycle without input, in units of b T J_0(M): how much of it goes with the
/// sine of the mean phase and how much with its cosine.
struct AveragedCycle {
    double plain_sine = 0.0;  ///< of sin(psi - M cos(w t)): no lock-in in psi itself
    double plain_cosine = 0.0;
    double exact_sine = 0.0;  ///< of the exact motion from minimum to minimum
    double exact_cosine = 0.0;
};
AveragedCycle averaged_cycle(int phases);

/// The second harmonic of half a turn, counted from the extremum, after a minimum and before a maximum: the coefficient
/// of cos(2 psi_0) [rad]. The other halves have the opposite.
double half_turn_second_harmonic_rad(const gyro::Setup& setup);

/// Density of sin a + sin b, a and b uniform and independent: K(sqrt(1 - u^2/4))/pi^2, K the complete elliptic integral
/// of the first kind.
double turn_pair_density(double u);

/// Corrections over a cycle, in kicks of one whole turn, where the phases of the turns are uniform and independent.
class CorrectionDensity {
   public:
    enum class Turns {
        two_whole,       ///< sin a + sin b
        half_whole_half  ///< (sin a)/2 + sin b + (sin c)/2
    };
    explicit CorrectionDensity(Turns turns);

    double operator()(double u) const;
    /// Probability of a size beyond `u`.
    double beyond(double u) const;
    static constexpr int cells = 8000;  ///< between -2 and 2
    /// Mean of the density over a cell.
    double cell(int i) const { return cells_[static_cast<std::size_t>(i)]; }

   private:
    Turns turns_;
    std::vector<double> cells_;
};

/// Log likelihood of corrections, each of a cycle of random phases, with `factor` times the right coefficients (2: as
/// printed) and normal errors of `error_deg_h`; `kick_deg_h` is turn_kick_deg_h(). Minus infinity where it cannot be.
double log_likelihood(const CorrectionDensity& density, std::span<const double> corrections_deg_h, double factor,
                      double kick_deg_h, double error_deg_h = 0.0);

/// The factor to which corrections point, if it is all that is not known.
struct FactorEstimate {
    double smallest = 0.0;  ///< below it they cannot be
    double likeliest = 0.0;
    double upper_95 = 0.0;  ///< of the posterior with a density of 1/factor beforehand
    double median = 0.0;
};
FactorEstimate estimate_factor(const CorrectionDensity& density, std::span<const double> corrections_deg_h,
                               double kick_deg_h);

/// Readings of a counter of quarter fringes.
struct ReadingStatistics {
    double mean_deg_h = 0.0;  ///< of the error: reading less input
    double rms_deg_h = 0.0;
    double lowest_deg_h = 0.0;
    double highest_deg_h = 0.0;
};
ReadingStatistics statistics(std::span<const double> errors_deg_h);

}  // namespace ringlock::test::replication
