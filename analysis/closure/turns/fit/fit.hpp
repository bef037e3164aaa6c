#pragma once
#include <Eigen/Dense>
#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/turns/model/model.hpp"

namespace ringlock::closure {

/// What a parameter adds to the phases that are foretold, a unit of it.
///
/// Some of that follows from the very phase that it is added to: what the lock-in does before a turn, what is read at
/// it. Its derivative by that phase, turn after turn, is the slope; empty where nothing does. Such a series goes with
/// the innovations even where nothing is missing, which the likelihood's |1 - before'| makes up for, and `left` where
/// the noise has a shape (NoiseShape). `kick` is the derivative of all that the turn adds to those after it.
struct Regressor {
    Regressor(std::vector<double> of_series, std::vector<double> of_slope = {}, std::vector<double> of_kick = {},
              std::vector<double> of_left = {})
        : series(std::move(of_series)),
          slope(std::move(of_slope)),
          kick(std::move(of_kick)),
          left(std::move(of_left)) {}
    std::vector<double> series, slope, kick, left;

    /// Takes so much of it from a rest, and adds it to the frame.
    void take(double value, std::vector<double>& rest, TurnFrame& frame) const;
};

/// How much further one model's phases are than another's, over `per`.
Regressor difference(TurnModel::Prediction with, const TurnModel::Prediction& without, double per);

/// What a swing of the amplitude adds to the phases, by its cosine, its sine and its frequency [rad/Hz].
std::array<std::vector<double>, 3> amplitude_by(const AmplitudeSwing& swing, const TurnSeries& series);

/// The model fitted to the turns that count, by maximum likelihood.
///
/// The filter goes through all turns; the likelihood is that of the innovations of those that count, each given all
/// phases before it. What follows deterministically is fitted by Gauss and Newton in the whitened phases, what is
/// random by the likelihood of the rest (Harvey, "Forecasting, Structural Time Series Models and the Kalman Filter",
/// 1989, 3.4).
class TurnFit {
   public:
    /// What is done with the parameters of effects: held, they stay as given, and the rest is fitted beside them, so
    /// that standard errors are what Fisher's information says at these values.
    enum class Effects { fitted, held };
    /// \param needed  log-likelihood below which nothing needs to be exact: where the fit will not come that far it is
    ///                not fitted to the end
    TurnFit(const TurnModel& model, const TurnParameters& start, Rows rows, Effects effects = Effects::fitted,
            double needed = -std::numeric_limits<double>::infinity());
    TurnFit(const TurnFit&) = delete;  // the filter refers to what the fit holds
    TurnFit& operator=(const TurnFit&) = delete;

    /// The same without the noise that hardly shows, for scores: it may have swallowed what an effect does. None where
    /// all of it shows.
    std::unique_ptr<TurnFit> with_less_noise() const;
    /// The same under the noise of these parameters, nothing fitted anew, for scores.
    std::unique_ptr<TurnFit> with_noise(const TurnParameters& of) const;

    /// What all phases together tell of the reading's errors, where that is enough for what the lock-in makes of them
    /// to be linear about it, and not about the phases that were read; else none.
    ReadingErrors reading_errors() const;

    /// Lets go of all that is as long as the record. It is made again from the parameters, bit for bit, where something
    /// asks for it: of many fits beside one another, those keep it that work. Not while others look at what it has.
    void put_away() const;

    const TurnModel& model() const { return *model_; }
    const TurnParameters& parameters() const { return parameters_; }
    const TurnModel::Prediction& prediction() const { return ready().prediction_; }
    /// Base parameters and those of effects, with standard errors.
    const std::vector<Estimate>& estimates() const;
    /// Of the phases that count and of the radii of the quadrature.
    double log_likelihood() const { return log_likelihood_; }
    const Rows& rows() const { return rows_; }

