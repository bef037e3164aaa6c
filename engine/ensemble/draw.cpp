#include "engine/ensemble/draw.hpp"

#include <boost/random/uniform_real_distribution.hpp>

#include "engine/ensemble/schedule.hpp"
#include "engine/scenario/active_effects.hpp"

namespace ringlock::ensemble {

std::int64_t total_gyros(const scenario::Scenario& scenario) {
    return scenario.ensemble.gyros * scenario.input.sweep_points;
}

double input_rate_deg_h(const scenario::Scenario& scenario, std::int64_t gyro) {
    if (scenario::has_profile(scenario.input)) {
        const Schedule schedule(scenario);
        const double duration_s = static_cast<double>(schedule.samples - 1) * schedule.sample_interval_s;
        return scenario::profile_angle_arcsec(scenario.input, schedule.start_s, duration_s) / duration_s;
    }
    return scenario::input_rate_deg_h(scenario.input, gyro / scenario.ensemble.gyros);
}

double input_rate_at_deg_h(const scenario::Scenario& scenario, const gyro::Setup& setup, double time_s) {
    if (scenario::has_profile(scenario.input)) return scenario::profile_rate_deg_h(scenario.input, time_s);
    return setup.input_rate_deg_h;
}

random::Identity identity(const scenario::Scenario& scenario, std::int64_t gyro) {
    return {scenario.ensemble.seed, static_cast<std::uint64_t>(gyro % scenario.ensemble.gyros)};
}

random::Identity device_identity(const scenario::Scenario& scenario, std::int64_t gyro) {
    const random::Identity turn_on = identity(scenario, gyro);
    return {turn_on.seed, turn_on.gyro / static_cast<std::uint64_t>(scenario.ensemble.turn_ons)};
}

gyro::Setup nominal_setup(const scenario::Scenario& scenario) {
    gyro::Setup setup = scenario::configured_setup(scenario);
    setup.input_rate_deg_h = input_rate_deg_h(scenario, 0);
    return setup;
}

gyro::Setup draw_setup(const scenario::Scenario& scenario, std::int64_t gyro) {
    const auto who = identity(scenario, gyro);
    const auto& spread = scenario.ensemble;
    const auto device = device_identity(scenario, gyro);
    const auto normal = [&](random::Purpose purpose) { return random::NormalStream(device, purpose)(); };

    gyro::Setup setup = nominal_setup(scenario);
    setup.input_rate_deg_h = input_rate_deg_h(scenario, gyro);
    random::Engine engine = random::make_engine(who, random::Purpose::initial_phase);
    // In [-0.5, 0.5) of the spread, so that a spread of 0 means a phase of 0 for all.
    setup.initial_phase_rad =
        spread.initial_phase_spread_rad * boost::random::uniform_real_distribution<double>(-0.5, 0.5)(engine);
    setup.dither_asymmetry_ratio += spread.dither_asymmetry_sd_ratio * normal(random::Purpose::dither_asymmetry);
    setup.lockin_threshold_deg_h *=
        1.0 + spread.lockin_threshold_sd_relative * normal(random::Purpose::lockin_threshold);
    setup.dither_peak_rate_deg_s *=
        1.0 + spread.dither_amplitude_sd_relative * normal(random::Purpose::dither_amplitude);
    return setup;
}

}  // namespace ringlock::ensemble
