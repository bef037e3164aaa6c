#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "analysis/closure/closure.hpp"

namespace ringlock::test::closure {

/// What is foretold of the rows that are only reported errs as much as the fitted noise says: within four of the
/// standard errors of an rms of so many.
inline void expect_errors_of_the_noise(const ringlock::closure::Closure& found) {
    const auto& reported = found.residual.reported;
    const double rows = std::accumulate(reported.begin(), reported.end(), 0.0);
    ASSERT_GT(rows, 0.0);
    EXPECT_NEAR(found.heldout_after / found.noise_floor, 1.0, 4.0 / std::sqrt(2.0 * rows));
}

}  // namespace ringlock::test::closure
