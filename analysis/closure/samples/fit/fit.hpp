#pragma once
#include <Eigen/Dense>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "analysis/closure/samples/model/filter.hpp"
#include "analysis/closure/samples/model/frequency_track.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/closure/samples/model/source.hpp"
#include "analysis/closure/types.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::closure {

/// Increments that are proportional to one parameter.
struct SampleColumn {
    const effects::Effect* effect = nullptr;  ///< null: of the base model
    std::string name;
    std::shared_ptr<const std::vector<double>> series = nullptr;
    double value = 0.0;
    double sd = 0.0;
    int step = -1;  ///< step of the loop that added it; -1: none
    /// The series is used as it is, without interpolation by the source of a resampled record.
    bool as_recorded = false;
    /// Frequency track of a line, in the column of its cosine and in that of its sine, which follows; 0 Hz: no line.
    /// The frequency may be any up to half of the rate at which the readings were taken.
    FrequencyTrack track = {};
};

/// Effect, and step of the loop that added it, to which a resonance of the noise belongs.
struct ResonanceOwner {
    const effects::Effect* effect = nullptr;
    int step = -1;
};

/// Parts of a model of the samples.
struct SampleModel {
    SampleNoise noise;
    double flicker_deg_h = 0.0;         ///< B of the bias instability, which gives the terms of the noise
    std::vector<SampleColumn> columns;  ///< the mean rate first
    /// Motion of the case, predicted from its witness and subtracted from the increments; empty: none.
    std::vector<double> motion;
    /// Lowest frequency of the part that the witness does not predict: below it, that part would be a slow rate.
    double motion_from_hz = 0.0;
    double from_shift = 0.0;  ///< change of from_hz, in tenths of a cycle over the record, during its fit
    /// Standard error of from_hz where it is also estimated from other records; from_hz is then held.
    std::optional<double> held_from_hz_sd = {};
    std::vector<ResonanceOwner> resonances;  ///< one owner per resonance of the noise, in the same order
    bool walk = false;
    bool flicker = false;
};

/// Raises the rate of a resampled record's source by shift_hz. The readings in the middle of the record keep their
/// place, so that rate and place are uncorrelated.
void move_source(SampleModel& model, const SampleSeries& series, double shift_hz);

/// Fit by maximum likelihood of the innovations in the rows that count: the noise by its likelihood, the columns by
/// least squares of the whitened increments.
class SampleFit {
   public:
    /// all_held: noise and columns as given; held: noise as given; near: noise fitted from a start near the maximum;
    /// free: noise fitted from any start.
    enum class Noise { all_held, held, near, free };
    SampleFit(const SampleSeries& series, SampleModel model, const Rows& rows, Noise noise = Noise::free);

    const SampleSeries& series() const { return *series_; }
    const SampleModel& model() const { return model_; }
    const Rows& rows() const { return *rows_; }
    /// Whether a row is deterministic: it follows from the rows before it except for its digits, where a record has
    /// more samples than its source has readings. Where the error of a prediction grows from one interval to the next,
    /// the effect of the digits grows with it; such rows count as deterministic too.
    bool deterministic(std::size_t row) const { return deterministic_[row] != 0; }
    /// Rows that count and are not deterministic.
    const Rows& informative() const { return informative_; }
    /// Columns after the filter.
    const std::vector<std::vector<double>>& whitened() const { return whitened_; }
    /// Divided by their standard deviations; all rows.
    const std::vector<double>& innovations() const { return innovations_; }
    double sd(std::size_t row) const { return filter_->sd(row); }
    /// Root mean square of the innovations' standard deviations over the rows that count.
    double typical_sd() const { return typical_sd_; }
    double log_likelihood() const { return log_likelihood_; }
    /// Gain of the log-likelihood over another model of the same rows. Where both are resampled, deterministic rows are
    /// excluded: they determine the source's times, and carry no information on the effects.
    double gain_over(const SampleFit& other) const;
    const SampleFilter& filter() const { return *filter_; }
    /// Increments after interpolation, for an angle with the given increments: on the straight lines between the times
    /// of the source where the record is resampled, else unchanged.
    std::vector<double> as_taken(const std::vector<double>& increments) const;
    /// Columns of cosine and sine of a line, as the record contains them.
    std::vector<std::vector<double>> line(const FrequencyTrack& track) const;
    /// Column as the record contains it.
    std::vector<double> taken(const SampleColumn& column) const;
    /// Increments of all deterministic parts of the model.
    std::vector<double> determined() const;
    /// Increments less the deterministic parts.
    const std::vector<double>& rest() const { return rest_; }
    /// Standard errors of the noise, by Fisher's information of the rows that count: a model in which each parameter
    /// has the value of its standard error. Columns are independent of the noise and have their own errors.
    SampleModel noise_errors() const;
    /// Covariance of the values of the columns.
    const Eigen::MatrixXd& covariance() const { return covariance_; }

