#pragma once
#include <functional>
#include <string>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/residual/tests.hpp"

/// Residual tests of samples, by their subject; view_samples() collects them.
namespace ringlock::closure {

using Columns = std::vector<std::vector<double>>;
using Views = std::vector<SampleView>;

/// Series of rates as the record contains them.
Columns taken_by(const SampleFit& fit, const Columns& columns);

/// Rates with a free place or time constant, which is searched.
struct Places {
    std::size_t count;
    std::function<Columns(std::size_t place)> columns;
    std::function<std::string(std::size_t place)> said;
    int courses = 0;  ///< trends in time that the test contains
};
/// The test at the place where a regression on its columns explains most; each column and the place are parameters.
void test_places(const SampleFit& fit, Where where, const std::string& view, const Places& of, Views& views);

/// Size of the residual: over the record, by place modulo small numbers, its repetition; its distribution.
void view_sizes(const SampleFit& fit, double lattice_arcsec, Views& views);
/// Rates: trends in time; steps; two levels; jumps next to a random rate.
void view_rates(const SampleFit& fit, Views& views);
/// Rates that follow another column of the record: temperature, input rate, accelerations; immediately or with a lag.
void view_followed(const SampleFit& fit, Views& views);

}  // namespace ringlock::closure
