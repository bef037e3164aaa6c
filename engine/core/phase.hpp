#pragma once
#include <cmath>
#include <cstdint>

#include "engine/core/units.hpp"

namespace ringlock {

/// An unwrapped optical phase that keeps its precision however long the run: whole fringes and a remainder.
struct Phase {
    std::int64_t fringes = 0;    ///< whole turns of 2 pi
    double remainder_rad = 0.0;  ///< in [-pi, pi]

    Phase() = default;
    explicit Phase(double phase_rad) { add(phase_rad); }

    /// Adds an angle [rad] of up to some 1e8 fringes.
    void add(double angle_rad) {
        remainder_rad += wrap(angle_rad);
        remainder_rad = wrap(remainder_rad);
    }

    /// The phase as one number [rad]; loses digits as it grows.
    double value_rad() const { return static_cast<double>(fringes) * units::two_pi + remainder_rad; }

    /// Whole quarter fringes, as an up/down counter counts them: floor(phase/(pi/2)).
    std::int64_t quarters() const {
        return 4 * fringes + static_cast<std::int64_t>(std::floor(4.0 * remainder_rad / units::two_pi));
    }

   private:
    /// Counts the whole fringes of `angle_rad` and returns the rest. 2 pi is taken in three parts of 24, 24 and 53
    /// bits: products with up to 2^29 fringes are exact, so that neither one large angle nor a long run loses digits.
    double wrap(double angle_rad) {
        const double whole = std::nearbyint(angle_rad / units::two_pi);
        fringes += static_cast<std::int64_t>(whole);
        return ((angle_rad - whole * 0x1.921fb6p+2) - whole * -0x1.777a5cp-23) - whole * -0x1.ee59d9cceba4p-48;
    }
};

inline Phase operator+(Phase phase, double angle_rad) {
    phase.add(angle_rad);
    return phase;
}

}  // namespace ringlock