    struct Score {
        std::vector<double> value;
        Eigen::MatrixXd covariance;
        double chi2 = 0.0;
        int rank = 0;
    };
    /// Regression of the innovations that count on series of increments, which are made orthogonal to the columns.
    Score score(const std::vector<std::vector<double>>& series) const;
    /// Covariance of the columns and of these series after them, all fitted together.
    Eigen::MatrixXd joint_covariance(const std::vector<std::vector<double>>& series) const;

   private:
    struct Slope {
        double value = 0.0;  ///< minus the log-likelihood
        Eigen::VectorXd gradient;
        Eigen::MatrixXd information;
    };
    /// Increments less the deterministic parts for a clock of the source, and their derivatives by the clock.
    struct ByClock {
        std::vector<double> rest;
        /// One series per free parameter, in units of the innovations' sd; empty where the parameter does not change
        /// the clock.
        std::vector<std::vector<double>> moved;
    };
    Eigen::MatrixXd normal_with(const std::vector<std::vector<double>>& series, Eigen::VectorXd& right) const;
    using Shared = std::shared_ptr<const std::vector<double>>;
    std::vector<Shared> taken_by(const SampleModel& model) const;
    std::vector<double> determined_by(const SampleModel& model) const;
    std::vector<double> rest_of(const SampleModel& model) const;
    void take_off() { rest_ = rest_of(model_); }
    void take_whites(SampleNoise& noise) const;
    ByClock by_clock(const std::vector<double>& free_parameters, const Rows& rows, const std::vector<bool>& held) const;
    double value_at(const std::vector<double>& free_parameters, const Rows& rows) const;
    std::vector<bool> which_are_lost(const std::vector<double>& before, const std::vector<double>& after) const;
    void share_whites(SampleNoise& noise, double share) const;
    bool gone(const SampleNoise& noise) const;
    void raise_whites(SampleNoise& noise) const;
    /// Minus the log-likelihood under each model.
    std::vector<double> evaluate(const std::vector<SampleModel>& models, std::span<const double> rest,
                                 const Rows& rows) const;
    SampleModel at(const std::vector<double>& free_parameters) const;
    void filter_by(const SampleNoise& noise);
    void find_deterministic(SampleNoise noise);
    Slope slope(const std::vector<double>& free_parameters, const Rows& rows, const std::vector<bool>& held) const;
    void score_noise(std::vector<double>& free_parameters, const Rows& rows, const std::vector<bool>& held) const;
    void fit_noise();
    void fit_columns(bool held = false);
    void finish();

    const SampleSeries* series_;
    const Rows* rows_;
    SampleModel model_;
    bool searched_ = false;
    std::vector<double> rest_;
    std::shared_ptr<SampleFilter> filter_;
    std::vector<double> innovations_;
    std::vector<std::vector<double>> whitened_;  ///< columns after the filter
    double log_likelihood_ = 0.0;
    double typical_sd_ = 0.0;
    Eigen::MatrixXd covariance_;
    Rows deterministic_;
    Rows informative_;
};

/// Gauss-Markov rates that add up to flicker of that bias instability between `shortest_s` and `longest_s`: two a
/// decade, or fewer where that would be more than eight; one a decade is within 3 % of flat.
std::vector<SampleNoise::Term> flicker_terms(double deg_h, double shortest_s, double longest_s);

}  // namespace ringlock::closure
