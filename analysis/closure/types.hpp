#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/effects/effect.hpp"

/// Types that all parts of the closed loop share: rows that count, estimates, and structure of the residual.
namespace ringlock::closure {

/// Whether each row of a record counts: 1 or 0.
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

/// The kind of structure of a residual: the quantity with which it varies.
enum class Where { phase, time, frequency, temperature, rate, amplitude };
std::string_view name_of(Where where);

/// One test of the residual, with the probability of its outcome by chance; the test's own search is included in it.
struct ResidualTest {
    Where where;
    std::string subject;  ///< the quantity or pattern that the residual was tested against
    double p_value = 1.0;
    std::string detail;     ///< the largest deviation that was found
    double evidence = 0.0;  ///< evidence of a regression: gain of the log-likelihood less parameters and search

    std::string description() const;
};

/// Names of effects, in their order.
std::vector<std::string> names_of(const std::vector<const effects::Effect*>& effects);

/// A p-value in two digits; "< 1e-99" where it is smaller than doubles resolve.
std::string probability(double p);

}  // namespace ringlock::closure
