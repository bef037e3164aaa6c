#pragma once
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/turns/fit/fitted.hpp"
#include "analysis/closure/turns/screen/score_tests.hpp"
#include "analysis/record/record.hpp"

/// Which effect of the library a record of turns supports most: the second half of what screening begins.
namespace ringlock::closure {

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
