#pragma once
#include <array>

#include "analysis/noise/spectrum.hpp"

namespace ringlock::noise {

/// Which terms a model has.
struct Model {
    std::array<bool, term_count> has{};
    bool ramp = false;
    bool restricted =
        false;  ///< likelihood of what the ramp leaves free (REML): not for comparing models with and without it
};

/// A model at the maximum of its likelihood.
struct Maximum {
    TermValues theta{};          ///< variances, see shapes(); 0 where not in the model
    double ramp = 0.0;           ///< rate gained per sample
    double ramp_variance = 0.0;  ///< of that, under this model
    double deviance = 0.0;       ///< -2 ln L up to a constant of the record
    std::array<std::array<double, term_count>, term_count> covariance{};  ///< of theta, inverse Fisher information
    std::array<double, 2> corner{};  ///< expected end errors, even and odd coefficients
};

/// Gaussian likelihood of a cosine spectrum whose coefficients are independent but for two directions.
///
/// White rate noise, random walk and differenced white angle noise without its unmatched end errors are exactly
/// diagonal in this basis, flicker nearly. The end errors add theta_Q (u u^T) among the even and among the odd
/// coefficients, taken into account exactly (matrix inversion and determinant lemmas); the ramp is a regressor, at its
/// generalised least-squares value. Fisher scoring with non-negative variances; no random numbers, so the same record
/// always gives the same answer.
class Likelihood {
   public:
    explicit Likelihood(const Spectrum& spectrum) : bins_(spectrum.bins) {}

    /// Maximum over the terms of the model. `fixed` < term_count holds that term at fixed_value. `start`: where to
    /// begin.
    Maximum maximise(const Model& model, const TermValues* start = nullptr, std::size_t fixed = term_count,
                     double fixed_value = 0.0) const;

   private:
    struct State;
    State evaluate(const TermValues& theta, const Model& model, bool derivatives) const;
    TermValues first_guess(const Model& model) const;

    const std::vector<Bin>& bins_;
};

}  // namespace ringlock::noise
