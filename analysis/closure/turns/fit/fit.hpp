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

/// The change of the predicted phases for a unit of a parameter.
///
/// A part of the series may depend on the phase to which it is added: the lock-in before a turn, and the reading at the
/// turn. `slope` is its derivative by that phase, turn by turn; empty if no part depends on it. Such a series is
/// correlated with the innovations even if no effect is missing; |1 - before'| of the likelihood compensates for this,
/// together with `left` if the injected noise is not normal (NoiseShape). `kick` is the derivative of all that the turn
/// adds to the phases after it.
struct Regressor {
    Regressor(std::vector<double> of_series, std::vector<double> of_slope = {}, std::vector<double> of_kick = {},
              std::vector<double> of_left = {})
        : series(std::move(of_series)),
          slope(std::move(of_slope)),
          kick(std::move(of_kick)),
          left(std::move(of_left)) {}
    std::vector<double> series, slope, kick, left;

    /// Subtracts `value` times the series from the residual phases and adds the slopes to the frame, likewise.
    void take(double value, std::vector<double>& rest, TurnFrame& frame) const;
};

/// The difference of the phases of two models, over `per`.
Regressor difference(TurnModel::Prediction with, const TurnModel::Prediction& without, double per);

/// Phases for a unit of the cosine, of the sine and of the frequency of an oscillation of the amplitude [frequency:
/// rad/Hz].
std::array<std::vector<double>, 3> amplitude_by(const AmplitudeSwing& swing, const TurnSeries& series);

/// The model fitted by maximum likelihood to the turns that count.
///
/// The filter passes through all turns; the likelihood is that of the innovations of those that count, each given all
/// phases before it. Deterministic parameters are fitted by Gauss-Newton in the whitened phases, standard deviations by
/// the likelihood of the residual phases (Harvey, "Forecasting, Structural Time Series Models and the Kalman Filter",
/// 1989, 3.4).
class TurnFit {
   public:
    /// Treatment of the parameters of effects. If held, they stay as given and all others are fitted, and the standard
    /// errors are those of Fisher's information at these values.
    enum class Effects { fitted, held };
    /// \param needed  log-likelihood below which accuracy does not matter: a fit that will not reach it is not
    ///        completed
    TurnFit(const TurnModel& model, const TurnParameters& start, Rows rows, Effects effects = Effects::fitted,
            double needed = -std::numeric_limits<double>::infinity());
    TurnFit(const TurnFit&) = delete;  // the filter refers to members of the fit
    TurnFit& operator=(const TurnFit&) = delete;

    /// The same fit without noise that explains little, for scores: such noise may have absorbed an effect. Null if all
    /// noise explains much.
    std::unique_ptr<TurnFit> with_less_noise() const;
    /// The same fit with the noise of these parameters, and nothing fitted again, for scores.
    std::unique_ptr<TurnFit> with_noise(const TurnParameters& of) const;

    /// The reading's errors given all phases, if these determine them so well that the kicks should be linearised about
    /// the estimate instead of the phases that were read; else empty.
    ReadingErrors reading_errors() const;

    /// Releases all memory of the length of the record. It is computed again from the parameters on demand, bit for
    /// bit, so of many fits only those in use need memory. Must not be called while others use references to these
    /// arrays.
    void release() const;

    const TurnModel& model() const { return *model_; }
    const TurnParameters& parameters() const { return parameters_; }
    const TurnModel::Prediction& prediction() const { return ready().prediction_; }
    /// Base parameters and those of effects, with standard errors.
    const std::vector<Estimate>& estimates() const;
    /// Log-likelihood of the phases that count and of the radii of the quadrature.
    double log_likelihood() const { return log_likelihood_; }
    const Rows& rows() const { return rows_; }

    /// Innovations of all turns over their standard deviations, and the standard deviations of the phases [rad].
    const std::vector<double>& innovations() const { return ready().innovations_; }
    const std::vector<double>& sd_rad() const { return ready().sd_rad_; }

