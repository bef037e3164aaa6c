#pragma once
#include <memory>
#include <utility>
#include <vector>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/closure/samples/screen/screen.hpp"
#include "analysis/record/record.hpp"

/// Which effect of the library a record of samples supports most, after the screening.
namespace ringlock::closure {

/// Whether so small a p-value is rare enough for one of all effects that show on samples.
bool passes_on_samples(double p_value);

/// A model of the samples, and what may be added to it.
struct SampleState {
    std::shared_ptr<SampleFit> fit;
    std::vector<double> lines_hz = {};    ///< that are in the model
    int step = 0;                         ///< that an effect added to it would be
    bool random_rates = true;             ///< may be added
    const KnownSource* source = nullptr;  ///< of the record, where other records tell it
};

/// Effects that were chosen with another and are added after it, each with the effects that would explain the record as
/// well in its place.
using Partners = std::vector<std::pair<const effects::Effect*, Effects>>;

/// What to add, if anything.
struct SampleChoice {
    std::shared_ptr<SampleCandidate> chosen;
    double p_value = 1.0;  ///< given the effects that are chosen with it
    Effects confounded_with;
    Partners of_partners;                                ///< where it was chosen with others that are added next
    std::vector<double> other_hz;                        ///< rates that explain a resampled record as well
    std::shared_ptr<SampleCandidate> other_random = {};  ///< the likeliest other random rate, where one is chosen
    /// Where a rate or a line leads but a residual test explains more, so that nothing is chosen: the likeliest random
    /// rate, or that line, as a placeholder with which other effects can be found.
    std::shared_ptr<SampleCandidate> nearest = {};
};

/// The likeliest effect, or the first of the likeliest set of two or three, tied to all that are as likely. None where
/// no effect of the library passes, or where a residual test explains more. \param known           rows that, in
/// addition to the training rows, place a step in a gap between these \param lattice_arcsec  steps of the values
SampleChoice choose_on_samples(const record::Declared& declared, const SampleState& now, const Rows& known,
                               double lattice_arcsec);

}  // namespace ringlock::closure
