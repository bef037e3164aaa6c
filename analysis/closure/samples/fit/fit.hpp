#pragma once
#include <Eigen/Dense>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "analysis/closure/samples/model/filter.hpp"
#include "analysis/closure/samples/model/line_course.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/closure/samples/model/source.hpp"
#include "analysis/closure/types.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::closure {

/// Increments in proportion to one parameter.
struct SampleColumn {
    const effects::Effect* effect = nullptr;  ///< null: of the base model
    std::string name;
    std::shared_ptr<const std::vector<double>> series = nullptr;
    double value = 0.0;
    double sd = 0.0;
    int step = -1;             ///< of the loop that added it
    bool as_recorded = false;  ///< and no further what a resampled record's source makes of it
    /// Of a line's cosine and of the sine that follows it; 0 Hz: no line. It may be any up to half of the rate at which
    /// the readings were taken.
    LineCourse course = {};
};

/// The effect, and the step of the loop that added it, which a resonance of the noise belongs to.
struct ResonanceOwner {
    const effects::Effect* effect = nullptr;
    int step = -1;
};

/// What a model of the samples consists of.
struct SampleModel {
    SampleNoise noise;
    double flicker_deg_h = 0.0;         ///< B of the bias instability; makes the noise's terms
    std::vector<SampleColumn> columns;  ///< the mean rate first
    std::vector<double> motion;         ///< of the case, by its witness: taken off the increments; empty: none
    double motion_from_hz = 0.0;        ///< what the witness does not tell of it is no slower: that is a slow rate
    double from_shift = 0.0;            ///< of from_hz, in tenths of a cycle over the record, while it is fitted
    /// Standard error of from_hz where other records tell it as well: it is held then.
    std::optional<double> held_from_hz_sd = {};
    std::vector<ResonanceOwner> resonances;  ///< of each resonance of the noise, in their order
    bool walk = false;
    bool flicker = false;
};

/// Gives the source of a resampled record a rate that is higher by so much. Its readings stay where they are in the
/// middle of the record, so that rate and place are told apart.
void move_source(SampleModel& model, const SampleSeries& series, double shift_hz);

/// Fitted by maximum likelihood of the innovations in the rows that count: noise by its likelihood, columns by least
/// squares of what the filter makes of them.
class SampleFit {
   public:
    /// Noise and columns as they are; noise as it is, from near where it will be, or from anywhere.
    enum class Noise { all_held, held, near, free };
    SampleFit(const SampleSeries& series, SampleModel model, const Rows& rows, Noise noise = Noise::free);

    const SampleSeries& series() const { return *series_; }
    const SampleModel& model() const { return model_; }
    const Rows& rows() const { return *rows_; }
    /// Whether those before it settle a row but for its digits: where a record has more samples than it was made of.
    /// Where what those say of the source grows from one interval to the next, the digits do as well.
    bool settled(std::size_t row) const { return settled_[row] != 0; }
    /// Rows that count and are not settled.
    const Rows& telling() const { return telling_; }
    /// What the filter makes of the columns.
    const std::vector<std::vector<double>>& whitened() const { return whitened_; }
    /// Over their standard deviations, all rows.
    const std::vector<double>& innovations() const { return innovations_; }
    double sd(std::size_t row) const { return filter_->sd(row); }
    /// Root mean square of these over the rows that count.
    double typical_sd() const { return typical_sd_; }
    double log_likelihood() const { return log_likelihood_; }
    /// Of the log-likelihood over that of another model of the same rows. Where both are resampled, rows that are
    /// settled to their digits say how exactly the source's times are known, and nothing of the effects: they are left
    /// out.
    double gain_over(const SampleFit& other) const;
    const SampleFilter& filter() const { return *filter_; }
    /// Increments of an angle that the record's source takes at its own times: on the straight lines between these,
    /// where the record is resampled. Rows that those before them settle know it to their digits.
    std::vector<double> as_taken(const std::vector<double>& increments) const;
    /// Cosine and sine of a line, as the record has them.
    std::vector<std::vector<double>> line(const LineCourse& course) const;
    /// Of a column.
    std::vector<double> taken(const SampleColumn& column) const;
    /// Increments by all that is deterministic in the model.
    std::vector<double> determined() const;
    /// Increments less that.
    const std::vector<double>& rest() const { return rest_; }
    /// Standard errors of the noise, by Fisher's information of the rows that count: a model that holds them in the
    /// places of what they belong to. Columns are known independently of the noise and have theirs.
    SampleModel noise_errors() const;
    /// Of the columns, one with another.
    const Eigen::MatrixXd& covariance() const { return covariance_; }

    struct Score {
        std::vector<double> value;
        Eigen::MatrixXd covariance;
        double chi2 = 0.0;
        int rank = 0;
    };
    /// Regression of the innovations that count on series of increments, freed of what the columns could take of them.
    Score score(const std::vector<std::vector<double>>& series) const;
    /// Of the columns and these behind them, all fitted together.
    Eigen::MatrixXd joint_covariance(const std::vector<std::vector<double>>& series) const;

   private:
    struct Slope {
        double value = 0.0;  ///< minus the log-likelihood
        Eigen::VectorXd gradient;
        Eigen::MatrixXd information;
    };
    /// Increments less what a source's clock makes of all that is determined, and how they go with the clock.
    struct ByClock {
        std::vector<double> rest;
        /// A knob each, innovations over their standard deviations; empty where it does not move the clock.
        std::vector<std::vector<double>> moved;
    };
    Eigen::MatrixXd normal_with(const std::vector<std::vector<double>>& series, Eigen::VectorXd& right) const;
    using Shared = std::shared_ptr<const std::vector<double>>;
    std::vector<Shared> taken_by(const SampleModel& model) const;
    std::vector<double> determined_by(const SampleModel& model) const;
    std::vector<double> rest_of(const SampleModel& model) const;
    void take_off() { rest_ = rest_of(model_); }
    void take_whites(SampleNoise& noise) const;
    ByClock by_clock(const std::vector<double>& knobs, const Rows& rows, const std::vector<bool>& held) const;
    double value_at(const std::vector<double>& knobs, const Rows& rows) const;
    std::vector<bool> places_of_lost(const std::vector<double>& before, const std::vector<double>& after) const;
    void share_whites(SampleNoise& noise, double share) const;
    bool gone(const SampleNoise& noise) const;
    void raise_whites(SampleNoise& noise) const;
    /// Minus the log-likelihood under each.
    std::vector<double> evaluate(const std::vector<SampleModel>& models, std::span<const double> rest,
                                 const Rows& rows) const;
    SampleModel at(const std::vector<double>& knobs) const;
    void filter_by(const SampleNoise& noise);
    void find_settled(SampleNoise noise);
    Slope slope(const std::vector<double>& knobs, const Rows& rows, const std::vector<bool>& held) const;
    void score_noise(std::vector<double>& knobs, const Rows& rows, const std::vector<bool>& held) const;
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
    std::vector<std::vector<double>> whitened_;  ///< columns
    double log_likelihood_ = 0.0;
    double typical_sd_ = 0.0;
    Eigen::MatrixXd covariance_;
    Rows settled_;
    Rows telling_;
};

/// Gauss-Markov rates that make the flicker of that bias instability between `shortest_s` and `longest_s`: two a
/// decade, or fewer where that would be more than eight; one a decade is within 3 % of flat.
std::vector<SampleNoise::Term> flicker_terms(double deg_h, double shortest_s, double longest_s);

}  // namespace ringlock::closure
