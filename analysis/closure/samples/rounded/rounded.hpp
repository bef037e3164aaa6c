#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "analysis/closure/samples/fit/figures.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/fit/score.hpp"
#include "analysis/closure/samples/rounded/maximum.hpp"
#include "analysis/closure/samples/rounded/unrounding.hpp"

namespace ringlock::closure {

/// Increments of a record as measured, and imputed increments in their place where steps are so large that their
/// rounding follows the angle: fits and tests then see normal noise.
class RoundedSamples {
   public:
    explicit RoundedSamples(SampleSeries& series) : series_(series), measured_(series.increment) {}

    /// Puts the measured increments back.
    void restore();
    bool drawn() const { return step_ > 0.0; }
    double step_arcsec() const { return step_; }
    /// Whether the rounding to such steps follows the angle, given the residual of the fit without the variance of the
    /// steps.
    static bool show(const SampleFit& fit, double step_arcsec);
    /// Imputes the increments; the fit is to the imputed ones.
    std::shared_ptr<SampleFit> begin(const SampleFit& fit, double step_arcsec);
    /// Imputes the increments again by another model. Imputations and fits to them alternate, as a stochastic
    /// approximation of the maximum of the likelihood (Celeux and Diebolt, Comput. Stat. Q. 2, 73, 1985); then the
    /// likelihood of the measured increments is maximised.
    std::shared_ptr<SampleFit> draw(std::shared_ptr<SampleFit> fit, int rounds);
    /// Whether the errors of the predictions of the measured increments agree with their variances.
    ResidualTest test(const SampleFit& fit) const;
    /// Prediction errors and likelihood of the measured increments.
    SampleScore score_of(const SampleFit& fit, const Rows& reported) const;
    /// Mean over several imputations by the most likely model, with the spread between them in the standard errors
    /// (Rubin, "Multiple Imputation for Nonresponse in Surveys", 1987, equation 3.1.5), and with the curvature of the
    /// likelihood of the measured increments.
    SampleFigures figures_of(const SampleFit& fit, const std::function<SampleFigures(const SampleFit&)>& figures);

   private:
    std::shared_ptr<SampleFit> draw_by(const SampleModel& drawing, const SampleModel& model, const Rows& rows);
    double wander(const SampleFit& fit) const;
    SampleModel likeliest(const SampleFit& fit);
    const RoundedMaximum* near(const SampleModel& model) const;
    RoundedIncrements rounded() const { return {measured_, step_, filters_}; }

    SampleSeries& series_;
    const std::vector<double> measured_;
    double step_ = 0.0;
    std::size_t filters_ = 0;
    std::uint64_t draws_ = 0;
    std::optional<RoundedMaximum> maximum_;    ///< the last one
    std::optional<RoundedMaximum> wandering_;  ///< with a random walk that the model lacks
};

}  // namespace ringlock::closure
