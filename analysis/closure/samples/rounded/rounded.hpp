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
#include "analysis/closure/samples/rounded/summit.hpp"
#include "analysis/closure/samples/rounded/unrounding.hpp"

namespace ringlock::closure {

/// The increments of a record as they were measured, and in their place, where they come in steps whose rounding shows
/// the angle, increments that are drawn from them: all that fits and tests then sees noise that is normal.
class RoundedSamples {
   public:
    explicit RoundedSamples(SampleSeries& series) : series_(series), measured_(series.increment) {}

    /// Those that were measured.
    void restore();
    bool drawn() const { return step_ > 0.0; }
    double step_arcsec() const { return step_; }
    /// Whether such steps show the angle beside what is left of the fit's noise without their variance.
    static bool show(const SampleFit& fit, double step_arcsec);
    /// Draws them: the fit to what was drawn.
    std::shared_ptr<SampleFit> begin(const SampleFit& fit, double step_arcsec);
    /// The same, drawn by another model: what was rounded is drawn by it and the model fitted to that, a stochastic
    /// approximation of the likeliest (Celeux and Diebolt, Comput. Stat. Q. 2, 73, 1985), which is then looked for by
    /// what was rounded itself.
    std::shared_ptr<SampleFit> draw(std::shared_ptr<SampleFit> fit, int rounds);
    /// Whether the measured increments are off what is foretold of them by as much as that says.
    ResidualTest test(const SampleFit& fit) const;
    /// Of the measured increments.
    SampleScore score_of(const SampleFit& fit, const Rows& reported) const;
    /// The mean of several, each of increments that were drawn by the likeliest model; what they are apart counted
    /// (Rubin, "Multiple Imputation for Nonresponse in Surveys", 1987, equation 3.1.5), and how sharp the likelihood of
    /// what was rounded is.
    SampleFigures figures_of(const SampleFit& fit, const std::function<SampleFigures(const SampleFit&)>& figures);

   private:
    std::shared_ptr<SampleFit> draw_by(const SampleModel& drawing, const SampleModel& model, const Rows& rows);
    double wander(const SampleFit& fit) const;
    SampleModel likeliest(const SampleFit& fit);
    const RoundedSummit* near(const SampleModel& model) const;
    RoundedIncrements rounded() const { return {measured_, step_, filters_}; }

    SampleSeries& series_;
    const std::vector<double> measured_;
    double step_ = 0.0;
    std::size_t filters_ = 0;
    std::uint64_t draws_ = 0;
    std::optional<RoundedSummit> summit_;     ///< that was found last
    std::optional<RoundedSummit> wandering_;  ///< beside a walk that the model lacks
};

}  // namespace ringlock::closure
