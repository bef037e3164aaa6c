#pragma once
#include <limits>
#include <memory>

#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/closure/turns/model/series.hpp"
#include "analysis/record/record.hpp"

/// A record of turns read, prepared and fitted.
namespace ringlock::closure {

/// A model of the record with all that it was fitted to.
struct Fitted {
    JoinedPhase joined;
    TurnSeries series;
    std::unique_ptr<TurnModel> model;
    std::unique_ptr<TurnFit> fit;
};

/// The model with these effects fitted to the rows that count; from the record's declared device where `start` has no
/// noise yet.
/// \param needed  log-likelihood below which nothing needs to be exact
std::shared_ptr<Fitted> fit_record(const record::Record& record, const TurnParameters& start, const Rows& rows,
                                   TurnFit::Effects effects = TurnFit::Effects::fitted,
                                   double needed = -std::numeric_limits<double>::infinity());

/// The same from parameters that have noise, or none where no motion of a gyro with such parameters can be followed.
std::shared_ptr<Fitted> fit_or_none(const record::Record& record, const TurnParameters& start, const Rows& rows,
                                    double needed = -std::numeric_limits<double>::infinity());

}  // namespace ringlock::closure
