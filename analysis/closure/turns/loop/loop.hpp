#pragma once
#include <memory>
#include <optional>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/turns/fit/fitted.hpp"
#include "analysis/closure/turns/loop/choice.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// The closed loop on one record of turns.
class TurnLoop {
   public:
    /// The record must outlive the loop. Throws InputError if it has too few turns for a fit.
    TurnLoop(const record::Record& record, const Monitor& monitor);

    Closure run();

   private:
    void fit_base();
    void go_on_with(std::shared_ptr<Fitted> fitted);
    bool add_one();
    bool add_amplitude(const Ranking& ranking, const Choice& choice);
    bool library_explains_most(Ranking& ranking, Choice& choice) const;
    void take(const Choice& choice);
    void confound_with_partners(const Choice& choice, Step& step);
    void read_shape_again();
    void drop_needless();
    void test_residual();
    void verify_model();
    void take_back_random();
    void finish();

    TurnProblem problem_;
    const Monitor& monitor_;
    Closure closure_;
    std::shared_ptr<Fitted> now_;
    double base_log_likelihood_ = 0.0;
    /// The loop before the first effect that was selected because of a random rate.
    struct Earlier {
        std::shared_ptr<Fitted> now;
        std::vector<Step> steps;
        const effects::Effect* effect;
    };
    std::optional<Earlier> earlier_;
    /// Partners of the effects that were added last, which are expected next
    std::vector<const effects::Effect*> partners_;
};

/// Runs the loop. Throws InputError if the record does not suffice.
Closure close_turns(const record::Record& record, const Monitor& monitor = {});

/// The model with these effects fitted, without any search, as a loop that knows the true effects would. The effects
/// start from the given values.
Closure fit_turns(const record::Record& record, const std::vector<ActiveEffect>& effects);

/// Standard errors of the parameters of effects at the given values, which are those of the true model: by Fisher's
/// information in the whole record.
std::vector<Estimate> information_on_turns(const record::Record& record, const std::vector<ActiveEffect>& effects);

}  // namespace ringlock::closure
