#pragma once
#include <limits>
#include <memory>

#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/closure/turns/model/series.hpp"
#include "analysis/record/record.hpp"

/// A record of turns read, prepared and fitted.
namespace ringlock::closure {

/// The phases of a record, joined from count and quadrature, the record prepared for a fit, and what foretells them.
struct TurnReading {
    TurnReading(const record::Record& record, const gyro::Ellipse& ellipse, bool count_again);

    JoinedPhase joined;
    TurnSeries series;
    TurnModel model;  ///< nothing but the scatter of the reading's errors known
};

/// A model of a record, fitted, with the reading that it was fitted to.
struct Fitted {
    std::shared_ptr<const TurnReading> reading;
    std::unique_ptr<TurnModel> model;  ///< where it is not the reading's
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

/// A record of turns and the rows that models are fitted to. Every fit of the record starts here, so that readings are
/// made once and shared.
class TurnProblem {
   public:
    /// The record must outlive the problem and all fits.
    TurnProblem(const record::Record& record, Rows rows);

    /// The same record with all of its rows.
    TurnProblem whole() const;

    const record::Turns& turns() const { return *record_->turns; }
    const Rows& rows() const { return rows_; }

    /// The model with these effects fitted to the rows; from the record's declared device where `start` has no noise
    /// yet. Throws RunError where no motion of a gyro with such parameters can be followed.
    /// \param needed  log-likelihood below which nothing needs to be exact
    std::shared_ptr<Fitted> fit(const TurnParameters& start, TurnFit::Effects effects = TurnFit::Effects::fitted,
                                double needed = -std::numeric_limits<double>::infinity()) const;

    /// The same, or null where no motion can be followed.
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
