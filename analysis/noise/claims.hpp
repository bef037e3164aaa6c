#pragma once
#include "analysis/noise/decomposition.hpp"
#include "analysis/noise/fit.hpp"
#include "analysis/noise/model/likelihood.hpp"
#include "analysis/noise/model/subsets.hpp"

namespace ringlock::noise {

/// Which terms of a record are claimed, and how well each is known (docs/dev/allan-coefficients.md, "Claims").
class Claims {
   public:
    /// \param likelihood  of the noise of the parts; outlives the claims, as the parts do
    Claims(const Likelihood& likelihood, const Decomposition& parts, const Options& options);

    /// Terms of the model that the values are of.
    Mask terms() const { return terms_; }
    /// That model at its maximum.
    const Maximum& estimate() const { return estimate_; }
    /// Takes values and intervals from another likelihood; claims and limits stay those of the first.
    ///
    /// Lost samples that are filled in by the model of all terms carry the errors of terms that are not there: the
    /// values of the terms that are claimed come from a likelihood of samples filled in by these terms alone.
    void estimate_from(const Likelihood& values);

    void describe(double tau0_s, NoiseFit& out) const;

   private:
    Maximum restricted(const Likelihood& likelihood, Model& model, Mask mask) const;
    Prices prices_at(double significance) const;
    Subsets fits_of(const Options& options) const;
    bool claimed(Mask bit) const;
    void describe_ramp(const Maximum& of_full, double per_hour, Coefficient& ramp) const;
    Correlated correlated_noise(double tau0_s) const;
    Sinusoid sinusoid(const Line& line, double evidence, double tau0_s) const;
    Pooling pooling(double tau0_s) const;

    const Likelihood& likelihood_;
    const Likelihood* values_;  ///< of which the values are; the same where no sample is lost
    const Decomposition& parts_;
    Prices prices_;
    Subsets fits_;
    Mask best_ = 0;      ///< subset of least deviance plus prices
    Mask arw_best_ = 0;  ///< the same of those with angle random walk
    Mask claimed_ = 0;
    Mask terms_ = 0;
    Model model_;  ///< what the values are estimated with; restricted, for a ramp takes a degree of freedom of few
    Maximum estimate_;
};

}  // namespace ringlock::noise
