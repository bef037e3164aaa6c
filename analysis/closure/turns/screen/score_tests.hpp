#pragma once
#include <memory>
#include <vector>

#include "analysis/closure/turns/fit/fitted.hpp"

namespace ringlock::closure {

/// An effect held against what a fit has left: the first estimate of its parameters and how much they would explain.
struct Candidate {
    const effects::Effect* effect = nullptr;
    effects::Values values;
    double chi2 = 0.0;                    ///< twice the gain of the log-likelihood, noise as it is
    double p_value = 1.0;                 ///< of so much by chance, with the search over times and frequencies counted
    double searched = 1.0;                ///< independent places that the search went over
    effects::Values sd = {};              ///< standard errors, where the first estimate is the last
    std::shared_ptr<Fitted> fitted = {};  ///< the model with it, once fitted in full; then p_value is of that fit
    double merit = 0.0;  ///< of the full fit: gain of the log-likelihood, amplitudes integrated out, less its search
};

/// The score test of one effect that is not in the fit, which predicts `without`; none where the effect does not act on
/// phases at the turns or cannot be told on this record. Throws RunError where no motion of a gyro with a little of it
/// can be followed.
std::optional<Candidate> score_test(const TurnFit& fit, const TurnModel::Prediction& without,
                                    const effects::Effect& effect);

/// The effects of the library that act on phases at the turns, can be told on this record and are not in the fit yet,
/// by score tests (Rao 1948; Engle 1984, "Wald, likelihood ratio and Lagrange multiplier tests").
std::vector<Candidate> screen(const TurnFit& fit);

/// Other frequencies at which that line [Hz] would explain as much of what the fit, without it, has left, to within so
/// much of chi-squared: those that the beat of the lock-in's kicks with the rotation turns into it.
/// `effect` has a frequency.
std::vector<double> frequencies_as_likely(const TurnFit& fit, const effects::Effect& effect, double hz,
                                          double chi2_apart);

}  // namespace ringlock::closure
