#pragma once
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/closure/samples/screen/screen.hpp"
#include "analysis/record/record.hpp"

/// Which effect of the library a record of samples supports most: the second half of what screening begins.
namespace ringlock::closure {

/// What samples can tell of; the rest of the library needs turns.
inline constexpr double effects_on_samples = 12.0;
bool passes_on_samples(double p_value);

/// A random rate can follow whatever the library does not have, more or less.
bool is_random_rate(const std::string& effect);
/// Rates that change slowly: each can be taken for another, or for two others together.
bool is_slow_rate(const std::string& effect);

/// A model of the samples, with what is looked for next.
struct SampleState {
    std::shared_ptr<SampleFit> fit;
    std::vector<double> lines_hz = {};  ///< that are in the model
    int step = 0;                       ///< that an effect added to it would be
    bool random_rates = true;           ///< may be added
};

/// An effect fitted in full.
struct SampleContender {
    SampleCandidate candidate;
    std::shared_ptr<SampleFit> fit;
    double merit = 0.0;   ///< gain of the log-likelihood less its search and its parameters
    bool passes = false;  ///< by that
};

/// What to add, if anything.
struct SampleChoice {
    std::shared_ptr<SampleContender> chosen;
    double p_value = 1.0;  ///< beside what explains the record with it
    std::vector<std::string> confounded_with;
    /// Where it was chosen with others that are added next: what else explains the record as well, by their names.
    std::vector<std::pair<std::string, std::vector<std::string>>> of_partners;
    std::vector<double> other_hz;                        ///< rates that explain a resampled record as well
    std::shared_ptr<SampleContender> other_random = {};  ///< the likeliest other random rate, where one is chosen
    /// Where a rate or a line leads, but a view explains more, and nothing is chosen: the likeliest random rate, or
    /// that line. It comes nearest to what is there, and what is something else can be told beside it.
    std::shared_ptr<SampleContender> nearest = {};
};

/// The likeliest effect, or the first of the likeliest two or three, with all that are as likely tied to it. None where
/// nothing of the library passes, or where a view of the residual explains more.
/// \param known           rows that are no part of the choice, but say where between those that are a step is
/// \param lattice_arcsec  steps of the values
SampleChoice choose_on_samples(const record::Declared& declared, const SampleState& now, const Rows& known,
                               double lattice_arcsec);

}  // namespace ringlock::closure
