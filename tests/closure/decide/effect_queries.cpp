// What the closed loop asks of effects, for those of the library and for effects that it does not have yet.
#include "analysis/closure/decide/effect_queries.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>
#include <vector>

#include "analysis/closure/samples/screen/screen.hpp"

namespace ringlock::test::closure {
namespace decide_effect_queries_test {
namespace {

using namespace ringlock::closure;
using effects::Effect;
using effects::Interval;
using effects::Parameter;
using effects::Role;
using effects::Values;

/// An effect that adds the angle of one size, given by its parameters.
class Added final : public Effect {
   public:
    Added(std::string_view name, std::vector<Parameter> parameters, double (*angle)(const Interval&))
        : name_(name), parameters_(std::move(parameters)), angle_(angle) {}
    std::string_view name() const override { return name_; }
    std::string_view summary() const override { return ""; }
    std::string_view advice() const override { return ""; }
    std::string_view equation() const override { return ""; }
    std::span<const Parameter> parameters() const override { return parameters_; }
    bool active(const Values& /*values*/) const override { return true; }
    effects::Changes changes() const override { return {.angle = true}; }
    effects::ChangeOver change(const Values& values) const override {
        return [size = values.at(std::string(parameters_[0].name)), angle = angle_](const Interval& at) {
            return effects::Change{.angle_arcsec = size * angle(at)};
        };
    }

