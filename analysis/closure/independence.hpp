#pragma once
#include <string>
#include <vector>

#include "analysis/closure/turn_fit.hpp"

namespace ringlock::closure {

/// Where structure lies that a model has left.
enum class Where { phase, time, frequency, temperature, rate, amplitude };
std::string_view name_of(Where where);

/// One view of the residual and how probable it is by chance, its own searches counted.
struct ResidualTest {
    Where where;
    std::string view;  ///< what the residual was held against
    double p_value = 1.0;
    std::string detail;  ///< the largest of what was seen

    std::string description() const;
};

/// Holds the innovations that count against everything that the record has: phase at the turns and its harmonics,
/// direction, amplitude, temperature, input rate, time, frequency, the innovations before.
std::vector<ResidualTest> test_residual(const TurnFit& fit);

}  // namespace ringlock::closure
