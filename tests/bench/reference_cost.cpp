#include "tests/bench/reference_cost.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <utility>

#include "engine/core/error.hpp"
#include "tests/bench/noisy_dither.hpp"
#include "tests/support/cvode.hpp"
#include "tests/support/odeint.hpp"

namespace ringlock::bench {

namespace {

using Make = std::function<std::shared_ptr<test::Propagator>(double tolerance_rad)>;

/// The loosest tolerance that serves, found from above: what a user arrives at who knows the error.
Reference loosest(const std::string& name, const std::vector<SolvedHalfCycle>& solved, double error_rad,
                  const Make& make) {
    for (double exponent = -5.0; exponent >= -15.0; exponent -= 0.5) {
        const double tolerance_rad = std::pow(10.0, exponent);
        const auto propagator = make(tolerance_rad);
        const double worst = worst_error_rad(*propagator, solved, error_rad);
        if (worst <= error_rad) return {name, tolerance_rad, worst, propagator};
    }
    throw RunError(fmt::format("{}: no tolerance down to 1e-15 rad holds {:.1e} rad", name, error_rad));
}

}  // namespace

std::vector<Reference> references(const gyro::Device& device, double error_rad) {
    const std::vector<SolvedHalfCycle> solved = solved_half_cycles(device);
    const auto odeint = [&](double longest_step_fringes) {
        return [coupling = device.coupling, longest_step_fringes](double tolerance_rad) {
            return std::make_shared<test::Odeint>(coupling, tolerance_rad, longest_step_fringes);
        };
    };
    const auto cvode = [&](double longest_step_fringes) {
        return [coupling = device.coupling, longest_step_fringes](double tolerance_rad) {
            return std::make_shared<test::Cvode>(coupling, tolerance_rad, 0.0, longest_step_fringes);
        };
    };
    // The step lengths are the best of those tried for an error of 1e-8 rad. With steps of 0.3 fringe Fehlberg's error
    // is 2e-8 rad until the tolerance alone decides; CVODE takes steps of about 0.05 fringe of itself, but unsteadily.
    return {
        loosest("Boost.odeint Fehlberg 7(8)", solved, error_rad, odeint(0.0)),
        loosest("Boost.odeint, steps to 0.27 fringe", solved, error_rad, odeint(0.27)),
        loosest("CVODE Adams", solved, error_rad, cvode(1.0 / 3.0)),
        loosest("CVODE, steps to 0.05 fringe", solved, error_rad, cvode(0.05)),
    };
}

std::vector<ReferenceCost> reference_costs(const gyro::Device& device, double error_rad) {
    constexpr std::size_t rounds = 5;
    constexpr int turns = 20;
    const std::vector<Reference> all = references(device, error_rad);
    std::vector<std::vector<double>> seconds(all.size());
    for (std::size_t round = 0; round < rounds; ++round) {
        for (std::size_t i = 0; i < all.size(); ++i) {
            const auto start = std::chrono::steady_clock::now();
            go_through(*all[i].propagator, device, turns);
            seconds[i].push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
        }
    }
    std::vector<ReferenceCost> costs;
    for (std::size_t i = 0; i < all.size(); ++i) {
        std::sort(seconds[i].begin(), seconds[i].end());
        costs.push_back({all[i].name, all[i].tolerance_rad, all[i].worst_error_rad, seconds[i][rounds / 2] / turns});
    }
    return costs;
}

}  // namespace ringlock::bench
