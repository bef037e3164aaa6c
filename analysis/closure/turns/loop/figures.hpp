#pragma once
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/turns/fit/fitted.hpp"

/// The reported figures of a fit to turns.
namespace ringlock::closure {

/// Whether the residual is only the rounding of the many numbers that were added up, here and in the program that made
/// the record. Such a residual is not tested.
bool is_rounding(double heldout_error_rad);

/// One-step predictions of the held-out turns.
struct HeldoutScore {
    double error_rad = 0.0;
    double log_score = 0.0;
    double floor_rad = 0.0;  ///< error that the fitted noise alone causes
};
HeldoutScore heldout(const TurnFit& fit);

/// Parameters of the base model and of the steps, from a fit to the whole record.
void take_figures(const record::Turns& turns, const Fitted& whole, Closure& closure);

/// The residual of a fit to the training rows, and its error on the held-out rows.
void take_residual(const record::Turns& turns, const Fitted& fitted, Closure& closure);

/// A note on the other frequencies at which a line would explain the record equally well, by the beat with the
/// lock-in's kicks; empty if there are none.
std::string note_on_frequency(const TurnFit& without, const TurnFit& with, const effects::Effect& effect);

}  // namespace ringlock::closure
