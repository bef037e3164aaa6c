#pragma once
#include <Eigen/Dense>
#include <cstddef>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/rounded/unrounding.hpp"

/// Maximum of the likelihood of rounded increments, and its curvature there. Imputed increments hardly move a model
/// where the steps hide most of the information: each fit to them goes a small part of the way.
namespace ringlock::closure {

struct RoundedMaximum {
    SampleModel model;
    double log_likelihood = 0.0;
    /// Standard errors of the logarithms of the noises: white angle, white rate, random rate where there is one,
    /// resonances, predicted motion of the case; not finite where the increments do not determine them.
    std::vector<double> noise_log_sd;
    /// For each column: its standard error relative to that with known increments.
    std::vector<double> column_times;
};

/// Noises alone, from a distant start, by the increments up to row `until`; columns are unchanged.
/// \param near  maximum for a similar model, or null: its noises are the start where they are likelier
RoundedMaximum towards_maximum(const SampleFit& fit, const RoundedIncrements& rounded, std::size_t until,
                               int most_rounds, const RoundedMaximum* near = nullptr);

/// Noises and columns, from a model near the maximum.
RoundedMaximum find_maximum(const SampleFit& fit, const RoundedIncrements& rounded, int most_rounds,
                            const RoundedMaximum* near = nullptr);

}  // namespace ringlock::closure
