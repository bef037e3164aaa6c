#include "analysis/closure/decide/verdict.hpp"

#include <algorithm>
#include <string_view>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/decide/evidence.hpp"

namespace ringlock::closure {

std::string_view name_of(Verdict verdict) {
    switch (verdict) {
        case Verdict::nothing_missing:
            return "nothing_missing";
        case Verdict::closed:
            return "closed";
        case Verdict::unexplained:
            break;
    }
    return "unexplained";
}

std::string experiment_for(const effects::Effect& effect, const std::vector<const effects::Effect*>& others) {
    std::vector<const effects::Effect*> all = others;
    all.push_back(&effect);
    const auto count = [&](auto&& is_such) { return std::count_if(all.begin(), all.end(), is_such); };
    const auto follow = [&](effects::Follows quantity) {
        return count([quantity](const effects::Effect* e) { return e->follows() == quantity; }) > 0;
    };
    if (count([](const effects::Effect* e) { return on_samples(*e) == OnSamples::angle_line; }) > 0) {
        return "declare the dither's frequency if the record does not, "
               "or record with another dither frequency or sampling rate";
    }
    if (follow(effects::Follows::temperature)) {
        return "record with a temperature that does not follow time: constant, then stepped up and down";
    }
    if (follow(effects::Follows::input_rate)) return "record at three input rates or more, of both signs";
    if (count([](const effects::Effect* e) { return configured_by(*e).dither_shape; }) > 1) {
        return "record the accelerations on both sides of the turns";
    }
    if (count([](const effects::Effect* e) { return configured_by(*e).coupling; }) > 0) {
        return "record with more injected noise, so that all phases occur at all turns, or for longer";
    }
    const auto changes_kicks = [](const effects::Effect* e) {
        return e->changes().threshold || e->changes().coupling_phase;
    };
    if (count(changes_kicks) > 0) {
        return "record the turns of the dither, with less noise or for longer on both sides of the change: the kicks "
               "of the lock-in show whether the coupling changed";
    }
    if (follow(effects::Follows::time) || count([](const effects::Effect* e) { return is_random_rate(*e); }) > 0) {
        return "record for longer: their Allan deviations and their trends separate with the averaging time";
    }
    return "record for longer";
}

Verdict verdict_of(const Closure& closure) {
    if (closure.unexplained) return Verdict::unexplained;
    return closure.steps.empty() ? Verdict::nothing_missing : Verdict::closed;
}

}  // namespace ringlock::closure
