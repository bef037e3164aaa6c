#include "analysis/closure/turn_contest.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "analysis/closure/chance.hpp"
#include "analysis/closure/decision.hpp"
#include "analysis/closure/side_channels.hpp"
#include "engine/core/error.hpp"

namespace ringlock::closure {

namespace {

bool on_phase(const effects::Effect& effect) {
    return effect.name() == "readout_ellipse" || effect.name() == "missed_counts";
}

int free_parameters(const effects::Effect& effect) {
    int count = 0;
    for (const effects::Parameter& parameter : effect.parameters()) {
        if (parameter.role != effects::Role::setting) ++count;
    }
    return count;
}

/// Level of each of them, with all of the library tried.
double level_of_one_effect() { return level_of_effects / static_cast<double>(effects::registry().size()); }

double merit_of(double gain, const Candidate& candidate) {
    return gain - std::log(candidate.searched) - free_parameters(*candidate.effect);
}

/// Those worth a full fit, the likeliest first. Scores are of the noise as it is, which may have swallowed what an
/// effect does: they only say where to look.
std::vector<Candidate> worth_a_fit(std::vector<Candidate> candidates, double largest_p, std::size_t most) {
    std::erase_if(candidates, [&](const Candidate& c) { return !(c.p_value < largest_p); });
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
        return merit_of(0.5 * a.chi2, a) > merit_of(0.5 * b.chi2, b);
    });
    if (candidates.size() > most) candidates.resize(most);
    return candidates;
}

/// All parameters of the model with it; none where no motion of a gyro with such parameters can be followed.
std::shared_ptr<Fitted> fit_with(const record::Record& record, const Fitted& now, const Candidate& candidate,
                                 const Rows& rows) {
    TurnParameters start = now.fit->parameters();
    start.effects.push_back({candidate.effect, candidate.values});
    std::shared_ptr<Fitted> fitted;
    try {
        fitted = fit_record(record, start, rows);
        if (is_random_rate(*candidate.effect)) {
            // Without the process the rest may have gone far astray: anew from the start, too.
            TurnParameters anew;
            anew.effects = start.effects;
            auto other = fit_record(record, anew, rows);
            if (other->fit->log_likelihood() > fitted->fit->log_likelihood()) fitted = std::move(other);
        }
    } catch (const RunError&) {
    }
    return fitted;
}

}  // namespace

std::shared_ptr<Fitted> fit_record(const record::Record& record, const TurnParameters& start, const Rows& rows,
                                   TurnFit::Effects effects) {
    auto fitted = std::make_shared<Fitted>();
    gyro::Setup setup;
    bool count_again = false;
    for (const ActiveEffect& active : start.effects) {
        if (active.effect->name() == "readout_ellipse") active.effect->configure(active.values, setup);
        if (active.effect->name() == "missed_counts") count_again = true;
    }
    fitted->joined = join(*record.turns, setup.ellipse, count_again);
    fitted->series = prepare(record, fitted->joined);
    fitted->model = std::make_unique<TurnModel>(fitted->series, fitted->joined.phase_rad);
    TurnParameters parameters = start;
    if (parameters.readout_sd_rad == 0.0) {
        parameters.readout_sd_rad = std::max(fitted->joined.readout_sd_rad, 1e-6);
        parameters.threshold_deg_h = fitted->series.setup.lockin_threshold_deg_h;
    }
    fitted->fit = std::make_unique<TurnFit>(*fitted->model, parameters, rows, effects);
    return fitted;
}

bool is_random_rate(const effects::Effect& effect) {
    const auto parameters = effect.parameters();
    return std::any_of(parameters.begin(), parameters.end(),
                       [](const auto& p) { return p.role == effects::Role::deviation; });
}

double p_of_gain(double gain, const effects::Effect& effect) { return chi2_tail(2.0 * gain, free_parameters(effect)); }

bool passes(double p_value) { return p_value < level_of_one_effect(); }

