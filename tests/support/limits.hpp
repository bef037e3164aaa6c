#pragma once
#include <string>
#include <vector>

#include "analysis/study/study.hpp"
#include "engine/readout/phase_bound.hpp"
#include "engine/scenario/scenario.hpp"

/// Smallest random walk that the readout allows, and that of the compensators: for results/compensation/tables.md.
namespace ringlock::test::limits {

/// Bounds of the phase at a zero-rate point [rad], of the scenario's device without spread.
struct Bounds {
    double known_rad = 0.0;      ///< the phase's acceleration being known
    double learnt_rad = 0.0;     ///< the one after the turn known but for the injected noise of the turn to come
    double detectors_rad = 0.0;  ///< from the detectors alone
};
Bounds bounds(const scenario::Scenario& scenario);
/// Angle random walk that an error of the phase leaves [deg/sqrt(h)].
double walk_deg_rt_h(const scenario::Scenario& scenario, double phase_rad);

/// Names of the arms behind injected noise that take the lock-in away.
std::vector<std::string> compensated_arms();
inline constexpr const char* exact_arm = "noise_injected+compensated_exact";
inline constexpr const char* adaptive_arm = "noise_injected+compensated_adaptive";

/// Of the gyros, [arm][gyro].
struct Walks {
    std::vector<std::string> arms;
    std::vector<std::vector<double>> squared;           ///< random walk beside angle noise, of the whole record
    std::vector<std::vector<double>> rate_error_deg_h;  ///< mean over the record
    std::vector<double> tau_s;
    /// Allan variance times averaging time, [arm][time][gyro]: the squared walk at all times if there is nothing else.
    std::vector<std::vector<std::vector<double>>> squared_at;

    const std::vector<double>& of(const std::string& arm) const { return squared[index(arm)]; }
    std::size_t index(const std::string& arm) const;
};
/// Runs the scenario on two threads. Its arms are what is asked for.
Walks walks(const scenario::Scenario& scenario);

/// A ratio with its 95 % interval.
struct Ratio {
    double value = 0.0;
    double lo = 0.0;
    double hi = 0.0;
};
/// Root of the mean square over a given walk; the gyros drawn again (Efron 1979, percentiles).
Ratio over(const std::vector<double>& squared, double walk_deg_rt_h);
/// Over the same of another arm: of the same gyros, so that they are drawn together.
Ratio over(const std::vector<double>& squared, const std::vector<double>& other);

}  // namespace ringlock::test::limits
