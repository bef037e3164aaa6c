#include "analysis/allan_run/deviations.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/core/error.hpp"

namespace ringlock::allan_run {

std::string known_deviations() {
    std::string list;
    for (const allan::Traits& t : allan::all_estimators) list += fmt::format("{}{}", list.empty() ? "" : ", ", t.name);
    return list;
}

std::vector<allan::Estimator> deviations_named(const std::vector<std::string>& names, std::string_view option) {
    std::vector<allan::Estimator> out;
    for (const std::string& name : names) {
        const auto estimator = allan::estimator_named(name);
        if (!estimator) {
            throw InputError(fmt::format("{} '{}' is not known; there are {}", option, name, known_deviations()));
        }
        if (std::find(out.begin(), out.end(), *estimator) == out.end()) out.push_back(*estimator);
    }
    return out;
}

}  // namespace ringlock::allan_run
