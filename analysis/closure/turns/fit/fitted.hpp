#pragma once
#include <limits>
#include <memory>

#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/closure/turns/model/series.hpp"
#include "analysis/record/record.hpp"

/// A record of turns that is read, prepared and fitted.
namespace ringlock::closure {

/// The phases of a record, joined from count and quadrature, the record prepared for a fit, and the model that predicts
/// the phases.
struct TurnReading {
    TurnReading(const record::Record& record, const gyro::Ellipse& ellipse, bool count_again);

    JoinedPhase joined;
    TurnSeries series;
    TurnModel model;  ///< with no estimate of the reading's errors except their variance
};

/// A fitted model of a record, with the reading that it was fitted to.
struct Fitted {
    std::shared_ptr<const TurnReading> reading;
    std::unique_ptr<TurnModel> model;  ///< if it is not the reading's
    std::unique_ptr<TurnFit> fit;

    const JoinedPhase& joined() const { return reading->joined; }
    const TurnSeries& series() const { return reading->series; }
    const TurnParameters& parameters() const { return fit->parameters(); }
    double log_likelihood() const { return fit->log_likelihood(); }
};

/// Gain of the log-likelihood of one model over another one of the same rows [nats].
inline double gain_over(const Fitted& fitted, const Fitted& without) {
    return fitted.log_likelihood() - without.log_likelihood();
}

/// A record of turns and the rows to which models are fitted. Every fit of the record starts here, so that readings are
/// made once and shared.
class TurnProblem {
   public:
    /// The record must outlive the problem and all fits.
    TurnProblem(const record::Record& record, Rows rows);

    /// The same record with all of its rows.
    TurnProblem whole() const;

    const record::Turns& turns() const { return *record_->turns; }
    const Rows& rows() const { return rows_; }

    /// The model with these effects fitted to the rows. If `start` has no noise yet, the fit starts from the record's
    /// declared device. Throws RunError if no motion of a gyro with such parameters can be followed.
    /// \param needed  log-likelihood below which accuracy does not matter
    std::shared_ptr<Fitted> fit(const TurnParameters& start, TurnFit::Effects effects = TurnFit::Effects::fitted,
                                double needed = -std::numeric_limits<double>::infinity()) const;

    /// The same, or null if no motion can be followed.
    std::shared_ptr<Fitted> fit_or_none(const TurnParameters& start,
                                        double needed = -std::numeric_limits<double>::infinity()) const;

   private:
    class Readings;
    TurnProblem(const record::Record& record, Rows rows, std::shared_ptr<Readings> readings);

    const record::Record* record_;
    Rows rows_;
    std::shared_ptr<Readings> readings_;
};

}  // namespace ringlock::closure
