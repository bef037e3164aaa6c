#include "analysis/closure/types.hpp"

#include <fmt/format.h>

namespace ringlock::closure {

std::string_view name_of(Where where) {
    switch (where) {
        case Where::phase:
            return "phase";
        case Where::time:
            return "time";
        case Where::frequency:
            return "frequency";
        case Where::temperature:
            return "temperature";
        case Where::rate:
            return "rate";
        case Where::amplitude:
            break;
    }
    return "amplitude";
}

std::string ResidualTest::description() const {
    return fmt::format("{}{}{}, by chance p {}", subject, detail.empty() ? "" : ", ", detail, probability(p_value));
}

std::vector<std::string> names_of(const std::vector<const effects::Effect*>& effects) {
    std::vector<std::string> names;
    for (const effects::Effect* effect : effects) names.emplace_back(effect->name());
    return names;
}

std::string probability(double p) { return p < 1e-99 ? "< 1e-99" : fmt::format("{:.2g}", p); }

}  // namespace ringlock::closure
