#pragma once
#include <functional>
#include <string>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/residual/tests.hpp"

/// The views of a residual of samples, by what they look at: view_samples() puts them together.
namespace ringlock::closure {

using Columns = std::vector<std::vector<double>>;
using Views = std::vector<SampleView>;

/// Rates as the record has them.
Columns taken_by(const SampleFit& fit, const Columns& columns);

/// Rates of which one is looked for at so many places.
struct Places {
    std::size_t count;
    std::function<Columns(std::size_t place)> columns;
    std::function<std::string(std::size_t place)> said;
    int courses = 0;  ///< of the view
};
/// The view of the place where a regression on its columns explains most, each column and the place a parameter.
void test_places(const SampleFit& fit, Where where, const std::string& view, const Places& of, Views& views);

/// Its size: over the record, at places modulo small numbers, as it repeats; its distribution.
void view_sizes(const SampleFit& fit, double lattice_arcsec, Views& views);
/// Rates: with time; steps; two levels; jumps of a rate that wanders.
void view_rates(const SampleFit& fit, Views& views);
/// Rates that follow another column of the record: temperature, input rate, accelerations; at once or late.
void view_followed(const SampleFit& fit, Views& views);

}  // namespace ringlock::closure
