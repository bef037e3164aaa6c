#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "engine/effects/effect.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/gyro/device.hpp"
#include "engine/scenario/text/render.hpp"
#include "engine/simd/target.hpp"
#include "tests/property/random_scenario.hpp"
#include "tests/support/gyro_records.hpp"

namespace ringlock::effects {
namespace effects_test {
namespace {

using scenario::Scenario;
using test::GyroRecord;
using test::RandomScenarios;
using test::simulate;

bool makes_it_act(Role role) {
    return role == Role::size || role == Role::deviation || role == Role::probability || role == Role::sampled;
}

/// Half-way to the upper bound, which is not the default of any parameter.
double inside(const Parameter& p) { return 0.5 * p.max; }

// The parameter that makes an effect act stands at zero, every other one somewhere.
TEST(EffectProperty, AnEffectWithoutSizeChangesNothing) {
    RandomScenarios random(21);
    for (const Effect* effect : registry()) {
        const std::string name(effect->name());
        Scenario without = random.next();
        without.environment.temperature_ramp_k_per_h = 100.0;
        for (const Parameter& p : effect->parameters()) without.effects[name][std::string(p.name)] = 0.0;
        Scenario with = without;
        bool sized = false;
        for (const Parameter& p : effect->parameters()) {
            sized = sized || makes_it_act(p.role);
            if (!makes_it_act(p.role) && effect->parameters().size() > 1) {
                with.effects[name][std::string(p.name)] = inside(p);
            }
        }
        EXPECT_TRUE(sized || name == "detector_phase_offset") << name;
        ASSERT_TRUE(scenario::check(with).empty()) << name;
        EXPECT_FALSE(effect->active(with.effects[name])) << name;
        EXPECT_EQ(simulate(with, 1).counts, simulate(without, 1).counts) << name << "\n" << to_toml(without);
    }
}

/// No chance, no lock-in, and a temperature that is linear in time.
Scenario plain(RandomScenarios& random) {
    Scenario scenario = random.next();
    scenario.effects = scenario::default_effect_settings();
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = scenario::ReadoutModel::ideal;
    scenario.readout.angle_output = scenario::AngleOutput::interpolated;
    scenario.environment.temperature_ramp_k_per_h = random.uniform(-1000.0, 1000.0);
    scenario.arms = scenario::parse_arms({"ideal"});
    return scenario;
}

// What the block adds, half cycle by half cycle, is what the effect says of the whole time at once.
TEST(EffectProperty, OutputsMoveByTheAngleThatAnEffectSaysItAdds) {
    RandomScenarios random(22);
    for (const Effect* effect : registry()) {
        if (!effect->adds_angle()) continue;
        const std::string name(effect->name());
        const Scenario without = plain(random);
        Scenario with = without;
        for (const Parameter& p : effect->parameters()) {
            double& value = with.effects[name][std::string(p.name)];
            value = p.role == Role::time        ? 0.3
                    : p.role == Role::frequency ? random.uniform(1.0, 90.0)
                                                : random.uniform(p.min, p.max);
        }
        const GyroRecord base = simulate(without, 1);
        const GyroRecord moved = simulate(with, 1);
        const double period_s = gyro::Device(base.setup).period_s();
        for (std::size_t k = 0; k < base.counts[0].size(); ++k) {
            const double time_s = static_cast<double>(k) * period_s;
            const double change_k = scenario::temperature_change_k(without.environment, time_s);
            const double rate = base.setup.input_rate_deg_h;
            const double expected =
                effect->change(with.effects[name])({0.0, time_s, {0.0, change_k}, {rate, rate}}).angle_arcsec;
            // Rounding of some hundred half cycles.
            ASSERT_NEAR(moved.angle_arcsec(0, k) - base.angle_arcsec(0, k), expected, 1e-9 + 1e-12 * std::abs(expected))
                << name << " minimum " << k << "\n"
                << to_toml(with);
        }
    }
}

// K smaller by 1 + r, with threshold and dither that leave the coupling and the swings in fringes where they are, is
// the effect: to the phase it is the input rate alone that has grown.
TEST(EffectProperty, AScaleFactorErrorIsAnotherScaleFactorButForTheSwingOfTheDither) {
    RandomScenarios random(23);
    for (int i = 0; i < 4; ++i) {
        constexpr double relative = 1e-3;
        Scenario erring = plain(random);
        erring.arms = scenario::parse_arms({"uncompensated"});
        Scenario other = erring;
        erring.effects["scale_factor_error"]["relative"] = relative;
        other.gyro.scale_factor_arcsec /= 1.0 + relative;
        other.gyro.lockin_threshold_deg_h /= 1.0 + relative;
        other.dither.peak_rate_deg_s /= 1.0 + relative;
        const GyroRecord one = simulate(erring, 0);
        const GyroRecord two = simulate(other, 0);
        for (std::size_t k = 0; k < one.counts[0].size(); ++k) {
            const auto apart = static_cast<double>(one.counts[0][k] - two.counts[0][k]);
            // The tables of both are right to 1e-10 rad a turn.
            ASSERT_NEAR(apart / ensemble::counts_per_fringe, 0.0, 1e-6) << k << "\n" << to_toml(erring);
        }
    }
}

struct Counted {
    std::vector<std::int64_t> counts;    ///< of the output, at minima
    std::vector<std::int64_t> quarters;  ///< missed
};

Counted count(const Scenario& scenario) {
    const auto arms = scenario::parse_arms({"uncompensated"});
    ensemble::GyroBlock block(scenario, arms, 1, 1);
    Counted out;
    for (int piece = 0; piece < 8; ++piece) {
        constexpr std::size_t turns = 128;
        block.advance(turns);
        for (std::size_t i = 0; i < turns; i += 2) {
            out.counts.push_back(block.counts(0)[i / 2][0]);
            out.quarters.push_back(
                block.count_errors().empty() ? 0 : static_cast<std::int64_t>(block.count_errors()[i][0]));
        }
    }
    return out;
}

constexpr auto fringe = static_cast<std::int64_t>(ensemble::counts_per_fringe);

// What an instrument reads from pulses as well is left out: a swing that seems longer changes its weights.
std::vector<Scenario> missing(RandomScenarios& random, scenario::AngleOutput output) {
    std::vector<Scenario> all;
    for (int i = 0; i < 6; ++i) {
        Scenario scenario = random.next();
        scenario.readout.angle_output = output;
        if (scenario.readout.model == scenario::ReadoutModel::instrument) {
            scenario.readout.phase_from = scenario::PhaseFrom::detectors;
        }
        scenario.effects["missed_counts"]["probability_per_turn"] = random.uniform(0.02, 0.2);
        all.push_back(scenario);
    }
    return all;
}

Scenario without_misses(Scenario scenario) {
    scenario.effects["missed_counts"]["probability_per_turn"] = 0.0;
    return scenario;
}

TEST(EffectProperty, AQuarterFringeOutputLosesEveryCountThatIsMissed) {
    RandomScenarios random(24);
    for (const Scenario& scenario : missing(random, scenario::AngleOutput::quarter_fringe)) {
        const Counted all = count(without_misses(scenario));
        const Counted fewer = count(scenario);
        EXPECT_NE(fewer.quarters, all.quarters);
        for (std::size_t k = 0; k < all.counts.size(); ++k) {
            // Either is rounded to a count.
            ASSERT_LE(std::abs(fewer.counts[k] - all.counts[k] - fewer.quarters[k] * (fringe / 4)), 1)
                << k << "\n"
                << to_toml(scenario);
        }
    }
}

TEST(EffectProperty, AnInterpolatedOutputLosesWholeFringesOnceTwoCountsAreMissed) {
    RandomScenarios random(25);
    std::int64_t most = 0;
    for (const Scenario& scenario : missing(random, scenario::AngleOutput::interpolated)) {
        const Counted all = count(without_misses(scenario));
        const Counted fewer = count(scenario);
        for (std::size_t k = 0; k < all.counts.size(); ++k) {
            const std::int64_t lost = fewer.counts[k] - all.counts[k];
            const auto whole = static_cast<std::int64_t>(std::llround(static_cast<double>(lost) / fringe));
            ASSERT_LE(std::abs(lost - whole * fringe), 1) << k << "\n" << to_toml(scenario);
            // The branch nearest to the quarter that the counter names: at most two quarters from the phase's own.
            ASSERT_LE(std::abs(fewer.quarters[k] - 4 * whole), 2) << k << "\n" << to_toml(scenario);
            most = std::max(most, std::abs(whole));
        }
    }
    EXPECT_GE(most, 1) << "no scenario has lost a fringe";
}

TEST(EffectProperty, MissedCountsAreTheSameOnAllInstructionSets) {
    RandomScenarios random(26);
    for (int i = 0; i < 3; ++i) {
        Scenario scenario = random.next();
        scenario.arms = scenario::parse_arms(test::served_arms(scenario));
        scenario.noise_injection.turn_phase_rms_rad = 1.0;
        scenario.effects["missed_counts"]["probability_per_turn"] = 0.05;
        const GyroRecord best = simulate(scenario, 1);
        for (const std::string& target : simd::available_targets()) {
            simd::use_target(target);
            EXPECT_EQ(simulate(scenario, 1).counts, best.counts) << target << "\n" << to_toml(scenario);
        }
        simd::use_best_target();
    }
}

}  // namespace
}  // namespace effects_test
}  // namespace ringlock::effects
