#pragma once
#include <memory>
#include <optional>
#include <vector>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// One effect that may be added to a model of samples: as the screening found it, and as it turned out when it was
/// fitted in full.
struct SampleCandidate {
    const effects::Effect* effect = nullptr;
    SampleModel model = {};  ///< to be fitted
    double p_value = 1.0;
    double searched = 1.0;
    /// All over those that explain as much, which the likelihood integrated over them costs: as searched, else.
    std::optional<double> places = {};
    int parameters = 1;
    int freedom = 1;          ///< of its chi-squared, beside what the search counts
    double hz = 0.0;          ///< of a line, where the record has it
    bool wanders = false;     ///< a line as a narrow resonance
    bool strong = false;      ///< motion that is told at many lags
    bool nameless = false;    ///< nothing of the library, and only to be in nobody's way
    std::size_t witness = 0;  ///< in the series, of a motion
    SampleFit::Noise noise = SampleFit::Noise::near;
    Effects confounded = {};  ///< that make the same model

    std::shared_ptr<SampleFit> fit = {};  ///< in full; null while the candidate is only screened
    double merit = 0.0;                   ///< gain of the log-likelihood less its search and its parameters
    bool passes = false;                  ///< the level of one effect, by that gain
};

/// What the screening of samples goes by.
struct SampleContext {
    const record::Declared& declared;
    const SampleSeries& series;
    const Rows& rows;                     ///< fitted
    const std::vector<double>& lines_hz;  ///< that are in the model
    int step = 0;                         ///< that a candidate would be
    bool slow = false;                    ///< slow rates only
};

/// A column of each effect of the library that is a rate of known shape over this record: in proportion to time, to the
/// temperature or how it changes, to the input rate. Effects whose rate does not change in it have none.
std::vector<SampleColumn> rate_columns(const SampleSeries& series,
                                       std::span<const effects::Effect* const> library = effects::registry());
void add_line(SampleModel& model, const SampleSeries& series, const LineCourse& course, const effects::Effect& effect,
              int step);
/// The model as of samples taken at another rate and interpolated, from where in the source's interval the likelihood
/// likes best.
SampleModel resampled_from(const SampleFit& now, double from_hz);

/// The effects that samples can tell of and that the fit does not have yet, held against what it has left.
std::vector<SampleCandidate> screen_samples(const SampleFit& now, const SampleContext& in);

}  // namespace ringlock::closure
