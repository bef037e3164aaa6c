#pragma once
#include "analysis/closure/samples/residual/templates.hpp"

namespace ringlock::closure {

/// Corrects the p-values of residual tests for noise that is not normal, the error of the declared reader's counts: it
/// jumps, so that innovations are large where a count changes. Nothing is changed where the model has no such error.
///
/// Records are simulated by the fitted model, with counts that jump, and tested in the same way (a parametric
/// bootstrap: Davison and Hinkley, "Bootstrap Methods and their Application", 1997, section 4.2). Under the null
/// hypothesis -log(p) has the mean 1; where the simulated records give a larger one, p is raised to the power of its
/// inverse.
void correct_for_counts(const SampleFit& fit, double lattice_arcsec, SampleResidualTests& tests);

}  // namespace ringlock::closure
