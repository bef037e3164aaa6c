#include "tests/closure/suite/suite.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/loop/loop.hpp"
#include "analysis/closure/turns/model/model.hpp"
#include "analysis/instrument/simulate.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"
#include "engine/scenario/check.hpp"
#include "tests/closure/generator/generator.hpp"
#include "tests/closure/generator/keys.hpp"
#include "tests/closure/generator/plain_gyro.hpp"
#include "tests/closure/suite/device.hpp"

namespace ringlock::test::closure {

using ringlock::closure::ActiveEffect;
using ringlock::closure::Closure;
using ringlock::closure::Estimate;
using ringlock::closure::fit_turns;
using ringlock::closure::Where;

const std::vector<Condition> conditions = {
    {"quiet", 0.0, false}, {"injected", 3.0, false}, {"moving", 0.0, true}, {"moving, injected", 3.0, true}};

const Condition other_gyro = {"another gyro", 0.0, false, true};

const char* name_of(Kind kind) {
    constexpr const char* names[] = {"null", "single", "pair", "foreign", "other", "several", "mixed"};
    return names[static_cast<std::size_t>(kind)];
}

const char* name_of(Judged judged) {
    constexpr const char* names[] = {"right", "tie", "missed", "unexplained", "wrong"};
    return names[static_cast<std::size_t>(judged)];
}

std::string text_of(const std::vector<Added>& added) {
    std::string text;
    for (const Added& one : added) text += (text.empty() ? "" : "+") + one.effect;
    return text.empty() ? "nothing" : text;
}

std::vector<Added> Case::added() const {
    std::vector<Added> all = truth;
    all.insert(all.end(), foreign.begin(), foreign.end());
    return all;
}

std::string Case::truth_text() const { return text_of(added()); }

namespace {

constexpr double temperature_swing_k = 1.0;
constexpr double temperature_interval_s = 0.1;  // between rows the temperature is taken for linear
constexpr double walk_relative_rt_s = 1e-5;
constexpr double drift_relative_per_h = 0.01;

record::Record by_map(const Case& of, const Device& device) {
    scenario::Scenario scenario = plain_gyro(static_cast<double>(of.turns), of.seed + (of.noise << 32));
    inject(scenario, device.injected_rad);
    scenario.gyro.scale_factor_arcsec = device.scale_factor_arcsec;
    scenario.dither.frequency_hz = device.dither_frequency_hz;
    scenario.ensemble.duration_s = device.duration_s;
    scenario.gyro.lockin_threshold_deg_h = device.threshold_deg_h;
    scenario.dither.peak_rate_deg_s = device.peak_rate_deg_s;
    scenario.readout.detector_noise_relative = device.readout_noise;
    scenario.input.rate_deg_h = scenario.input.sweep_stop_deg_h = device.rate_deg_h;
    if (of.condition->moving) {
        scenario.dither.amplitude_wander_relative_rt_s = walk_relative_rt_s;
        scenario.dither.amplitude_drift_relative_per_h = drift_relative_per_h;
        scenario.input.profile_time_s = device.profile_time_s;
        scenario.input.profile_rate_deg_h = device.profile_rate_deg_h;
    }
    scenario.environment.temperature_swing_k = temperature_swing_k;
    scenario.environment.temperature_period_s = 0.4 * device.duration_s;
    scenario.record.temperature_interval_s = temperature_interval_s;
    for (const Added& added : of.added()) {
        for (const auto& [name, value] : added.values) scenario.effects.at(added.effect).at(name) = value;
    }
    record::Record record = instrument::simulate_record(scenario);
    record.declared.lockin_threshold_deg_h = device.declared_threshold_deg_h;
    return record;
}

Truth truth_of(const Case& of, const Device& device) {
    Truth truth;
    truth.turns = of.turns;
    truth.seed = of.seed;
    truth.lockin_threshold_deg_h = device.threshold_deg_h;
    truth.dither_peak_rate_deg_s = device.peak_rate_deg_s;
    truth.readout_noise = device.readout_noise;
    truth.injected_noise_rad = device.injected_rad;
    truth.scale_factor_arcsec = device.scale_factor_arcsec;
    truth.dither_frequency_hz = device.dither_frequency_hz;
    std::mt19937_64 random(of.seed + 1);
    truth.initial_phase_rad = std::uniform_real_distribution<double>(0.0, units::two_pi)(random);
    truth.input_rate_deg_h = device.rate_deg_h;
    if (of.condition->moving) {
        truth.wander.walk_per_turn = walk_relative_rt_s / std::sqrt(2.0 * truth.dither_frequency_hz);
        truth.wander.drift_per_s = drift_relative_per_h / 3600.0;
        truth.input_profile_deg_h = {device.profile_time_s, device.profile_rate_deg_h};
    }
    truth.temperature.swing_k = temperature_swing_k;
    truth.temperature.period_s = 0.4 * device.duration_s;
    truth.temperature.interval_s = temperature_interval_s;
    for (const Added& added : of.added()) {
        for (const auto& [name, value] : added.values) {
            const std::string key = name.empty() ? added.effect : added.effect + "." + name;
            set(truth, key, fmt::format("{:.17g}", value));
        }
    }
    return truth;
}

/// The parameter that says how much there is of an effect.
const effects::Parameter& size_of(const effects::Effect& effect) {
    using effects::Role;
    const effects::Parameter* phase = nullptr;
    for (const effects::Parameter& parameter : effect.parameters()) {
        if (parameter.role == Role::size || parameter.role == Role::deviation || parameter.role == Role::probability) {
            return parameter;
        }
        if (parameter.role == Role::phase) phase = &parameter;
    }
    return *phase;
}

/// Sizes of an effect that come together, for each unit of the main one.
std::map<std::string, double> proportions_of(const std::string& effect) {
    std::map<std::string, double> proportions;
    const effects::Effect& of = *effects::find(effect);
    const effects::Parameter& main = size_of(of);
    for (const effects::Parameter& parameter : of.parameters()) {
        if (&parameter == &main || parameter.typical == 0.0) continue;
        proportions[std::string(parameter.name)] = parameter.typical / main.typical;
    }
    return proportions;
}

/// Sets the main size of an effect, and with it those in proportion to it.
void set_size(Added& added, double size) {
    added.values.at(std::string(size_of(*effects::find(added.effect)).name)) = size;
    for (const auto& [name, per] : proportions_of(added.effect)) added.values.at(name) = per * size;
}

/// Whether all sizes are well within their bounds.
bool is_within_bounds(const Added& added) {
    const effects::Effect& effect = *effects::find(added.effect);
    for (const effects::Parameter& parameter : effect.parameters()) {
        const double value = added.values.at(std::string(parameter.name));
        if (parameter.role == effects::Role::size && !(value > 0.5 * parameter.min && value < 0.5 * parameter.max)) {
            return false;
        }
    }
    return true;
}

}  // namespace

std::vector<record::Record> make(std::span<const Case> cases) {
    std::vector<record::Record> records(cases.size());
    std::vector<Truth> truths;
    std::vector<std::size_t> direct;
    for (std::size_t k = 0; k < cases.size(); ++k) {
        if (cases[k].direct) {
            truths.push_back(truth_of(cases[k], device_of(cases[k])));
            direct.push_back(k);
        } else {
            records[k] = by_map(cases[k], device_of(cases[k]));
        }
    }
    auto generated = generate(truths);
    for (std::size_t k = 0; k < direct.size(); ++k) {
        records[direct[k]] = std::move(generated[k]);
        records[direct[k]].declared.lockin_threshold_deg_h = device_of(cases[direct[k]]).declared_threshold_deg_h;
    }
    return records;
}

double duration_s(const Case& of) { return device_of(of).duration_s; }

std::vector<std::string> effects_on_turns() {
    std::vector<std::string> names;
    for (const effects::Effect* effect : effects::registry()) {
        const auto parameters = effect->parameters();
        if (std::none_of(parameters.begin(), parameters.end(),
                         [](const auto& p) { return p.role == effects::Role::sampled; })) {
            names.emplace_back(effect->name());
        }
    }
    return names;
}

Added draw(const std::string& name, double size, std::uint64_t seed, double duration_s) {
    std::mt19937_64 random(seed ^ 0x5eed);
    const auto between = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
    const effects::Effect& effect = *effects::find(name);
    const effects::Parameter& main = size_of(effect);
    Added added{name, {}};
    for (const effects::Parameter& parameter : effect.parameters()) {
        using effects::Role;
        double& value = added.values[std::string(parameter.name)];
        value = parameter.default_value;
        if (&parameter == &main) {
            // A size with a phase has its sign in that.
            const auto all = effect.parameters();
            const bool turned =
                std::any_of(all.begin(), all.end(), [](const auto& p) { return p.role == Role::phase; });
            const bool either_sign = parameter.min < 0.0 && parameter.role == Role::size && !turned;
            value = size * (either_sign && between(0.0, 1.0) < 0.5 ? -1.0 : 1.0);
        } else if (parameter.role == Role::size) {
            value = 0.0;
        } else if (parameter.role == Role::phase) {
            value = between(-units::pi, units::pi);
        } else if (parameter.role == Role::time) {
            value = between(0.2, 0.8) * duration_s;
        } else if (parameter.role == Role::frequency) {
            value = std::exp(between(std::log(0.5), std::log(100.0)));
        }
    }
    set_size(added, added.values.at(std::string(main.name)));
    return added;
}

double start_size(const std::string& name) {
    using effects::Role;
    const effects::Parameter& main = size_of(*effects::find(name));
    if (main.role == Role::deviation) return name == "quantum_noise" ? 1e-4 : 1e-2;
    return main.role == Role::probability ? 1e-3 : 0.02 * std::min(1.0, main.max);
}

namespace {

/// Scales an effect whose sizes come together to `multiple` times the size at which the gain of the log-likelihood that
/// is expected of it equals what the level of an effect asks for. The gain goes with the square of the size.
bool settle_by_gain(Case& of) {
    constexpr double looked_at = 3.0;  // times the limit: large beside what noise gains
    constexpr int rounds = 4;
    Added& added = of.truth.front();
    const effects::Effect& effect = *effects::find(added.effect);
    const double asked = gain_asked({added.effect}, static_cast<double>(effects::registry().size()));
    const auto sizes = static_cast<double>(1 + proportions_of(added.effect).size());
    double limit = added.values.at(std::string(size_of(effect).name)) / of.multiple;
    Case at = of;
    at.direct = false;
    for (int round = 0; round < rounds; ++round) {
        set_size(at.truth.front(), looked_at * limit);
        if (!is_within_bounds(at.truth.front())) return false;
        at.noise = static_cast<std::uint64_t>(round);
        const ActiveEffect known{&effect, {at.truth.front().values.begin(), at.truth.front().values.end()}};
        const double gain = fit_turns(make({&at, 1}).front(), {known}).log_likelihood_gain - 0.5 * sizes;
        const double factor = std::sqrt(asked / std::max(gain, asked)) * looked_at;
        limit *= std::clamp(gain < asked ? looked_at : factor, 0.2, looked_at);
    }
    set_size(added, of.multiple * limit);
    return is_within_bounds(added);
}

}  // namespace

bool settle(Case& of) {
    if (of.truth.size() == 1 && !proportions_of(of.truth.front().effect).empty()) return settle_by_gain(of);
    constexpr int most_rounds = 8;
    // What one record tells of a random process is random itself.
    const bool random_process = std::any_of(of.truth.begin(), of.truth.end(), [](const Added& added) {
        return size_of(*effects::find(added.effect)).role == effects::Role::deviation;
    });
    const std::uint64_t records = random_process ? 4 : 2;
    bool within = true;
    for (int round = 0; round < most_rounds; ++round) {
        Case at_limit = of;
        at_limit.direct = false;
        at_limit.foreign.clear();
        std::vector<ActiveEffect> known;
        for (Added& added : at_limit.truth) {
            const effects::Effect* effect = effects::find(added.effect);
            set_size(added, added.values.at(std::string(size_of(*effect).name)) / of.multiple);
            known.push_back({effect, added.values});
        }
        std::vector<double> information(known.size(), 0.0);
        for (std::uint64_t k = 0; k < records; ++k) {
            Case another = at_limit;
            another.noise = k;
            for (const Estimate& estimate :
                 ringlock::closure::information_on_turns(make({&another, 1}).front(), known)) {
                for (std::size_t e = 0; e < known.size(); ++e) {
                    if (known[e].effect->name() != estimate.effect) continue;
                    if (size_of(*known[e].effect).name != estimate.name || !(estimate.sd > 0.0)) continue;
                    information[e] += 1.0 / (estimate.sd * estimate.sd) / static_cast<double>(records);
                }
            }
        }
        double most = 1.0;
        within = true;
        for (std::size_t e = 0; e < known.size(); ++e) {
            const effects::Parameter& main = size_of(*known[e].effect);
            const std::string parameter(main.name);
            const double size = known[e].values.at(parameter);
            const double sd = 1.0 / std::sqrt(information[e]);
            // Of a random process the variance is told, of which the information hardly depends: its deviation times
            // the error of that stays.
            const bool random = main.role == effects::Role::deviation;
            const double limit = random ? std::sqrt(std::abs(size) * 4.0 * sd) : 4.0 * sd;
            const double factor = std::clamp(limit / std::abs(size), 1e-3, 1e3);
            most = std::max({most, factor, 1.0 / factor});
            const double least = 0.5 * main.min;
            const double largest = 0.5 * main.max;
            within = within && of.multiple * factor * size > least && of.multiple * factor * size < largest;
            set_size(of.truth[e], std::clamp(of.multiple * factor * size, least, largest));
        }
        if (most < 1.05) break;
    }
    return within;
}

std::vector<Case> foreign_cases(std::size_t each, std::uint64_t series) {
    std::vector<Case> cases;
    std::mt19937_64 random(77 + series);
    const auto between = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
    const auto add = [&](std::size_t condition, Where where, Added added) {
        Case of;
        of.kind = Kind::foreign;
        of.condition = &conditions[condition];
        of.direct = true;
        of.seed = seeds_of_series * series + 50000 + cases.size();
        of.where = where;
        of.foreign = {std::move(added)};
        cases.push_back(std::move(of));
    };
    // From what shows itself well to what is evident: sizes are even in their logarithms.
    const auto even = [&](double a, double b) { return std::exp(between(std::log(a), std::log(b))); };
    for (std::size_t k = 0; k < each; ++k) {
        const bool injected = k % 2 == 1;
        add(k % 2, Where::phase,
            {"lockin_third_harmonic",
             {{"ratio", injected ? even(0.1, 0.4) : even(0.02, 0.4)}, {"phase_rad", between(-3.0, 3.0)}}});
        add(0, Where::time, {"telegraph_bias", {{"step_deg_h", even(1e-3, 1e-1)}, {"dwell_s", between(4.0, 10.0)}}});
        add(2, Where::rate, {"bias_per_rate_squared_h_deg", {{"", even(1e-7, 1e-5)}}});
        add(2, Where::amplitude, {"bias_per_relative_amplitude_deg_h", {{"", even(100.0, 10000.0)}}});
        add(k % 2, Where::frequency,
            {"chirped_line",
             {{"frequency_hz", between(2.0, 30.0)},
              {"chirp_hz_per_s", even(1e-3, 2e-2) * (k % 3 == 0 ? -1.0 : 1.0)},
              {"rate_deg_h", injected ? even(3.0, 30.0) : even(0.02, 1.0)},
              {"phase_rad", between(-3.0, 3.0)}}});
    }
    // Off the period of the temperature, 0.4 of the record: a threshold of that period follows the temperature.
    for (std::size_t k = 0; k < each; ++k) {
        const bool injected = k % 2 == 1;
        add(k % 2, Where::time,
            {"lockin_swing",
             {{"ratio", injected ? even(0.1, 0.5) : even(2e-3, 0.2)},
              {"period_s", k % 3 == 0 ? even(6.0, 18.0) : even(35.0, 130.0)}}});
    }
    return cases;
}

}  // namespace ringlock::test::closure
