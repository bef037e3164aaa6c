#pragma once
#include <Eigen/Dense>
#include <cstddef>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/rounded/unrounding.hpp"

/// Where the likelihood of rounded increments is largest, and how sharp it is there. Increments that are drawn within
/// their steps hardly move a model where the steps hide most of what tells: each fit to them goes a small part of the
/// way.
namespace ringlock::closure {

struct RoundedSummit {
    SampleModel model;
    double log_likelihood = 0.0;
    /// Standard errors of the logarithms of the noises: white angle, white rate, random rate where there is one,
    /// resonances, what a witness tells of a motion; not finite where the increments say nothing of them.
    std::vector<double> noise_log_sd;
    /// Of each column, its standard error over that which it would have were the increments known.
    std::vector<double> column_times;
};

/// Noises alone, from afar, by the increments up to that row; of columns it says nothing.
/// \param near  of a model like it, or nothing: its noises are begun with where they are likelier
RoundedSummit towards_summit(const SampleFit& fit, const RoundedIncrements& rounded, std::size_t until, int most_rounds,
                             const RoundedSummit* near = nullptr);

/// Noises and columns of a model that is near it.
RoundedSummit find_summit(const SampleFit& fit, const RoundedIncrements& rounded, int most_rounds,
                          const RoundedSummit* near = nullptr);

}  // namespace ringlock::closure