    /// Regression of the innovations that count on further series of phases, which are whitened and projected off the
    /// model's own parameters: estimates, covariance and the chi-squared of all series together.
    struct Score {
        Eigen::VectorXd value;
        Eigen::MatrixXd covariance;
        double chi2 = 0.0;
        int rank = 0;
    };
    Score score(const std::vector<Regressor>& regressors) const;
    /// The same for `count` series, each computed when it is whitened and released afterwards.
    Score score(std::size_t count, const std::function<Regressor(std::size_t)>& regressor) const;
    /// Normal equations of the regression on `count` series without slopes, which pass through the filter in pieces:
    /// for very many series.
    struct Products {
        Eigen::MatrixXd squares;  ///< products of the whitened and projected series with each other
        Eigen::VectorXd right;    ///< products of the series with the residual
    };
    using Piece = std::function<void(std::size_t series, std::size_t first_turn, std::span<double> values)>;
    Products products(std::size_t count, const Piece& piece) const;
    Score score_pieces(std::size_t count, const Piece& piece) const { return score_of(products(count, piece)); }
    /// That regression with the noise fitted again, starting from the model's own noise or from a given one.
    struct Regression {
        double gain = 0.0;  ///< of the log-likelihood
        Eigen::VectorXd value;
        TurnParameters noise = {};  ///< the model's parameters with the noise fitted again
    };
    Regression regress(const std::vector<Regressor>& regressors) const { return regress(regressors, parameters_); }
    Regression regress(const std::vector<Regressor>& regressors, const TurnParameters& noise) const;
    /// One series whitened and projected likewise, and the residual: their product is the derivative of the
    /// log-likelihood. Rows that do not count are zero. An equal number of rows for |1 - before'| is appended: they are
    /// -1 in the residual and the slope over 1 - before' in the series, so that their squares are the contribution to
    /// the information.
    Eigen::VectorXd whitened(const Regressor& regressor) const;
    Eigen::VectorXd residual() const;
    /// One series whitened, without projection.
    std::vector<double> whitened_alone(const std::vector<double>& series) const {
        return ready().whitening_->apply(series);
    }

    /// Twice the gain of the log-likelihood by a random effect, and its standard deviation (the parameter of that
    /// role), with all other parameters as fitted.
    struct Spread {
        double deviation = 0.0;
        double chi2 = 0.0;
    };
    Spread spread(const ActiveEffect& effect, const std::string& parameter, double most) const;

   private:
    static constexpr std::size_t swing_columns = 3;  ///< of an oscillating amplitude: two amplitudes and the frequency
    static constexpr std::size_t base_columns = 2;   ///< bias and threshold, after the nuisances

