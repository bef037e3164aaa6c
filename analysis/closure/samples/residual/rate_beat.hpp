#pragma once
#include <optional>
#include <string>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// Lines of a gyro whose lock-in is not randomised by noise: under a steady rate the phase at the turns advances
/// evenly, and the kicks with it.
///
/// Under a rate Omega the phase at the turns advances by 2 pi (Omega/K - n f_D) a second, n the nearest whole number of
/// fringes in a dither cycle. The lock-in then adds a rate of that frequency, with the amplitude Omega_L abs(J_n(A)),
/// where A = 2 pi Omega_D/(K w_D) is the amplitude of the phase: the average of the equation of motion over a dither
/// cycle (docs/physics.md, "Without noise: bands, a staircase, no random walk"). A is not declared to a radian, so that
/// the bound Omega_L sqrt(2/(pi A)) is used.
struct RateBeat {
    double hz = 0.0;          ///< of the fundamental, from the mean rate of the record
    double rate_deg_h = 0.0;  ///< amplitude of the fundamental in the residual
    double most_deg_h = 0.0;  ///< largest amplitude of the declared device; 0: its constants are not declared
    double p_value = 1.0;     ///< of the strongest of its first multiples, by chance
};

/// Searches for these lines in the innovations of a model. The phase is that of the record's own angle, so that a
/// varying rate moves it as it moves the turns. No value where no scale factor or no dither is declared, or where no
/// line is significant.
std::optional<RateBeat> find_rate_beat(const SampleFit& fit, const record::Declared& declared);

/// Whether a step may be a part of the beat and no effect. Multiples of the beat and of the dither and their sums are
/// lines that fill the band: a source of another clock, or a line, is distinguished from them only where it is larger.
bool may_be_of_beat(const Step& step, const RateBeat& beat);

/// Sentence that reports the beat.
std::string text_of(const RateBeat& beat);

}  // namespace ringlock::closure
