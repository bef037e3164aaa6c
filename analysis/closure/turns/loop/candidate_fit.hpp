#pragma once
#include <memory>

#include "analysis/closure/turns/fit/fitted.hpp"
#include "analysis/closure/turns/screen/score_tests.hpp"

/// The full fit of one candidate and the evidence for it.
namespace ringlock::closure {

/// Evidence that a score test predicts: gain of the log-likelihood less the cost of its parameters and of its search
/// [nats].
double predicted_evidence(const Candidate& candidate);

/// Evidence of an effect in a full fit [nats]: the gain of the log-likelihood with the amplitudes integrated out, and
/// times and frequencies as well (Laplace), as the likelihood of a random rate has its path integrated out.
double evidence_of(double gain, const Fitted& fitted, const effects::Effect& effect);

/// Probability by chance of the gain of a fit with the candidate over one without it, with the search over times and
/// frequencies included.
double p_of_fit(const Fitted& fitted, const Fitted& without, const Candidate& candidate);

/// Full fits of the model with one more effect, with all parameters free, from several starting points; the most likely
/// one is kept.
class CandidateFit {
   public:
    /// All arguments must outlive it.
    CandidateFit(const TurnProblem& problem, const Fitted& now, const Candidate& candidate);

    /// Starts from the score test's estimate.
    /// \param alike   a model with another random rate in place of this one, or null
    /// \param needed  gain of the log-likelihood below which accuracy does not matter [nats]
    void begin(const Fitted* alike, double needed);

    /// Starts from the fit of a smaller effect that the candidate contains, with the candidate in its place. Starts
    /// from the score test's estimate only if that gains much less than predicted.
    void begin_as(const effects::Effect& smaller, const Fitted& fitted, double needed);

    /// Starts from the start of the model as well if the rate is strong. It may have biased the other parameters even
    /// if the fit gained most of the predicted gain.
    void again_if_strong();

    /// Null if no motion of a gyro with such parameters can be followed.
    const std::shared_ptr<Fitted>& best() const { return best_; }

   private:
    bool gained_most() const;
    void from(const TurnParameters& start);
    void anew(const Fitted* alike);
    TurnParameters with_share(double share) const;
    bool gained(double least) const { return best_ && gain_over(*best_, now_) >= least; }

    const TurnProblem& problem_;
    const Fitted& now_;
    const Candidate& candidate_;
    TurnParameters start_;
    bool strong_rate_;
    double needed_ = 0.0;  ///< log-likelihood
    bool anew_ = false;
    std::shared_ptr<Fitted> best_;
};

}  // namespace ringlock::closure
