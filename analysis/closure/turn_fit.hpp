#pragma once
#include <Eigen/Dense>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "analysis/closure/turn_model.hpp"

namespace ringlock::closure {

/// Which turns count: 1 or 0 each.
using Rows = std::vector<std::uint8_t>;

/// A parameter as fitted; of the base model where `effect` is empty.
struct Estimate {
    std::string effect, name;
    double value = 0.0;
    double sd = 0.0;
    std::string text = {};  ///< a name in place of a number
};

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
    TurnFit(const TurnModel& model, const TurnParameters& start, Rows rows, Effects effects = Effects::fitted);
    TurnFit(const TurnFit&) = delete;  // the filter refers to what the fit holds
    TurnFit& operator=(const TurnFit&) = delete;

    const TurnModel& model() const { return *model_; }
    const TurnParameters& parameters() const { return parameters_; }
    /// Base parameters and those of effects, with standard errors.
    std::vector<Estimate> estimates() const;
    /// Of the phases that count and of the radii of the quadrature.
    double log_likelihood() const { return log_likelihood_; }
    const Rows& rows() const { return rows_; }

    /// Innovations of all turns over their standard deviations, and these [rad].
    const std::vector<double>& innovations() const { return innovations_; }
    const std::vector<double>& sd_rad() const { return sd_rad_; }

    /// Regression of the innovations that count on further series of phase, whitened and freed of what the model's own
    /// parameters could take of them: estimates, covariance and the chi-squared of all together.
    struct Score {
        Eigen::VectorXd value;
        Eigen::MatrixXd covariance;
        double chi2 = 0.0;
        int rank = 0;
    };
    Score score(const std::vector<std::vector<double>>& series) const;
    /// That regression with the noise fitted anew beside it.
    struct Regression {
        double gain = 0.0;  ///< of the log-likelihood
        Eigen::VectorXd value;
    };
    Regression regress(const std::vector<std::vector<double>>& series) const;
    /// One series whitened and freed likewise, rows that do not count zero.
    Eigen::VectorXd whitened(const std::vector<double>& series) const;
    Eigen::VectorXd residual() const;
    /// One series whitened, and no more.
    std::vector<double> whitened_alone(const std::vector<double>& series) const { return whitening_->apply(series); }

    /// Twice the gain of the log-likelihood by a random effect, and its standard deviation (of the parameter of that
    /// role), all else as fitted.
    struct Spread {
        double deviation = 0.0;
        double chi2 = 0.0;
    };
    Spread spread(const ActiveEffect& effect, const std::string& parameter, double most) const;

   private:
    struct Column {
        std::string effect, name;
        std::vector<double> series;
    };
    void fit_deterministic();
    void climb();
    void fit_noise();
    void try_other_noise();
    void try_noise(std::size_t knob, double value);
    TurnParameters with_noise_of(const TurnParameters& start, const std::vector<double>& rest) const;
    /// The series whitened, rows that do not count zero.
    Eigen::VectorXd counted(const Whitening& whitening, const std::vector<double>& series) const;
    double longest_share(const Eigen::VectorXd& step) const;
    void take(const Eigen::VectorXd& step);
    void set_rest(const TurnModel::Prediction& prediction, const std::vector<Column>& columns);
    double squares_left(const std::vector<Column>& columns, const Whitening& whitening);
    std::vector<Column> columns(const TurnModel::Prediction& prediction) const;
    void finish();
    Eigen::MatrixXd whitened_columns(Eigen::VectorXd& scale) const;  ///< of norm one, scale times as long
    void add_noise_estimates(std::vector<Estimate>& estimates) const;
    void add_priors(const Eigen::VectorXd& scale, Eigen::MatrixXd& normal, Eigen::VectorXd* right) const;
    double objective(const TurnParameters& parameters, const std::vector<double>& rest) const;

    /// How many of the columns, which those of effects come last of, are solved for.
    std::size_t solved(const std::vector<Column>& all) const;

    const TurnModel* model_;
    TurnParameters parameters_;
    Rows rows_;
    Effects effects_;
    std::vector<double> nuisance_;  ///< offset, amplitude and its drift
    TurnModel::Prediction prediction_;
    std::vector<double> rest_;  ///< phases less all that is deterministic
    std::vector<Column> columns_;
    std::vector<double> innovations_, sd_rad_;
    double log_likelihood_ = 0.0;
    Eigen::MatrixXd basis_;  ///< orthonormal, of the model's own whitened columns in the rows that count
    std::shared_ptr<Whitening> whitening_;
};

}  // namespace ringlock::closure