   private:
    std::string_view name_;
    std::vector<Parameter> parameters_;
    double (*angle_)(const Interval&);
};

// The number sets the level of every effect on samples. It changes with the library only.
TEST(EffectQueries, FourteenEffectsShowOnSamples) { EXPECT_EQ(effects_on_samples(), 14.0); }

TEST(EffectQueries, EffectsShowOnSamplesByTheirRoles) {
    const std::map<std::string_view, OnSamples> shown = {{"base_vibration", OnSamples::rate_line},
                                                         {"bias_instability", OnSamples::flicker},
                                                         {"bias_ramp", OnSamples::rate},
                                                         {"bias_step", OnSamples::step},
                                                         {"bias_temperature", OnSamples::rate},
                                                         {"case_motion", OnSamples::motion},
                                                         {"count_quantization", OnSamples::resolution},
                                                         {"dither_residue", OnSamples::angle_line},
                                                         {"mode_hop", OnSamples::step},
                                                         {"null_shift_ramp", OnSamples::rate},
                                                         {"quantum_noise", OnSamples::white},
                                                         {"rate_random_walk", OnSamples::walk},
                                                         {"resampling", OnSamples::transport},
                                                         {"scale_factor_error", OnSamples::rate}};
    for (const Effect* effect : effects::registry()) {
        const auto found = shown.find(effect->name());
        EXPECT_EQ(on_samples(*effect), found == shown.end() ? OnSamples::nothing : found->second) << effect->name();
    }
}

// Samples show no more of it than its step: it is an alternative of the effect that is a step alone.
TEST(EffectQueries, AnEffectThatStepsMoreThanTheRateIsAnAlternativeOfTheStep) {
    const Effect* step = effects::find("bias_step");
    const Effect* hop = effects::find("mode_hop");
    const std::array<const Effect*, 2> library{hop, step};
    EXPECT_EQ(effects_that_show(OnSamples::step, library), (Effects{step, hop}));
}

TEST(EffectQueries, OnlyWhatFollowsTheTemperatureChangesWithIt) {
    for (const Effect* effect : effects::registry()) {
        if (!effect->adds_angle()) continue;
        const auto angle = unit_angle(*effect);
        const Interval cold{.start_s = 10.0, .duration_s = 10.0};
        Interval warm = cold;
        warm.temperature_change_k[0] = 3.0;
        warm.temperature_change_k[1] = 4.0;
        Interval turned = cold;
        turned.input_rate_deg_h[0] = turned.input_rate_deg_h[1] = 3.0;
        EXPECT_EQ(angle(warm) != angle(cold), effect->follows() == effects::Follows::temperature) << effect->name();
        EXPECT_EQ(angle(turned) != angle(cold), effect->follows() == effects::Follows::input_rate) << effect->name();
    }
    EXPECT_EQ(rate_per_kelvin(*effects::find("bias_temperature")), 1.0);
    EXPECT_EQ(rate_per_kelvin(*effects::find("bias_ramp")), 0.0);
}

SampleSeries warming() {
    SampleSeries series;
    series.rate_hz = 10.0;
    series.interval_s = 0.1;
    for (std::size_t i = 0; i < 200; ++i) {
        const double t = 0.1 * static_cast<double>(i);
        series.time_s.push_back(t + 0.1);
        series.increment.push_back(0.0);
        series.temperature_change_k.push_back(0.02 * t + 0.003 * t * t);
        series.temperature_slope_k_per_s.push_back(0.02 + 0.006 * t);
        series.input_rate_deg_h.push_back(10.0 * std::sin(t));
    }
    return series;
}

// Of each row the rate of the effect at unit size times its length, in the middle of the row.
TEST(RateColumns, AreTheClosedFormsOfTheLibrary) {
    const SampleSeries series = warming();
    const auto columns = rate_columns(series);
    ASSERT_EQ(columns.size(), 4U);
    EXPECT_EQ(columns[0].effect->name(), "bias_ramp");
    EXPECT_EQ(columns[0].name, "deg_h_per_h");
    EXPECT_EQ(columns[1].effect->name(), "bias_temperature");
    EXPECT_EQ(columns[2].effect->name(), "null_shift_ramp");
    EXPECT_EQ(columns[3].effect->name(), "scale_factor_error");
    for (std::size_t i = 0; i < series.size(); ++i) {
        EXPECT_NEAR((*columns[0].series)[i], (static_cast<double>(i) + 0.5) * 0.01 / 3600.0, 1e-15);
        EXPECT_NEAR((*columns[1].series)[i], 0.1 * series.temperature_change_k[i], 1e-13);
        EXPECT_NEAR((*columns[3].series)[i], 0.1 * series.input_rate_deg_h[i], 1e-13);
        EXPECT_NEAR((*columns[2].series)[i], 3600.0 * series.temperature_slope_k_per_s[i] * 0.1, 1e-9);
    }
}

TEST(RateColumns, WhatDoesNotChangeHasNone) {
    SampleSeries series = warming();
    series.temperature_change_k.clear();
    series.temperature_slope_k_per_s.clear();
    std::fill(series.input_rate_deg_h.begin(), series.input_rate_deg_h.end(), 15.0);
    const auto columns = rate_columns(series);
    ASSERT_EQ(columns.size(), 1U);
    EXPECT_EQ(columns[0].effect->name(), "bias_ramp");
}

// An effect that the library does not have has a column without a line of code for it: here a bias in proportion to the
// square of the input rate.
TEST(RateColumns, AnEffectThatIsNotInTheLibraryHasOne) {
    const Added square("rate_squared", {{"h_deg", 0.0, -1e3, 1e3, Role::size, ""}}, [](const Interval& at) {
        return at.duration_s * std::pow(0.5 * (at.input_rate_deg_h[0] + at.input_rate_deg_h[1]), 2);
    });
    const std::array<const Effect*, 1> library{&square};
    const SampleSeries series = warming();
    const auto columns = rate_columns(series, library);
    ASSERT_EQ(columns.size(), 1U);
    for (std::size_t i = 0; i < series.size(); ++i) {
        EXPECT_NEAR((*columns[0].series)[i], 0.1 * std::pow(series.input_rate_deg_h[i], 2), 1e-9);
    }
}

TEST(EffectQueries, OneEffectContainsAnotherWhereItIsThatOneAtSomeSizesOfZero) {
    const auto contained = [](std::string_view larger, std::string_view smaller) {
        return contains(*effects::find(larger), *effects::find(smaller));
    };
    EXPECT_TRUE(contained("mode_hop", "bias_step"));
    const auto in_addition_to_step = in_addition(*effects::find("mode_hop"), *effects::find("bias_step"));
    ASSERT_EQ(in_addition_to_step.size(), 2U);
    EXPECT_EQ(in_addition_to_step[0].value->name, "threshold_ratio");
    EXPECT_EQ(in_addition_to_step[1].value->name, "phase_rad");
    // There is no other such pair in the library.
    for (const Effect* larger : effects::registry()) {
        for (const Effect* smaller : effects::registry()) {
            if (larger->name() == "mode_hop" && smaller->name() == "bias_step") continue;
            EXPECT_FALSE(contains(*larger, *smaller)) << larger->name() << " and " << smaller->name();
        }
    }
}

}  // namespace
}  // namespace decide_effect_queries_test
}  // namespace ringlock::test::closure
