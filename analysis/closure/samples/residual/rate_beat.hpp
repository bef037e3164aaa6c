#pragma once
#include <optional>
#include <string>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// Lines that a gyro makes whose lock-in no noise randomises: the phase at its turns goes on evenly under a steady
/// rate, and so do the kicks.
///
/// Under a rate Omega the phase at the turns advances by 2 pi (Omega/K - n f_D) a second, n the nearest whole number of
/// fringes a dither cycle. The lock-in then adds a rate of that frequency, of the amplitude Omega_L abs(J_n(A)), A =
/// 2 pi Omega_D/(K w_D) the amplitude of the phase: the average of the equation of motion over a dither cycle
/// (docs/physics.md, "Without noise: bands, a staircase, no random walk"). As A is not declared to a radian, Omega_L
/// sqrt(2/(pi A)) bounds it.
struct RateBeat {
    double hz = 0.0;          ///< of the fundamental, by the mean rate of the record
    double rate_deg_h = 0.0;  ///< amplitude that the residual shows of it
    double most_deg_h = 0.0;  ///< what the declared device can make; 0: its constants are not declared
    double p_value = 1.0;     ///< of the strongest of its first multiples, by chance
};

/// Looks for it in the innovations of a model. The phase is that of the record's own angle, so that a rate that varies
/// moves it as it moves the turns. None where no scale factor or no dither is declared, or where it does not show.
std::optional<RateBeat> find_rate_beat(const SampleFit& fit, const record::Declared& declared);

/// Whether a step may be no effect but what the beat makes. Its multiples, those of the dither and their sums are lines
/// that fill the band: a source of another clock, or a line, is distinguished from them only where it is larger.
bool may_be_of_beat(const Step& step, const RateBeat& beat);

/// A sentence that names it.
std::string text_of(const RateBeat& beat);

}  // namespace ringlock::closure
