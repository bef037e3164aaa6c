#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/effects/effect.hpp"

/// The vocabulary that all rooms of the closed loop share: which rows count, what was estimated, where structure lies.
namespace ringlock::closure {

/// Which rows of a record count: 1 or 0 each.
using Rows = std::vector<std::uint8_t>;

/// An effect that is in the model, with the value of each of its parameters.
struct ActiveEffect {
    const effects::Effect* effect;
    effects::Values values;

    bool operator==(const ActiveEffect&) const = default;
};

/// A parameter as fitted; one of the base model where `effect` is empty. Units are part of the name.
struct Estimate {
    std::string effect, name;
    double value = 0.0;
    double sd = 0.0;
    std::string text = {};  ///< a name in place of a number
};

/// The kind of structure that a residual has: what it goes with.
enum class Where { phase, time, frequency, temperature, rate, amplitude };
std::string_view name_of(Where where);

/// One test of the residual and how probable its outcome is by chance, the test's own searches counted.
struct ResidualTest {
    Where where;
    std::string view;  ///< what the residual was tested against
    double p_value = 1.0;
    std::string detail;  ///< the largest of what was seen
    double merit = 0.0;  ///< of a regression: gain of the log-likelihood less its parameters and its search

    std::string description() const;
};

/// Names of effects, in their order.
std::vector<std::string> names_of(const std::vector<const effects::Effect*>& effects);

/// A p-value in two digits; "< 1e-99" where it is smaller than doubles resolve.
std::string probability(double p);

}  // namespace ringlock::closure
