#pragma once
#include <array>
#include <cmath>
#include <cstddef>

#include "engine/core/units.hpp"

namespace ringlock::closure {

/// A function of the phase that takes long to compute, by linear interpolation between its values at 256 phases.
/// `Value` is added and scaled as Eigen's matrices are.
template <typename Value>
class PhaseTable {
   public:
    /// Evaluates `of(phase_rad)` at each of them.
    template <typename Function>
    explicit PhaseTable(Function&& of) {
        for (std::size_t j = 0; j < phases; ++j) values_[j] = of(units::two_pi * static_cast<double>(j) / phases);
    }
    Value at(double phase_rad) const {
        const double fringes = phase_rad / units::two_pi;
        const double x = (fringes - std::floor(fringes)) * phases;
        const auto j = static_cast<std::size_t>(x);
        const double share = x - static_cast<double>(j);
        return (1.0 - share) * values_[j % phases] + share * values_[(j + 1) % phases];
    }

   private:
    static constexpr std::size_t phases = 256;
    std::array<Value, phases> values_;
};

}  // namespace ringlock::closure
