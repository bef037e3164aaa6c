#pragma once
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/turns/fit/fitted.hpp"

/// The figures that are reported of a fit to turns.
namespace ringlock::closure {

/// Below this error the residual is the rounding of the many numbers that were added up, here and where the record was
/// made, and is not tested.
bool is_rounding(double heldout_error_rad);

/// One-step predictions of the turns that are held out.
struct HeldoutScore {
    double error_rad = 0.0;
    double log_score = 0.0;
    double floor_rad = 0.0;  ///< error that the fitted noise alone makes
};
HeldoutScore heldout(const TurnFit& fit);

/// Parameters of the base model and of the steps, from a fit to the whole record.
void take_figures(const record::Turns& turns, const Fitted& whole, Closure& closure);

/// The residual of a fit to the training rows, and its error on the rows that are held out.
void take_residual(const record::Turns& turns, const Fitted& fitted, Closure& closure);

/// Names the other frequencies at which a line would explain the record as well, which the lock-in's kicks turn into
/// it; empty where there is none.
std::string note_on_frequency(const TurnFit& without, const TurnFit& with, const effects::Effect& effect);

}  // namespace ringlock::closure
