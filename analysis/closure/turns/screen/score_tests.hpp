#pragma once
#include <memory>
#include <vector>

#include "analysis/closure/turns/fit/fitted.hpp"

namespace ringlock::closure {

/// An effect tested against the residual of a fit: the first estimate of its parameters and the gain that they predict.
struct Candidate {
    const effects::Effect* effect = nullptr;
    effects::Values values;
    double chi2 = 0.0;                    ///< twice the gain of the log-likelihood under the fitted noise
    double p_value = 1.0;                 ///< by chance, with the search over times and frequencies included
    double look_elsewhere = 1.0;          ///< look-elsewhere factor of the search
    effects::Values sd = {};              ///< standard errors, if the first estimate is also the last
    std::shared_ptr<Fitted> fitted = {};  ///< the model with it, after a full fit; then p_value is of that fit
    /// Evidence of the full fit: gain of the log-likelihood with amplitudes integrated out, less the search.
    double evidence = 0.0;
};

/// The score test of one effect that is not in the fit, whose prediction is `without`. None if the effect does not act
/// on phases at the turns or is not determined by this record. Throws RunError if no motion of a gyro with a small size
/// of the effect can be followed.
std::optional<Candidate> score_test(const TurnFit& fit, const TurnModel::Prediction& without,
                                    const effects::Effect& effect);

/// Score tests of the effects of the library that act on phases at the turns, are determined by this record and are not
/// in the fit yet (Rao 1948; Engle 1984, "Wald, likelihood ratio and Lagrange multiplier tests").
std::vector<Candidate> screen(const TurnFit& fit);

/// Other frequencies [Hz] at which a line would explain as much of the residual of the fit without it, to within
/// `chi2_apart`: those that the beat of the lock-in's kicks with the rotation transforms into each other.
/// \param effect  must have a frequency
std::vector<double> frequencies_as_likely(const TurnFit& fit, const effects::Effect& effect, double hz,
                                          double chi2_apart);

}  // namespace ringlock::closure
