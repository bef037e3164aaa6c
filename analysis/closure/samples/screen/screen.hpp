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
    /// Places that were searched over those that explain as much: the cost of the search where the likelihood is
    /// integrated over places. As `searched` if not given.
    std::optional<double> places = {};
    int parameters = 1;
    int freedom = 1;          ///< degrees of freedom of its chi-squared, the search apart
    double hz = 0.0;          ///< of a line, where the record has it
    bool wanders = false;     ///< a line as a narrow resonance
    bool strong = false;      ///< a motion that is fitted at many lags of its witness
    bool nameless = false;    ///< not a library effect; fitted so that it does not mask others
    std::size_t witness = 0;  ///< in the series, of a motion
    SampleFit::Noise noise = SampleFit::Noise::near;
    Effects confounded = {};  ///< that make the same model

    std::shared_ptr<SampleFit> fit = {};  ///< in full; null while the candidate is only screened
    double merit = 0.0;                   ///< gain of the log-likelihood less its search and its parameters
    bool passes = false;                  ///< the level of one effect, by that gain
};

/// The rate of the source that a record was resampled from, as several records of one data chain tell it together.
struct KnownSource {
    double from_hz = 0.0;
    double sd_hz = 0.0;
    double p_value = 1.0;               ///< by chance, of what it gains on this record
    std::vector<double> other_hz = {};  ///< rates that explain these records as well
};

/// What the screening of samples needs to know of the loop.
struct SampleContext {
    const record::Declared& declared;
    const SampleSeries& series;
    const Rows& rows;                     ///< fitted
    const std::vector<double>& lines_hz;  ///< that are in the model
    int step = 0;                         ///< that a candidate would be
    bool slow = false;                    ///< slow rates only
    const KnownSource* source = nullptr;  ///< where it is known: no other is looked for
};

/// A column of each effect of the library that is a rate of known shape over this record: in proportion to time, to the
/// temperature or how it changes, to the input rate. Effects whose rate does not change in it have none.
std::vector<SampleColumn> rate_columns(const SampleSeries& series,
                                       std::span<const effects::Effect* const> library = effects::registry());
void add_line(SampleModel& model, const SampleSeries& series, const LineCourse& course, const effects::Effect& effect,
              int step);
/// The model of readings that were taken at that rate and interpolated, with the likeliest place of the record's start
/// within the source's interval.
SampleModel resampled_from(const SampleFit& now, double from_hz);
/// The same with noises, rate and place that are known; lines are where they explain most.
SampleModel resampled_with(const SampleFit& now, const SampleNoise& noise);
/// Models of readings at that rate from which fits start, by either kind of errors that interpolation may have hidden;
/// lines are where they explain most.
std::vector<SampleModel> models_of_source(const SampleFit& now, double from_hz);
/// The model of a resampled record as if its readings had been taken at its own rate: lines are where they show.
SampleModel without_source(const SampleFit& now);

/// Candidates among the effects that show on samples and that the fit does not have yet, by score tests of its
/// residual.
std::vector<SampleCandidate> screen_samples(const SampleFit& now, const SampleContext& in);

}  // namespace ringlock::closure
