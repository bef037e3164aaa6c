#pragma once
#include <memory>
#include <string>
#include <vector>

#include "engine/gyro/device.hpp"
#include "tests/support/propagator.hpp"

namespace ringlock::bench {

/// An integrator that is not ours, at the loosest tolerance that serves: what a user of the library would run.
struct Reference {
    std::string name;
    double tolerance_rad;    ///< of one step, as the library counts it
    double worst_error_rad;  ///< of a half cycle of the noise-injected dither, measured
    std::shared_ptr<test::Propagator> propagator;
};

/// Boost.odeint's Fehlberg 7(8) and CVODE's Adams method, each with its own step control alone and with steps held
/// short, which keeps the control from being taken in by whole fringes. Tolerances go down from 1e-5 rad by factors of
/// sqrt(10) until the worst error measured is at most `error_rad`. Throws RunError where none is tight enough.
std::vector<Reference> references(const gyro::Device& device, double error_rad = 1e-8);

/// What a turn costs by one of them.
struct ReferenceCost {
    std::string name;
    double tolerance_rad;
    double worst_error_rad;
    double seconds_per_turn;  ///< median of rounds in which they take turns, one thread
};

std::vector<ReferenceCost> reference_costs(const gyro::Device& device, double error_rad = 1e-8);

}  // namespace ringlock::bench
