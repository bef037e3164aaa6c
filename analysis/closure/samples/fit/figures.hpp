#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/record/record.hpp"

/// Parameters of the effects that a fit to samples contains, with standard errors.
namespace ringlock::closure {

/// An effect in a model: its part of the model and its entry in the report.
struct AddedEffect {
    Step step = {};                     ///< its parameters; unless they are known already, they come from the last fit
    int id = 0;                         ///< step of the loop that added its columns and resonances
    std::size_t witness = 0;            ///< of a motion: index in the series
    bool strong = false;                ///< a motion that is fitted at many lags of its witness
    double hz = 0.0;                    ///< of a line: frequency at which the record shows it
    std::vector<double> other_hz = {};  ///< rates of the source that explain a resampled record as well

    AddedEffect(const effects::Effect& added, int number) : id(number) { step.effect = &added; }
    const effects::Effect& effect() const { return *step.effect; }
    /// Whether the effect is resampling from readings at another rate.
    bool is_source() const { return on_samples(effect()) == OnSamples::transport; }
};

struct SampleFigures {
    std::vector<Estimate> base;
    std::vector<std::vector<Estimate>> steps;          ///< of each effect that was added
    std::vector<std::vector<std::string>> step_notes;  ///< notes on the parameters of each
    std::vector<std::string> notes;                    ///< reasons why some parameters have no standard error
};

/// \param fit  model that is fitted to all rows that are to count
SampleFigures figures_of(const SampleFit& fit, const std::vector<AddedEffect>& added, const record::Declared& declared);

/// Deviation of a random-walk effect that makes the walk of the noise.
double deviation_of_walk(const effects::Effect& effect, const SampleNoise& noise);

}  // namespace ringlock::closure