    /// Innovations of all turns over their standard deviations, and those of the phases [rad].
    const std::vector<double>& innovations() const { return ready().innovations_; }
    const std::vector<double>& sd_rad() const { return ready().sd_rad_; }

    /// Regression of the innovations that count on further series of phase, whitened and freed of what the model's own
    /// parameters could take of them: estimates, covariance and the chi-squared of all together.
    struct Score {
        Eigen::VectorXd value;
        Eigen::MatrixXd covariance;
        double chi2 = 0.0;
        int rank = 0;
    };
    Score score(const std::vector<Regressor>& regressors) const;
    /// The same of so many series, each made where it is whitened and let go of then.
    Score score(std::size_t count, const std::function<Regressor(std::size_t)>& regressor) const;
    /// The same of so many series that no phase moves, which go through the filter a piece at a time: for many of them.
    /// The squares and products that the regression is of.
    struct Products {
        Eigen::MatrixXd squares;  ///< of the series, whitened and freed, with each other
        Eigen::VectorXd right;    ///< with what is left
    };
    using Piece = std::function<void(std::size_t series, std::size_t first_turn, std::span<double> values)>;
    Products products(std::size_t count, const Piece& piece) const;
    Score score_pieces(std::size_t count, const Piece& piece) const { return score_of(products(count, piece)); }
    /// That regression with the noise fitted anew beside it, from the model's own, or from another that is nearer.
    struct Regression {
        double gain = 0.0;  ///< of the log-likelihood
        Eigen::VectorXd value;
        TurnParameters noise = {};  ///< the model's own, with the noise fitted anew
    };
    Regression regress(const std::vector<Regressor>& regressors) const { return regress(regressors, parameters_); }
    Regression regress(const std::vector<Regressor>& regressors, const TurnParameters& noise) const;
    /// One series whitened and freed likewise, and what is left: their product is the derivative of the log-likelihood.
    /// Rows that do not count are zero. As many again are those of |1 - before'|: what is left is -1 there, the series
    /// its slope over 1 - before', so that their squares are what it adds to the information.
    Eigen::VectorXd whitened(const Regressor& regressor) const;
    Eigen::VectorXd residual() const;
    /// One series whitened, and no more.
    std::vector<double> whitened_alone(const std::vector<double>& series) const {
        return ready().whitening_->apply(series);
    }

    /// Twice the gain of the log-likelihood by a random effect, and its standard deviation (of the parameter of that
    /// role), all else as fitted.
    struct Spread {
        double deviation = 0.0;
        double chi2 = 0.0;
    };
    Spread spread(const ActiveEffect& effect, const std::string& parameter, double most) const;

