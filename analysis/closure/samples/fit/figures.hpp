#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/record/record.hpp"

/// What a fit to samples says of the parameters of the effects in it, with standard errors.
namespace ringlock::closure {

/// An effect in a model.
struct SampleStep {
    std::string effect;
    int step = 0;                       ///< as in its columns and resonances
    std::size_t witness = 0;            ///< of a motion, in the series
    bool strong = false;                ///< motion that is told at many lags
    double hz = 0.0;                    ///< of a line, where the record has it
    std::vector<double> other_hz = {};  ///< rates that explain a resampled record as well
};

struct SampleFigures {
    std::vector<Estimate> base;
    std::vector<std::vector<Estimate>> steps;
    std::vector<std::string> notes;  ///< why some have no standard error
};

/// \param fit  to all rows that are to count
SampleFigures figures_of(const SampleFit& fit, const std::vector<SampleStep>& steps, const record::Declared& declared);

}  // namespace ringlock::closure