    TurnFit(const TurnFit& of, TurnParameters parameters, int passes);  ///< with the noise of these parameters
    static Score score_of(const Products& products);
    Score score_whitened(std::size_t count, const std::function<Eigen::VectorXd(std::size_t)>& column) const;
    struct Column {
        std::string effect, name;
        Regressor of;
    };
    void fit_nuisances();
    void fit_deterministic(int most);  ///< passes
    /// Normal equations of a step of Gauss-Newton, in units of the columns' norms.
    struct Equations {
        Eigen::MatrixXd normal;
        Eigen::VectorXd right, scale;
    };
    Equations equations(const Whitening& whitening, bool guessed) const;
    void follow_gains(const Whitening& whitening, Eigen::MatrixXd& x, Eigen::VectorXd& scale) const;
    /// Takes such a step, shortened or damped if needed, that decreases the squares under a guessed noise or else the
    /// objective.
    /// \return whether another step may gain
    bool go_down(const Equations& equations, const Whitening* guessed);
    void maximise();
    bool place_times();
    void fit_noise();
    void try_other_noise();
    void try_wander();
    void try_from(const TurnParameters& other);
    void shape_noise();
    TurnParameters with_noise_of(const TurnFrame& frame, const TurnParameters& start,
                                 const std::vector<double>& rest) const;
    /// The series whitened, with zero in rows that do not count, and the rows of |1 - before'| below it.
    Eigen::VectorXd counted(const Whitening& whitening, const TurnFrame& frame, const Regressor& regressor) const;
    Eigen::VectorXd counted(const Whitening& whitening, const std::vector<double>& rest) const;
    /// The same for several series, as columns that are divided by their norms.
    using RegressorAt = std::function<const Regressor&(std::size_t)>;
    Eigen::MatrixXd counted(const Whitening& whitening, const TurnFrame& frame, std::size_t count,
                            const RegressorAt& regressor, Eigen::VectorXd& norms) const;
    Eigen::VectorXd below(const std::vector<double>& white, double value) const;
    void hold_back(const Eigen::VectorXd& scale, Eigen::MatrixXd& normal) const;
    void take(const Eigen::VectorXd& step);
    void set_rest(const TurnModel::Prediction& prediction) const;
    double squares_left(const Whitening& whitening) const;
    double objective_at(const TurnModel::Prediction& prediction) const;  ///< with the priors
    double slope_of_objective(const TurnFrame& frame, const std::vector<double>& rest, const Regressor& of,
                              double step) const;
    /// Derivatives of the phases by the parameters `at`, whose prediction is given.
    std::vector<Column> columns(const TurnParameters& at, const TurnModel::Prediction& prediction) const;
    void find_columns();
    void finish();
    void whiten() const;
    const TurnFit& ready() const;
    const Eigen::MatrixXd& basis() const;
    std::vector<Estimate> estimate() const;
    Eigen::MatrixXd whitened_columns(Eigen::VectorXd& scale) const;  ///< of unit norm; `scale` has the norms
    Eigen::MatrixXd information(Eigen::VectorXd& scale) const;       ///< of the same columns, with the priors
    void add_noise_estimates(std::vector<Estimate>& estimates) const;
    /// Deviations of bias and threshold from their priors in standard deviations, and these standard deviations.
    struct Prior {
        double bias, threshold, bias_sd_deg_h, threshold_sd_deg_h;
    };
    Prior prior_of(const TurnParameters& parameters) const;
    void add_priors(const Eigen::VectorXd& scale, Eigen::MatrixXd& normal, Eigen::VectorXd* right) const;
    double objective(const TurnParameters& parameters, const std::vector<double>& rest) const {
        return objective(prediction_.frame, parameters, rest);
    }
    double objective(const TurnFrame& frame, const TurnParameters& parameters, const std::vector<double>& rest) const;
    /// The same with the noise of each of these parameters.
    std::vector<double> objectives(const TurnFrame& frame, const std::vector<TurnParameters>& parameters,
                                   const std::vector<double>& rest) const;

    /// The columns are in this order: nuisances, base parameters, those of effects. The functions count those of the
    /// first kind, and those that are fitted.
    std::size_t nuisances() const;
    std::size_t solved() const;

    const TurnModel* model_;
    TurnParameters parameters_;
    Rows rows_;
    Effects effects_;
    double needed_;                 ///< log-likelihood
    std::vector<double> nuisance_;  ///< offset, amplitude and its drift; oscillations of it are among the parameters
    TurnParameters columns_at_;     ///< parameters at which the columns were computed
    bool moved_ = false;            ///< the parameters are far from columns_at_
    double log_likelihood_ = 0.0;

    // Arrays of the length of the record, which follow from the members above.
    mutable TurnModel::Prediction prediction_;  ///< of the present parameters
    mutable std::vector<double> rest_;          ///< residual phases: the phases less the deterministic part
    mutable std::vector<Column> columns_;
    mutable std::vector<double> innovations_, sd_rad_;
    mutable std::shared_ptr<Whitening> whitening_;
    mutable Eigen::MatrixXd basis_;  ///< orthonormal basis of the model's own whitened columns in the rows that count
    mutable std::optional<std::vector<Estimate>> estimates_;
    mutable std::atomic<bool> is_ready_ = false, has_basis_ = false;
    mutable std::mutex getting_ready_, making_basis_, estimating_;
};

}  // namespace ringlock::closure
