#pragma once
#include <functional>
#include <vector>

#include "engine/effects/effect.hpp"

/// Sets of effects that explain a record about equally well: the choice of the effect to report and of its
/// alternatives.
namespace ringlock::closure {

/// Effects that explain the record together.
struct EffectSet {
    std::vector<const effects::Effect*> effects;
    double evidence = 0.0;  ///< log-likelihood gain less the cost of parameters and search [nats]

    bool has(const effects::Effect* effect) const;
};

/// The effect that is reported next.
struct Naming {
    /// An effect and the evidence of the set that it belongs to.
    struct Alternative {
        const effects::Effect* effect = nullptr;
        double evidence = 0.0;
    };
    const effects::Effect* named = nullptr;
    std::vector<const effects::Effect*> partners;  ///< other members of the best set, to be added next
    /// The effect that is reported, then those that explain as much in its place, each with the evidence of its set.
    std::vector<Alternative> alternatives;
};

/// Chooses the effect to report among tied sets, the best of them first. It is the member of the best set that most of
/// the tied sets contain. The effects of sets without it, unless they are members of the best set, are confounded with
/// it.
/// \param may_lead  whether an effect other than the first of the best set may be reported: it must pass alone
Naming name_among(const std::vector<EffectSet>& tied, const std::function<bool(const effects::Effect*)>& may_lead);

}  // namespace ringlock::closure