   private:
    TurnFit(const TurnFit& of, TurnParameters parameters, int passes);  ///< with that noise
    static Score score_of(const Products& products);
    Score score_whitened(std::size_t count, const std::function<Eigen::VectorXd(std::size_t)>& column) const;
    struct Column {
        std::string effect, name;
        Regressor of;
    };
    void fit_nuisances();
    void fit_deterministic(int most);  ///< passes
    /// Of a step by Gauss and Newton, in units of the columns' norms.
    struct Equations {
        Eigen::MatrixXd normal;
        Eigen::VectorXd right, scale;
    };
    Equations equations(const Whitening& whitening, bool guessed) const;
    void follow_gains(const Whitening& whitening, Eigen::MatrixXd& x, Eigen::VectorXd& scale) const;
    /// Such a step, shorter where that is better, in the squares under a noise that is guessed or in the objective.
    /// Tells whether another may gain something.
    bool go_down(const Equations& equations, const Whitening* guessed);
    void climb();
    bool place_times();
    void fit_noise();
    void try_other_noise();
    void try_wander();
    void try_from(const TurnParameters& other);
    void shape_noise();
    TurnParameters with_noise_of(const TurnFrame& frame, const TurnParameters& start,
                                 const std::vector<double>& rest) const;
    /// The series whitened, rows that do not count zero, and the rows of |1 - before'| below.
    Eigen::VectorXd counted(const Whitening& whitening, const TurnFrame& frame, const Regressor& regressor) const;
    Eigen::VectorXd counted(const Whitening& whitening, const std::vector<double>& rest) const;
    /// Several such series beside one another, divided by their norms.
    using RegressorAt = std::function<const Regressor&(std::size_t)>;
    Eigen::MatrixXd counted(const Whitening& whitening, const TurnFrame& frame, std::size_t count,
                            const RegressorAt& regressor, Eigen::VectorXd& norms) const;
    Eigen::VectorXd below(const std::vector<double>& white, double value) const;
    void hold_back(const Eigen::VectorXd& scale, Eigen::MatrixXd& normal) const;
    void take(const Eigen::VectorXd& step);
    void set_rest(const TurnModel::Prediction& prediction) const;
    double squares_left(const Whitening& whitening) const;
    double objective_at(const TurnModel::Prediction& prediction) const;  ///< with what is believed
    double slope_of_objective(const TurnFrame& frame, const std::vector<double>& rest, const Regressor& of,
                              double step) const;
    /// How phases go with the parameters, at these, which foretell that.
    std::vector<Column> columns(const TurnParameters& at, const TurnModel::Prediction& prediction) const;
    void find_columns();
    void finish();
    void whiten() const;
    const TurnFit& ready() const;
    const Eigen::MatrixXd& basis() const;
    std::vector<Estimate> estimate() const;
    Eigen::MatrixXd whitened_columns(Eigen::VectorXd& scale) const;  ///< of norm one, scale times as long
    Eigen::MatrixXd information(Eigen::VectorXd& scale) const;       ///< of these, and what is believed
    void add_noise_estimates(std::vector<Estimate>& estimates) const;
    /// How far bias and threshold are from what is believed of them, in standard deviations, and these.
    struct Belief {
        double bias, threshold, bias_sd_deg_h, threshold_sd_deg_h;
    };
    Belief belief_of(const TurnParameters& parameters) const;
    void add_priors(const Eigen::VectorXd& scale, Eigen::MatrixXd& normal, Eigen::VectorXd* right) const;
    double objective(const TurnParameters& parameters, const std::vector<double>& rest) const {
        return objective(prediction_.frame, parameters, rest);
    }
    double objective(const TurnFrame& frame, const TurnParameters& parameters, const std::vector<double>& rest) const;
    /// The same under the noise of each of these parameters.
    std::vector<double> objectives(const TurnFrame& frame, const std::vector<TurnParameters>& parameters,
                                   const std::vector<double>& rest) const;

    /// Columns come in this order: nuisances, base parameters, those of effects; how many are solved for.
    std::size_t nuisances() const;
    std::size_t solved() const;

    const TurnModel* model_;
    TurnParameters parameters_;
    Rows rows_;
    Effects effects_;
    double needed_;                 ///< log-likelihood
    std::vector<double> nuisance_;  ///< offset, amplitude and its drift; swings are among the parameters
    TurnParameters columns_at_;     ///< whose columns these are
    bool moved_ = false;            ///< far from where the columns are of
    double log_likelihood_ = 0.0;

    // As long as the record; all of it follows from the above.
    mutable TurnModel::Prediction prediction_;  ///< of the parameters as they are
    mutable std::vector<double> rest_;          ///< phases less all that is deterministic
    mutable std::vector<Column> columns_;
    mutable std::vector<double> innovations_, sd_rad_;
    mutable std::shared_ptr<Whitening> whitening_;
    mutable Eigen::MatrixXd basis_;  ///< orthonormal, of the model's own whitened columns in the rows that count
    mutable std::optional<std::vector<Estimate>> estimates_;
    mutable std::atomic<bool> is_ready_ = false, has_basis_ = false;
    mutable std::mutex getting_ready_, making_basis_, estimating_;
};

}  // namespace ringlock::closure
