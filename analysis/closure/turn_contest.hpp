#pragma once
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "analysis/closure/hypotheses.hpp"
#include "analysis/closure/turn_fit.hpp"
#include "analysis/closure/turn_series.hpp"
#include "analysis/record/record.hpp"

/// Which effect of the library a record of turns supports most: the second half of what screening begins.
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

/// What the choice of one effect more among all of the library costs [nats].
double cost_of_choice();

/// Random rates can follow whatever the library does not have, more or less.
bool is_random_rate(const effects::Effect& effect);

/// Effects that change the kicks and that the phases alone tell of.
bool is_of_coupling(const effects::Effect& effect);

/// Probability of so large a gain of the log-likelihood by chance, by all parameters of the effect.
double p_of_gain(double gain, const effects::Effect& effect);
/// Whether that is rare enough for one of all effects of the library.
bool passes(double p_value);

/// An effect fitted in full.
struct Contender {
    Candidate candidate;
    std::shared_ptr<Fitted> fitted;
    double merit = 0.0;    ///< gain of the log-likelihood, its amplitudes integrated out, less its search
    double p_value = 1.0;  ///< of such a gain by chance, its search counted
};

/// Those that might explain something, no more than so many beside random rates, the likeliest first. Less than about
/// `matters` of merit makes no difference, so that it need not be told exactly.
struct Contest {
    std::vector<Contender> contenders;
    bool side = false;  ///< told by other columns than the phase
};
enum class Among { all, not_random };
Contest hold_contest(const record::Record& record, const Fitted& now, const Rows& rows, std::size_t most,
                     Among among = Among::all, double matters = 0.0);

/// An effect with the merit of what it is part of: itself or several.
struct Held {
    const effects::Effect* effect = nullptr;
    double merit = 0.0;
};

/// What to add, if anything.
struct Choice {
    const Contender* chosen = nullptr;
    double p_value = 1.0;    ///< beside what explains the record with it
    std::vector<Held> held;  ///< it and all that explain about as much
    bool on_random = false;  ///< it is a random rate, or was chosen with one beside it
    std::vector<std::string> confounded_with;
    std::vector<std::string> partners = {};  ///< what explains the rest, where several were chosen together
};

/// The likeliest where it passes, with all that are as likely tied to it. A random rate can follow two or three others
/// at once: where one is the likeliest, sets are tried before anything is taken.
Choice choose(const record::Record& record, const Contest& contest, const Rows& rows);

}  // namespace ringlock::closure
