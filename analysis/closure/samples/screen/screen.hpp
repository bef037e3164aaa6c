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

/// An effect that may be added to a model of samples: the result of the score test, and that of the full fit.
struct SampleCandidate {
    const effects::Effect* effect = nullptr;
    SampleModel model = {};  ///< to be fitted
    double p_value = 1.0;
    /// Look-elsewhere factor of the search.
    double look_elsewhere = 1.0;
    /// Number of positions searched, divided by the number that explain as much: the cost of the search where the
    /// likelihood is integrated over places. `look_elsewhere` if not given.
    std::optional<double> positions = {};
    int parameters = 1;
    int freedom = 1;           ///< degrees of freedom of its chi-squared, without the search
    double hz = 0.0;           ///< of a line, frequency at which the record shows it
    bool wanders = false;      ///< a line that is modelled as a narrow resonance
    bool strong = false;       ///< a motion that is fitted at many lags of its witness
    bool placeholder = false;  ///< not a library effect; fitted so that it does not mask others
    std::size_t witness = 0;   ///< of a motion: index in the series
    SampleFit::Noise noise = SampleFit::Noise::near;
    Effects confounded = {};  ///< effects that make the same model

    std::shared_ptr<SampleFit> fit = {};  ///< full fit; null while there is only a score test
    double evidence = 0.0;                ///< gain of the log-likelihood less the cost of search and parameters
    bool passes = false;                  ///< whether that gain passes the level of one effect
};

/// The rate of a record's source, estimated from several records of one data chain together.
struct KnownSource {
    double from_hz = 0.0;
    double sd_hz = 0.0;
    double p_value = 1.0;               ///< by chance, for its gain on this record
    std::vector<double> other_hz = {};  ///< rates that explain these records as well
};

/// Quantities of the loop that the score tests use.
struct SampleContext {
    const record::Declared& declared;
    const SampleSeries& series;
    const Rows& rows;                     ///< rows of the fit
    const std::vector<double>& lines_hz;  ///< lines in the model
    int step = 0;                         ///< step of the loop that would add a candidate
    bool slow = false;                    ///< slow rates only
    const KnownSource* source = nullptr;  ///< if known, no other source is searched
};

/// A column of each effect of the library that is a rate of known shape over this record: proportional to time, to the
/// temperature or its slope, to the input rate. Effects whose rate does not change in the record have no column.
std::vector<SampleColumn> rate_columns(const SampleSeries& series,
                                       std::span<const effects::Effect* const> library = effects::registry());
void add_line(SampleModel& model, const SampleSeries& series, const FrequencyTrack& track,
              const effects::Effect& effect, int step);
/// The model of readings that were taken at that rate and interpolated, with the most likely place of the record's
/// start in the source's interval.
SampleModel resampled_from(const SampleFit& now, double from_hz);
/// The same with known noises, rate and place; each line has the frequency of the source that explains most.
SampleModel resampled_with(const SampleFit& now, const SampleNoise& noise);
/// Models of readings at that rate as starts of fits, one for each assumption on errors that interpolation may have
/// hidden; each line has the frequency of the source that explains most.
std::vector<SampleModel> models_of_source(const SampleFit& now, double from_hz);
/// The model of a resampled record as if its readings had been taken at the record's rate: lines are at their aliases.
SampleModel without_source(const SampleFit& now);

/// Candidates among the effects that act on samples and are not in the fit, by score tests of its residual.
std::vector<SampleCandidate> screen_samples(const SampleFit& now, const SampleContext& in);

}  // namespace ringlock::closure