Contest hold_contest(const record::Record& record, const Fitted& now, const Rows& rows, std::size_t most) {
    constexpr double worth_looking = 0.1;
    Contest contest;
    auto candidates =
        worth_a_fit(screen_side_channels(*record.turns, *now.fit, now.joined), level_of_one_effect(), most);
    contest.side = !candidates.empty();
    if (contest.side) {
        // What changes the phases that were read stands alone.
        const bool alone = on_phase(*candidates.front().effect);
        for (std::size_t k = candidates.size(); k-- > 1;) {
            if (alone || on_phase(*candidates[k].effect)) {
                candidates.erase(candidates.begin() + static_cast<std::ptrdiff_t>(k));
            }
        }
    } else {
        candidates = worth_a_fit(screen(*now.fit), worth_looking, most);
    }
    std::vector<Contender> contenders(candidates.size());
    oneapi::tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t k) {
        Contender& contender = contenders[k];
        contender.fitted = fit_with(record, now, candidates[k], rows);
        contender.candidate = std::move(candidates[k]);
        if (!contender.fitted) return;
        const Candidate& candidate = contender.candidate;
        const double gain =
            contest.side ? 0.5 * candidate.chi2 : contender.fitted->fit->log_likelihood() - now.fit->log_likelihood();
        contender.merit = merit_of(gain, candidate);
        contender.p_value =
            contest.side ? candidate.p_value : of_several(p_of_gain(gain, *candidate.effect), candidate.searched);
    });
    std::erase_if(contenders, [](const Contender& contender) { return !contender.fitted; });
    std::sort(contenders.begin(), contenders.end(),
              [](const Contender& a, const Contender& b) { return a.merit > b.merit; });
    contest.contenders = std::move(contenders);
    return contest;
}

Choice choose(const record::Record& record, const Contest& contest, const Rows& rows) {
    constexpr std::size_t tried_first = 3;
    constexpr std::size_t tried_second = 2;
    const double second_choice = std::log(static_cast<double>(effects::registry().size()));
    Choice choice;
    const auto& contenders = contest.contenders;
    if (contenders.empty() || !passes(contenders.front().p_value)) return choice;
    const Contender& likeliest = contenders.front();
    choice.chosen = &likeliest;
    choice.merit = likeliest.merit;
    choice.on_random = is_random_rate(*likeliest.candidate.effect);
    const auto add_name = [&](std::string_view name) {
        auto& names = choice.confounded_with;
        if (std::find(names.begin(), names.end(), name) == names.end()) names.emplace_back(name);
    };
    const auto add_tied = [&](const Contender& contender) {
        if (&contender == choice.chosen || choice.merit - contender.merit >= tie) return;
        add_name(contender.candidate.effect->name());
    };
    if (contest.side || !choice.on_random) {
        for (const Contender& contender : contenders) add_tied(contender);
        return choice;
    }

    // Pairs: those that are not random, each with what explains most beside it.
    struct Pair {
        const Contender* first;
        std::string second;
        double merit;
    };
    std::vector<Pair> pairs;
    std::size_t tried = 0;
    for (const Contender& contender : contenders) {
        if (is_random_rate(*contender.candidate.effect) || tried == tried_first) continue;
        ++tried;
        const Contest beside = hold_contest(record, *contender.fitted, rows, tried_second);
        for (const Contender& other : beside.contenders) {
            if (beside.side || !passes(other.p_value)) continue;
            if (other.candidate.effect == likeliest.candidate.effect) continue;
            pairs.push_back({&contender, std::string(other.candidate.effect->name()),
                             contender.merit + other.merit - second_choice});
        }
    }
    const auto best =
        std::max_element(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.merit < b.merit; });
    if (best == pairs.end() || best->merit < likeliest.merit - tie) {
        for (const Contender& contender : contenders) add_tied(contender);
        return choice;
    }
    if (best->merit < likeliest.merit + tie) {
        for (const Contender& contender : contenders) add_tied(contender);
        add_name(best->first->candidate.effect->name());
        add_name(best->second);
        return choice;
    }
    // What else could stand beside the second, and what could stand for both.
    choice.chosen = best->first;
    choice.merit = best->merit;
    choice.on_random = is_random_rate(*effects::find(best->second));
    for (const Contender& contender : contenders) add_tied(contender);
    for (const Pair& pair : pairs) {
        if (pair.first == choice.chosen || pair.second != best->second || choice.merit - pair.merit >= tie) continue;
        add_name(pair.first->candidate.effect->name());
    }
    return choice;
}

}  // namespace ringlock::closure
