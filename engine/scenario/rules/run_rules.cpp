#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/scenario/read_arms.hpp"
#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

/// As many values as times, in order of time.
Finding wrong_profile(const std::vector<double>& times, const std::vector<double>& values, const std::string& time_key,
                      const std::string& value_key, const char* what) {
    if (times.size() != values.size()) {
        return Complaint{
            {value_key, time_key},
            fmt::format("a profile of {} times has as many {}, not {}", times.size(), what, values.size())};
    }
    for (std::size_t i = 1; i < times.size(); ++i) {
        if (times[i] > times[i - 1]) continue;
        return Complaint{
            {time_key},
            fmt::format("{:g} s comes after {:g} s; times of a profile must increase", times[i], times[i - 1])};
    }
    return {};
}

Finding profile_is_a_profile(const Scenario& s) {
    const auto& times = s.input.profile_time_s;
    if (auto wrong = wrong_profile(times, s.input.profile_rate_deg_h, "input.profile_time_s",
                                   "input.profile_rate_deg_h", "rates")) {
        return wrong;
    }
    if (times.empty() || s.input.sweep_points == 1) return {};
    return Complaint{{"input.profile_time_s", "input.sweep_points"},
                     "a rate that follows a profile cannot be swept; leave out one of the two"};
}

Finding temperatures_are_a_profile(const Scenario& s) {
    const Environment& e = s.environment;
    if (auto wrong = wrong_profile(e.profile_time_s, e.profile_temperature_k, "environment.profile_time_s",
                                   "environment.profile_temperature_k", "temperatures")) {
        return wrong;
    }
    if (e.profile_time_s.empty() || (e.temperature_ramp_k_per_h == 0.0 && e.temperature_swing_k == 0.0)) return {};
    return Complaint{
        {"environment.profile_time_s", "environment.temperature_ramp_k_per_h", "environment.temperature_swing_k"},
        "a temperature that follows a profile has no ramp and no swing; leave them out, or the profile"};
}

Finding sweep_goes_somewhere(const Scenario& s) {
    if (s.input.sweep_points == 1 || s.input.sweep_stop_deg_h != s.input.rate_deg_h) return {};
    return Complaint{{"input.sweep_points", "input.sweep_stop_deg_h"},
                     fmt::format("a sweep of {} points must end at another rate than it starts from ({:g} deg/h); "
                                 "set input.sweep_stop_deg_h",
                                 s.input.sweep_points, s.input.rate_deg_h)};
}

Finding sweep_is_not_too_large(const Scenario& s) {
    constexpr std::int64_t most = 100'000'000;
    if (s.input.sweep_points * s.ensemble.gyros <= most) return {};
    return Complaint{{"ensemble.gyros", "input.sweep_points"},
                     fmt::format("{} gyros at each of {} rates are more than the {} gyros that a run can hold",
                                 s.ensemble.gyros, s.input.sweep_points, most)};
}

Finding turns_can_be_counted(const Scenario& s) {
    // A gyro has two trajectories at most, and twice this fits 64 bits.
    constexpr double most = 1e18;
    const std::int64_t gyros = asks(s.stop) ? s.stop.most_gyros : s.ensemble.gyros;
    const double half_cycles = static_cast<double>(gyros) * static_cast<double>(s.input.sweep_points) * simulated_s(s) *
                               2.0 * s.dither.frequency_hz;
    if (half_cycles <= most) return {};
    return Complaint{
        {"ensemble.duration_s", "ensemble.settle_s", "ensemble.gyros", "dither.frequency_hz", "input.sweep_points"},
        fmt::format(
            "{:.3g} half cycles of the dither, of all gyros together, are more than the {:g} that a run can hold",
            half_cycles, most)};
}

Finding turn_ons_are_whole(const Scenario& s) {
    const std::int64_t each = s.ensemble.turn_ons;
    constexpr std::int64_t first_look = 16;
    if (asks(s.stop) && first_look % each != 0) {
        return Complaint{{"ensemble.turn_ons", "stop.arw_relative", "stop.yield_absolute"},
                         fmt::format("must divide {}, the gyros of the first look of [stop]", first_look)};
    }
    if (asks(s.stop) || s.ensemble.gyros % each == 0) return {};
    return Complaint{
        {"ensemble.turn_ons", "ensemble.gyros"},
        fmt::format("{} gyros are not a whole number of gyros with {} turn-ons each", s.ensemble.gyros, each)};
}

Finding lot_can_grow(const Scenario& s) {
    if (!asks(s.stop)) return {};
    const std::vector<std::string> stop{"stop.arw_relative", "stop.yield_absolute"};
    const auto refuse = [&](const char* key, const char* why) {
        std::vector<std::string> keys{key};
        keys.insert(keys.end(), stop.begin(), stop.end());
        return Complaint{std::move(keys), why};
    };
    if (s.input.sweep_points > 1) {
        return refuse("input.sweep_points", "a sweep has no stopping rule; vary input.rate_deg_h in a [design]");
    }
    if (s.output.angle_record) {
        return refuse("output.angle_record",
                      "records of a lot whose size is not known beforehand cannot be stored; set it to false");
    }
    if (s.stop.yield_absolute > 0.0 && !asks(s.specification)) {
        return Complaint{{"stop.yield_absolute"}, "there is no yield without a [specification]"};
    }
    if (s.stop.yield_absolute > 0.0 && s.ensemble.turn_ons > 1) {
        return refuse("ensemble.turn_ons",
                      "a yield is a share of gyros, and the rule counts turn-ons; "
                      "set it to 1, or leave out stop.yield_absolute");
    }
    return {};
}

constexpr std::array all_run_rules = {
    Rule{"A profile of the input rate has as many times as rates, in order of time, and excludes a sweep.",
         profile_is_a_profile},
    Rule{"A profile of the temperature has as many times as temperatures, in order of time, "
         "and excludes ramp and swing.",
         temperatures_are_a_profile},
    Rule{"A sweep of more than one point ends at another rate than it starts from.", sweep_goes_somewhere},
    Rule{"The gyros of all points of the sweep are at most 100000000.", sweep_is_not_too_large},
    Rule{"The half cycles of all gyros, including those before the record, are at most 1e18.", turns_can_be_counted},
    Rule{"Gyros that are switched on several times are a whole number of gyros; "
         "in a lot with a stopping rule the number of turn-ons divides 16.",
         turn_ons_are_whole},
    Rule{"A lot with a stopping rule has no sweep and no angle records; "
         "a stopping rule for a yield needs a specification.",
         lot_can_grow},
};

}  // namespace

std::span<const Rule> run_rules() { return all_run_rules; }

}  // namespace ringlock::scenario
