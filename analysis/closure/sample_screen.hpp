#pragma once
#include <string>
#include <vector>

#include "analysis/closure/sample_fit.hpp"
#include "analysis/closure/sample_series.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// A model of samples that the loop may go on with.
struct SampleCandidate {
    std::string effect = {};
    SampleModel model = {};
    double p_value = 1.0;
    double searched = 1.0;
    int parameters = 1;
    bool wanders = false;                      ///< a line as a narrow resonance
    std::vector<Estimate> told = {};           ///< parameters that are no columns and no knobs
    std::vector<std::string> confounded = {};  ///< the same model by other names
};

/// What the screening of samples goes by.
struct SampleContext {
    const record::Declared& declared;
    const SampleSeries& series;
    const Rows& rows;                     ///< fitted
    const std::vector<double>& lines_hz;  ///< that are in the model
};

/// The effects that samples can tell of and that the fit does not have yet, held against what it has left.
std::vector<SampleCandidate> screen_samples(const SampleFit& now, const SampleContext& in);

}  // namespace ringlock::closure
