#pragma once
#include <vector>

#include "analysis/closure/samples/fit/figures.hpp"
#include "analysis/closure/samples/fit/fit.hpp"

namespace ringlock::closure {

/// A model that has effects whose values are known, or nearly so: a fit to start from.
struct KnownEffects {
    SampleModel model;
    std::vector<SampleStep> told;  ///< as many as effects; of a motion its witness, which is not in the model yet
    SampleFit::Noise noise;        ///< how its noise is to be fitted
};

/// \param base  the model that they are added to, fitted
KnownEffects known_effects(const SampleFit& base, const std::vector<ActiveEffect>& effects);

}  // namespace ringlock::closure
