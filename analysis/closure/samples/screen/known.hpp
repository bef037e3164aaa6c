#pragma once
#include <vector>

#include "analysis/closure/samples/fit/figures.hpp"
#include "analysis/closure/samples/fit/fit.hpp"

namespace ringlock::closure {

/// A model with effects whose values are known at least roughly, as the start of a fit.
struct KnownEffects {
    SampleModel model;
    std::vector<AddedEffect> added;  ///< all of them; a motion is not in the model yet, but its witness is known
    SampleFit::Noise noise;          ///< how the noise of the model is to be fitted
};

/// \param base  fitted model to which they are added
KnownEffects known_effects(const SampleFit& base, const std::vector<ActiveEffect>& effects);

}  // namespace ringlock::closure
