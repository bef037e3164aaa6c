#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"

namespace ringlock::test::closure {

/// Prints the answer of the loop on a record to standard output.
inline void print(const char* name, const ringlock::closure::Closure& closure) {
    std::printf("%s: %s, held-out error %.6g -> %.6g", name, std::string(name_of(closure.verdict)).c_str(),
                closure.heldout_before, closure.heldout_after);
    for (const auto& step : closure.steps) {
        std::printf("; %s p %.2g", step.name().c_str(), step.p_value);
        for (const ringlock::closure::Estimate& e : step.parameters)
            std::printf(" %s %.5g +- %.2g", e.name.c_str(), e.value, e.sd);
        for (const auto* other : step.confounded_with) std::printf(" ~%s", std::string(other->name()).c_str());
    }
    if (closure.unexplained) std::printf("; %s", closure.unexplained->description().c_str());
    std::printf("\n");
}

/// An estimate less the truth, in standard errors.
inline double deviation(const std::vector<ringlock::closure::Estimate>& estimates, const std::string& name,
                        double truth) {
    for (const ringlock::closure::Estimate& e : estimates) {
        if (e.name == name) return std::abs(e.value - truth) / e.sd;
    }
    ADD_FAILURE() << "no estimate of " << name;
    return 0.0;
}

}  // namespace ringlock::test::closure
