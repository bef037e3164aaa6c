#include "engine/scenario/design.hpp"

namespace ringlock::scenario {

bool asks(const Stop& stop) { return stop.arw_relative > 0.0 || stop.yield_absolute > 0.0; }

const VariationForm& form_of(const Variation& variation) {
    static const VariationForm values{"a list of values", {"values"}};
    static const VariationForm range{"a range", {"from", "to", "points"}, {"scale"}};
    static const VariationForm normal{"a normal distribution", {"distribution", "mean", "sd"}};
    static const VariationForm uniform{"a uniform distribution", {"distribution", "from", "to"}};
    static const VariationForm lognormal{"a lognormal distribution", {"distribution", "median", "sd_relative"}};
    static const VariationForm triangular{"a triangular distribution", {"distribution", "from", "mode", "to"}};
    switch (variation.distribution) {
        case LotDistribution::normal:
            return normal;
        case LotDistribution::uniform:
            return uniform;
        case LotDistribution::lognormal:
            return lognormal;
        case LotDistribution::triangular:
            return triangular;
        case LotDistribution::none:
            break;
    }
    return variation.values.empty() ? range : values;
}

}  // namespace ringlock::scenario
