#pragma once
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/gyro/setup.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/scenario.hpp"

/// The rules behind check.hpp, in groups, and the quantities that several groups use. For the sources of the rules
/// only; other code uses check.hpp.
namespace ringlock::scenario {

using Finding = std::optional<Complaint>;

struct Rule {
    std::string_view doc;              ///< one sentence, for docs/scenario.md
    Finding (*find)(const Scenario&);  ///< how a scenario breaks the rule, if it does
};

std::span<const Rule> rate_rules();      ///< the dither reverses the rate, and its amplitude stays
std::span<const Rule> run_rules();       ///< profiles, sweep and size of a run
std::span<const Rule> turn_map_rules();  ///< where the turn map exists and can be tabulated
std::span<const Rule> noise_rules();     ///< injected noise and the drive that makes it
std::span<const Rule> lockin_rules();    ///< the lock-in that remains under the effects
std::span<const Rule> readout_rules();   ///< readout models and the instrument's electronics
std::span<const Rule> output_rules();    ///< samples, averaging times and the specification
std::span<const Rule> record_rules();    ///< records
std::span<const Rule> reader_rules();    ///< the reader of records and of studies

double peak_rate_deg_h(const Scenario& scenario);

double dither_rad_s(const Scenario& scenario);

/// Amplitude M = 2 pi Omega_D / (K w_D) of the optical phase under the dither.
double phase_amplitude_rad(const Scenario& scenario);

double largest_asymmetry(const Scenario& scenario);

/// Keys, then those of the active effects that change the gyro's constants so that `differ(gyro, plain gyro)`.
std::vector<std::string> with_keys_of_effects(const Scenario& scenario, std::vector<std::string> keys,
                                              bool (*differ)(const gyro::Setup&, const gyro::Setup&));

/// A rate and the keys that it comes from.
struct RateOfKeys {
    double rate_deg_h;
    std::vector<std::string> keys;
};

/// Keys of all these rates, those of the largest first.
std::vector<std::string> keys_by_rate(std::vector<RateOfKeys> rates);

/// Keys of the rates that matter in comparison with the dither's, that of the largest first.
std::vector<std::string> keys_of_rates(const Scenario& scenario);

}  // namespace ringlock::scenario
