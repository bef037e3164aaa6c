#pragma once
#include <array>

#include "analysis/noise/model/spectrum.hpp"

namespace ringlock::noise {

/// Which terms a model has.
struct Model {
    std::array<bool, term_count> has{};
    bool ramp = false;
    bool restricted =
        false;  ///< likelihood of what the ramp leaves free (REML): not for comparing models with and without it
};

/// Variances of the terms, see shapes(), 0 where not in the model, and ln(T/tau0) of the correlated one.
inline constexpr std::size_t log_time = term_count;
inline constexpr std::size_t parameter_count = term_count + 1;
using Parameters = std::array<double, parameter_count>;

/// A model at the maximum of its likelihood.
struct Maximum {
    Parameters theta{};
    double ramp = 0.0;           ///< rate gained per sample
    double ramp_variance = 0.0;  ///< of that, under this model
    double ramp_degrees = 1e9;   ///< degrees of freedom that this variance rests on (Satterthwaite)
    double deviance = 0.0;       ///< -2 ln L up to a constant of the record
    std::array<Parameters, parameter_count> covariance{};  ///< of theta, inverse Fisher information
    std::array<double, 2> corner{};                        ///< expected end errors, even and odd coefficients
    /// Factors by which missing samples increase the variances of the parameters, see LostInformation; covariance and
    /// ramp_variance include them.
    Parameters inflation = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0};
};

/// Gaussian likelihood of a cosine spectrum whose coefficients are independent but for two directions.
///
/// White rate noise, random walk and differenced white angle noise without its unmatched end errors are exactly
/// diagonal in this basis, flicker and correlated noise nearly. The end errors add theta_Q (u u^T) among the even and
/// among the odd coefficients, taken into account exactly (matrix inversion and determinant lemmas); the ramp is a
/// regressor, at its generalised least-squares value. Fisher scoring with non-negative variances and a correlation time
/// within log_times(); no random numbers, so the same record always gives the same answer.
class Likelihood {
   public:
    explicit Likelihood(const Spectrum& spectrum)
        : bins_(spectrum.bins), samples_(spectrum.samples), lost_(spectrum.lost) {}

    /// Maximum over the parameters of the model. `fixed` < parameter_count holds that one at fixed_value. `start`:
    /// where to begin; a model with correlated noise, whose likelihood has several maxima over its time, wants it.
    Maximum maximise(const Model& model, const Parameters* start = nullptr, std::size_t fixed = parameter_count,
                     double fixed_value = 0.0) const;
    const std::vector<Bin>& bins() const { return bins_; }
    std::size_t samples() const { return samples_; }
    const LostInformation* lost() const { return lost_.get(); }

   private:
    struct State;
    State evaluate(const Parameters& theta, const Model& model, bool derivatives) const;
    Parameters first_guess(const Model& model) const;

    const std::vector<Bin>& bins_;
    std::size_t samples_;
    std::shared_ptr<const LostInformation> lost_;
};

}  // namespace ringlock::noise
