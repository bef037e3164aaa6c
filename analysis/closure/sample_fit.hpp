#pragma once
#include <memory>
#include <string>
#include <vector>

#include "analysis/closure/sample_filter.hpp"
#include "analysis/closure/sample_series.hpp"
#include "analysis/closure/turn_fit.hpp"

namespace ringlock::closure {

/// Increments in proportion to one parameter.
struct SampleColumn {
    std::string effect, name;
    std::shared_ptr<const std::vector<double>> series;
    double value = 0.0;
    double sd = 0.0;
};

/// What a model of the samples consists of.
struct SampleModel {
    SampleNoise noise;
    double flicker_deg_h = 0.0;         ///< B of the bias instability; makes the noise's terms
    std::vector<SampleColumn> columns;  ///< the mean rate first
    std::vector<double> motion;         ///< of the case, by its witness: taken off the increments; empty: none
    double from_shift = 0.0;            ///< of from_hz, in tenths of a cycle over the record, while it is fitted
    /// Whose resonances the noise has, in their order. The second of one effect has the first's frequency and three
    /// times its width.
    std::vector<std::string> resonances;
    bool walk = false;
    bool flicker = false;
};

/// Fitted by maximum likelihood of the innovations in the rows that count: noise by its likelihood, columns by least
/// squares of what the filter makes of them.
class SampleFit {
   public:
    SampleFit(const SampleSeries& series, SampleModel model, const Rows& rows, bool free_noise = true);

    const SampleSeries& series() const { return *series_; }
    const SampleModel& model() const { return model_; }
    const Rows& rows() const { return *rows_; }
    /// Over their standard deviations, all rows.
    const std::vector<double>& innovations() const { return innovations_; }
    double sd(std::size_t row) const { return filter_->sd(row); }
    double log_likelihood() const { return log_likelihood_; }
    const SampleFilter& filter() const { return *filter_; }
    /// Increments less all that is deterministic.
    const std::vector<double>& rest() const { return rest_; }
    /// Standard errors of the white noises, in their units.
    double angle_sd() const { return angle_sd_; }
    double rate_sd() const { return rate_sd_; }

    struct Score {
        std::vector<double> value;
        double chi2 = 0.0;
        int rank = 0;
    };
    /// Regression of the innovations that count on series of increments, freed of what the columns could take of them.
    Score score(const std::vector<std::vector<double>>& series) const;

   private:
    void take_off();
    double evaluate(const SampleModel& model, std::span<const double> rest) const;
    void fit_noise();
    void fit_columns();
    void finish();

    const SampleSeries* series_;
    const Rows* rows_;
    SampleModel model_;
    std::vector<double> rest_;
    std::shared_ptr<SampleFilter> filter_;
    std::vector<double> innovations_;
    std::vector<std::vector<double>> whitened_;  ///< columns
    double log_likelihood_ = 0.0;
    double angle_sd_ = 0.0, rate_sd_ = 0.0;
};

/// Gauss-Markov rates that make the flicker of that bias instability between `shortest_s` and `longest_s`.
std::vector<SampleNoise::Term> flicker_terms(double deg_h, double shortest_s, double longest_s);

}  // namespace ringlock::closure
