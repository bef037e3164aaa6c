#pragma once
#include <vector>

#include "analysis/closure/sample_figures.hpp"
#include "analysis/closure/sample_fit.hpp"
#include "analysis/closure/turn_model.hpp"

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
