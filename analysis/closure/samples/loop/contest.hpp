#pragma once
#include <memory>
#include <utility>
#include <vector>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/closure/samples/screen/screen.hpp"
#include "analysis/record/record.hpp"

/// Choice of the effect of the library that a record of samples supports most, after the score tests.
namespace ringlock::closure {

/// Whether a p-value passes the level of one effect among all that act on samples.
bool passes_on_samples(double p_value);

/// A model of the samples, and restrictions on the effects that may be added to it.
struct SampleState {
    std::shared_ptr<SampleFit> fit;
    std::vector<double> lines_hz = {};    ///< of lines in the model, as the record shows them
    int step = 0;                         ///< step of the loop that would add an effect
    bool random_rates = true;             ///< whether random rates may be added
    const KnownSource* source = nullptr;  ///< source of the record, if known from other records
};

/// Effects that were chosen together with another one and are added after it, each with the effects that would explain
/// the record as well in its place.
using Partners = std::vector<std::pair<const effects::Effect*, Effects>>;

/// The effect to add, if any.
struct SampleChoice {
    std::shared_ptr<SampleCandidate> chosen;
    double p_value = 1.0;  ///< given the effects that are chosen with it
    Effects confounded_with;
    /// Effects that are added next, where it was chosen with others.
    Partners of_partners;
    /// Rates of the source that explain a resampled record as well.
    std::vector<double> other_hz;
    /// The most likely other random rate, if a random rate is chosen.
    std::shared_ptr<SampleCandidate> other_random = {};
    /// Where the most likely effect is a rate or a line, but a residual test explains more, nothing is chosen: the most
    /// likely random rate, or that line, as a placeholder with which other effects can be found.
    std::shared_ptr<SampleCandidate> nearest = {};
};

/// The most likely effect, or the first of the most likely set of two or three, with all equally likely effects tied to
/// it. Nothing is chosen where no effect of the library passes, or where a residual test explains more.
/// \param known  rows that, in addition to the training rows, determine the time of a step in a gap between these
/// \param lattice_arcsec  quantisation of the values
SampleChoice choose_on_samples(const record::Declared& declared, const SampleState& now, const Rows& known,
                               double lattice_arcsec);

}  // namespace ringlock::closure
