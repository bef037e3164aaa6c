#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/report/closed_scenario.hpp"
#include "analysis/closure/turns/loop/loop.hpp"
#include "analysis/closure/turns/model/effect_roles.hpp"
#include "analysis/instrument/simulate.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/text/parse.hpp"
#include "tests/closure/suite/device.hpp"
#include "tests/closure/suite/suite.hpp"

/// How an answer of the closed loop is judged by the truth.
namespace ringlock::test::closure {

using ringlock::closure::ActiveEffect;
using ringlock::closure::Closure;
using ringlock::closure::Estimate;
using ringlock::closure::fit_turns;
using ringlock::closure::Verdict;
using ringlock::closure::Where;

double gain_asked(const std::vector<std::string>& missing, double library) {
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    double least = std::numeric_limits<double>::infinity();
    for (const std::string& effect : missing) {
        const effects::Effect& of = *effects::find(effect);
        if (ringlock::closure::estimated_from_other_columns(of)) return none;
        const auto parameters = of.parameters();
        const auto freedom = std::count_if(parameters.begin(), parameters.end(), [](const effects::Parameter& p) {
            return p.role != effects::Role::time && p.role != effects::Role::frequency;
        });
        const boost::math::chi_squared chi2(static_cast<double>(freedom));
        const double level = ringlock::closure::options.level_of_effects / library;
        least = std::min(least, 0.5 * boost::math::quantile(boost::math::complement(chi2, level)));
    }
    return std::isfinite(least) ? least : none;
}

namespace {

double deviation_of(const Estimate& estimate, double truth) {
    double off = estimate.value - truth;
    if (estimate.name == "phase_rad") off = std::remainder(off, units::two_pi);
    return off / estimate.sd;
}

/// True effects that no step holds. One that names a true effect holds that or one that it is tied to; where it names
/// another, all that is tied to that may stand in its place together.
std::vector<std::string> not_held(const std::set<std::string>& true_effects,
                                  const std::vector<ringlock::closure::Step>& steps) {
    const std::vector<std::string> wanted(true_effects.begin(), true_effects.end());
    std::vector<std::string> least = wanted;
    std::vector<std::string> lacking;
    std::vector<bool> taken(steps.size());
    const auto hold = [&](const auto& self, std::size_t k) -> void {
        if (k == wanted.size()) {
            if (lacking.size() < least.size()) least = lacking;
            return;
        }
        for (std::size_t s = 0; s < steps.size(); ++s) {
            const auto& others = steps[s].confounded_with;
            const bool among = std::any_of(others.begin(), others.end(),
                                           [&](const auto* other) { return other->name() == wanted[k]; });
            if (taken[s] || (steps[s].name() != wanted[k] && !among)) continue;
            taken[s] = true_effects.contains(steps[s].name());
            self(self, k + 1);
            taken[s] = false;
        }
        lacking.push_back(wanted[k]);
        self(self, k + 1);
        lacking.pop_back();
    };
    hold(hold, 0);
    return least;
}

}  // namespace

void compare(const Closure& closure, std::optional<Where> where, const std::vector<Added>& truth, Outcome& outcome) {
    outcome.verdict = std::string(name_of(closure.verdict));
    outcome.before = closure.heldout_before;
    outcome.after = closure.heldout_after;
    outcome.floor = closure.noise_floor;
    outcome.answer_gain = closure.log_likelihood_gain;
    outcome.oracle = std::numeric_limits<double>::quiet_NaN();
    if (closure.unexplained) outcome.where = std::string(name_of(closure.unexplained->where));
    std::set<std::string> true_effects;
    for (const Added& added : truth) true_effects.insert(added.effect);
    bool ties = false;
    for (const auto& step : closure.steps) {
        outcome.named += fmt::format("{}{}", outcome.named.empty() ? "" : "+", step.name());
        for (const auto* other : step.confounded_with) outcome.named += fmt::format("~{}", other->name());
        const bool named = true_effects.contains(step.name());
        const bool tied_to_truth =
            std::any_of(step.confounded_with.begin(), step.confounded_with.end(),
                        [&](const auto* other) { return true_effects.contains(std::string(other->name())); });
        ties = ties || (named ? !step.confounded_with.empty() : tied_to_truth);
        if (!named && !tied_to_truth) outcome.false_name = true;
    }
    outcome.missing = not_held(true_effects, closure.steps);
    const bool unexplained = closure.verdict == Verdict::unexplained;
    const bool as_it_is = unexplained ? where && closure.unexplained->where == *where : !where;
    if (outcome.false_name && !unexplained) {
        outcome.judged = Judged::wrong;
    } else if (unexplained && (!as_it_is || outcome.false_name)) {
        outcome.judged = Judged::unexplained;
    } else if (!as_it_is || !outcome.missing.empty()) {
        outcome.judged = Judged::missed;
    } else {
        outcome.judged = ties ? Judged::tie : Judged::right;
    }
}

std::string fault_of_closed(const record::Record& record, const Closure& closure) {
    constexpr double longest_s = 12.0;
    const auto closed = ringlock::closure::closed_scenario(record, closure);
    for (const scenario::Complaint& complaint : scenario::check(closed.scenario)) return complaint.problem;
    try {
        const std::string text = to_toml(closed, "a record", closure.verdict);
        if (!(scenario::parse_string(text, "closed.toml") == closed.scenario))
            return "is read back as another scenario";
        scenario::Scenario brief = closed.scenario;
        brief.ensemble.duration_s = std::min(brief.ensemble.duration_s, longest_s);
        if (scenario::check(brief).empty()) instrument::simulate_record(brief);
    } catch (const std::exception& error) {
        return error.what();
    }
    return "";
}

Outcome judge(const Case& of, const record::Record& record) {
    Outcome outcome;
    const auto start = std::chrono::steady_clock::now();
    const Closure closure = ringlock::closure::close_turns(record);
    outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const bool foreign = !of.foreign.empty();
    compare(closure, foreign ? std::optional(of.where) : std::nullopt, of.truth, outcome);
    outcome.closed_fault = fault_of_closed(record, closure);
    if (foreign) return outcome;

    std::vector<ActiveEffect> known;
    for (const Added& added : of.truth) {
        known.push_back({effects::find(added.effect), {added.values.begin(), added.values.end()}});
    }
    const Closure oracle = fit_turns(record, known);
    outcome.oracle = oracle.heldout_after;
    outcome.truth_gain = oracle.log_likelihood_gain;
    outcome.asked_gain = gain_asked(outcome.missing, static_cast<double>(effects::registry().size()));
    if (outcome.judged != Judged::right) return outcome;
    const Device device = device_of(of);
    const std::map<std::string, double> base_truth = {
        {"bias_deg_h", 0.0},
        {"lockin_threshold_deg_h", device.threshold_deg_h},
        {"injected_noise_rad", device.injected_rad},
        {"readout_noise_rad", device.readout_noise},
        {"dither_frequency_hz", device.dither_frequency_hz},
    };
    for (const Estimate& estimate : closure.base) {
        const auto truth = base_truth.find(estimate.name);
        if (truth == base_truth.end() || (truth->second == 0.0 && estimate.name != "bias_deg_h")) continue;
        outcome.deviations.push_back(
            {estimate.name, estimate.value, estimate.sd, deviation_of(estimate, truth->second)});
    }
    for (const auto& step : closure.steps) {
        for (const Added& added : of.truth) {
            if (added.effect != step.name()) continue;
            for (const Estimate& estimate : step.parameters) {
                outcome.deviations.push_back({step.name() + "." + estimate.name, estimate.value, estimate.sd,
                                              deviation_of(estimate, added.values.at(estimate.name))});
            }
        }
    }
    return outcome;
}

}  // namespace ringlock::test::closure
