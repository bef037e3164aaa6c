#pragma once

namespace ringlock::allan {

/// A sum and its rounding error: value + error is exact.
struct ExactSum {
    double value = 0.0;
    double error = 0.0;
};

/// The exact sum of two numbers of any size (D. Knuth, The Art of Computer Programming 2, section 4.2.2).
inline ExactSum two_sum(double a, double b) {
    const double s = a + b;
    const double bb = s - a;
    return {s, (a - (s - bb)) + (b - bb)};
}

}  // namespace ringlock::allan
