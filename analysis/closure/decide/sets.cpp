#include "analysis/closure/decide/sets.hpp"

#include <algorithm>

namespace ringlock::closure {

bool EffectSet::has(const effects::Effect* effect) const {
    return std::find(effects.begin(), effects.end(), effect) != effects.end();
}

Naming name_among(const std::vector<EffectSet>& tied, const std::function<bool(const effects::Effect*)>& may_lead) {
    const EffectSet& best = tied.front();
    const auto sets_with = [&](const effects::Effect* effect) {
        return std::count_if(tied.begin(), tied.end(), [&](const EffectSet& set) { return set.has(effect); });
    };
    Naming naming;
    naming.named = best.effects.front();
    for (std::size_t k = 1; k < best.effects.size(); ++k) {
        const effects::Effect* effect = best.effects[k];
        if (sets_with(effect) > sets_with(naming.named) && may_lead(effect)) naming.named = effect;
    }
    naming.alternatives.push_back({naming.named, best.evidence});
    for (const effects::Effect* effect : best.effects) {
        if (effect != naming.named) naming.partners.push_back(effect);
    }
    for (const EffectSet& set : tied) {
        if (set.has(naming.named)) continue;
        for (const effects::Effect* effect : set.effects) {
            const auto known =
                std::find_if(naming.alternatives.begin(), naming.alternatives.end(),
                             [&](const Naming::Alternative& alternative) { return alternative.effect == effect; });
            if (!best.has(effect) && known == naming.alternatives.end()) {
                naming.alternatives.push_back({effect, set.evidence});
            }
        }
    }
    return naming;
}

}  // namespace ringlock::closure
