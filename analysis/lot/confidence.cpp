#include "analysis/lot/confidence.hpp"

#include <fmt/format.h>

#include <cmath>

#include "engine/core/error.hpp"

namespace ringlock::lot {

void check(const Confidence& confidence) {
    if (!(confidence.level > 0.0 && confidence.level < 1.0)) {
        throw InputError(
            fmt::format("confidence level {} of a figure of the lot: an interval holds the truth with a probability "
                        "between 0 and 1; "
                        "give a level such as 0.95",
                        confidence.level));
    }
}

double tail_probability(const Confidence& confidence) {
    check(confidence);
    const double tail = 0.5 * (1.0 - confidence.level);
    return confidence.sampling == Sampling::fixed ? tail : tail * 2.0 / 3.0;
}

double widening(const Confidence& confidence, std::int64_t n) {
    if (confidence.sampling == Sampling::fixed) return 1.0;
    if (n < 1) throw InputError(fmt::format("t interval of {} values: at least 1 is needed", n));
    return std::sqrt(1.04 + 2.0 / static_cast<double>(n));
}

}  // namespace ringlock::lot
