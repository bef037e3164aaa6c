#pragma once
#include <functional>
#include <string>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/residual/tests.hpp"

/// Residual tests of samples, by their subject; test_residual() collects them.
namespace ringlock::closure {

using Columns = std::vector<std::vector<double>>;
using SampleResidualTests = std::vector<SampleResidualTest>;

/// Series of rates as the record contains them.
Columns taken_by(const SampleFit& fit, const Columns& columns);

/// Rates with a free place or time constant, which is searched.
struct Templates {
    std::size_t count;
    std::function<Columns(std::size_t place)> columns;
    std::function<std::string(std::size_t place)> said;
    int trends = 0;  ///< trends in time that the test contains
};
/// The test at the place where a regression on its columns explains most; each column and the place are parameters.
void test_templates(const SampleFit& fit, Where where, const std::string& subject, const Templates& of,
                    SampleResidualTests& tests);

/// Size of the residual: over the record, by place modulo small numbers, its repetition; its distribution.
void test_sizes(const SampleFit& fit, double lattice_arcsec, SampleResidualTests& tests);
/// Rates: trends in time; steps; two levels; jumps next to a random rate.
void test_rate_patterns(const SampleFit& fit, SampleResidualTests& tests);
/// Rates that follow another column of the record: temperature, input rate, accelerations; immediately or with a lag.
void test_followed(const SampleFit& fit, SampleResidualTests& tests);

}  // namespace ringlock::closure
