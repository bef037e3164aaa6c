#pragma once
#include <vector>

#include "analysis/closure/independence.hpp"
#include "analysis/closure/sample_fit.hpp"

/// The views of a residual of samples, by what they look at: view_samples() puts them together.
namespace ringlock::closure {

using Views = std::vector<View>;
using Columns = std::vector<std::vector<double>>;

inline std::vector<Regressor> regressors(const Columns& columns) { return {columns.begin(), columns.end()}; }

/// Its size: over the record, at places modulo small numbers, as it repeats; its distribution.
void view_sizes(const SampleFit& fit, double lattice_arcsec, Views& views);
/// Rates: with temperature, input rate and time; steps; two levels; jumps of a rate that wanders.
void view_rates(const SampleFit& fit, Views& views);

}  // namespace ringlock::closure
