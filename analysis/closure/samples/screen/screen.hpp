#pragma once
#include <optional>
#include <string>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// A model of samples that the loop may go on with.
struct SampleCandidate {
    std::string effect = {};
    SampleModel model = {};
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
    std::vector<std::string> confounded = {};  ///< the same model by other names
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

/// Rates in proportion to one number that the record can tell of: time, temperature, input rate.
std::vector<SampleColumn> rate_columns(const SampleSeries& series);
void add_line(SampleModel& model, const SampleSeries& series, const LineCourse& course, const std::string& effect,
              int step);
/// The model as of samples taken at another rate and interpolated, from where in the source's interval the likelihood
/// likes best.
SampleModel resampled_from(const SampleFit& now, double from_hz);

/// The effects that samples can tell of and that the fit does not have yet, held against what it has left.
std::vector<SampleCandidate> screen_samples(const SampleFit& now, const SampleContext& in);

}  // namespace ringlock::closure
