#include <gtest/gtest.h>

#include <algorithm>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace effects_registry_test {
namespace {

Values defaults_of(const Effect& effect) {
    Values values;
    for (const Parameter& p : effect.parameters()) values.emplace(p.name, p.default_value);
    return values;
}

TEST(EffectRegistry, IsSortedByNameWithoutDuplicates) {
    const auto all = registry();
    ASSERT_FALSE(all.empty());
    EXPECT_TRUE(std::is_sorted(all.begin(), all.end(),
                               [](const Effect* a, const Effect* b) { return a->name() <= b->name(); }));
    EXPECT_TRUE(std::is_sorted(planned().begin(), planned().end(), std::less_equal<>()));
}

TEST(EffectRegistry, FindsEachByItsNameAndNothingElse) {
    for (const Effect* effect : registry()) EXPECT_EQ(find(effect->name()), effect);
    EXPECT_EQ(find("nonsense"), nullptr);
    for (const std::string_view name : planned()) EXPECT_EQ(find(name), nullptr) << name;
}

TEST(EffectRegistry, DescribesEveryEffect) {
    for (const Effect* effect : registry()) {
        EXPECT_FALSE(effect->summary().empty()) << effect->name();
        EXPECT_FALSE(effect->equation().empty()) << effect->name();
        ASSERT_FALSE(effect->parameters().empty()) << effect->name();
        for (const Parameter& p : effect->parameters()) {
            EXPECT_FALSE(p.doc.empty()) << effect->name() << "." << p.name;
            EXPECT_LT(p.min, p.max) << effect->name() << "." << p.name;
            EXPECT_GE(p.default_value, p.min) << effect->name() << "." << p.name;
            EXPECT_LE(p.default_value, p.max) << effect->name() << "." << p.name;
        }
    }
}

TEST(EffectRegistry, OnlyQuantumNoiseActsUnasked) {
    for (const Effect* effect : registry()) {
        EXPECT_EQ(effect->active(defaults_of(*effect)), effect->name() == "quantum_noise") << effect->name();
    }
}

TEST(EffectRegistry, AnEffectAtItsDefaultsAddsNoAngle) {
    for (const Effect* effect : registry()) {
        if (effect->name() == "quantum_noise") continue;
        const auto process = effect->rate_process(defaults_of(*effect), {.seed = 1, .gyro = 0});
        if (process) {
            EXPECT_EQ(process->angle_arcsec(0.0, 10.0), 0.0) << effect->name();
        }
        const Interval warm{0.0, 10.0, {1.0, 2.0}, {15.0, 30.0}};
        const Change change = effect->change(defaults_of(*effect))(warm);
        EXPECT_EQ(change.angle_arcsec, 0.0) << effect->name();
        EXPECT_EQ(change.threshold_factor, 1.0) << effect->name();
        EXPECT_EQ(change.coupling_phase_rad, 0.0) << effect->name();
        const Bounds bounds = effect->bounds(defaults_of(*effect), {10.0, 100.0, 100.0, 1e4});
        EXPECT_EQ(bounds.rate_deg_h, 0.0) << effect->name();
        EXPECT_EQ(bounds.threshold_relative, 0.0) << effect->name();
        EXPECT_EQ(bounds.coupling_phase_rad, 0.0) << effect->name();
        EXPECT_EQ(angle_variance_arcsec2(effect->rate_noise(defaults_of(*effect)), 10.0), 0.0) << effect->name();
    }
}

gyro::Setup configured(std::string_view name, const Values& values, gyro::Setup setup = {}) {
    find(name)->configure(values, setup);
    return setup;
}

TEST(DetectorPhaseOffset, SetsTheCouplingPhase) {
    EXPECT_EQ(configured("detector_phase_offset", {{"phase_rad", 0.3}}).coupling_phase_rad, 0.3);
}

TEST(ReadoutEllipse, SetsTheDetectorsErrors) {
    const gyro::Setup setup = configured(
        "readout_ellipse", {{"gain", 0.1}, {"offset_sin", 0.2}, {"offset_cos", -0.3}, {"orthogonality_rad", 0.04}});
    EXPECT_EQ(setup.ellipse.gain, 0.1);
    EXPECT_EQ(setup.ellipse.offset_sin, 0.2);
    EXPECT_EQ(setup.ellipse.offset_cos, -0.3);
    EXPECT_EQ(setup.ellipse.orthogonality_rad, 0.04);
}

TEST(ReadoutEllipse, IsActiveByAnyOfItsParameters) {
    const Effect& effect = *find("readout_ellipse");
    for (const Parameter& p : effect.parameters()) {
        Values values = defaults_of(effect);
        values[std::string(p.name)] = 0.01;
        EXPECT_TRUE(effect.active(values)) << p.name;
    }
}

TEST(DitherAsymmetry, AddsToWhatTheGyroHasDrawn) {
    gyro::Setup drawn;
    drawn.dither_asymmetry_ratio = 0.001;
    EXPECT_DOUBLE_EQ(configured("dither_asymmetry", {{"ratio", 0.02}}, drawn).dither_asymmetry_ratio, 0.021);
}

TEST(SecondHarmonics, SetRatioAndPhase) {
    const gyro::Setup dither = configured("dither_second_harmonic", {{"ratio", 0.02}, {"phase_rad", 0.5}});
    EXPECT_EQ(dither.dither_harmonic_ratio, 0.02);
    EXPECT_EQ(dither.dither_harmonic_phase_rad, 0.5);
    const gyro::Setup lockin = configured("lockin_second_harmonic", {{"ratio", 0.1}, {"phase_rad", -0.5}});
    EXPECT_EQ(lockin.lockin_second_ratio, 0.1);
    EXPECT_EQ(lockin.lockin_second_phase_rad, -0.5);
}

TEST(SecondHarmonics, APhaseAloneDoesNothing) {
    for (const std::string_view name : {"dither_second_harmonic", "lockin_second_harmonic"}) {
        EXPECT_FALSE(find(name)->active({{"ratio", 0.0}, {"phase_rad", 1.0}})) << name;
        EXPECT_TRUE(find(name)->active({{"ratio", 0.01}, {"phase_rad", 0.0}})) << name;
    }
}

TEST(Effects, TheThresholdFollowsTheTemperature) {
    const Effect& effect = *find("lockin_temperature");
    const auto factor = [&](double relative_per_k, double change_k) {
        return effect.change({{"relative_per_k", relative_per_k}})({9.0, 0.0, {change_k, change_k}, {}})
            .threshold_factor;
    };
    EXPECT_DOUBLE_EQ(factor(0.02, 10.0), 1.2);
    EXPECT_DOUBLE_EQ(factor(-0.02, 10.0), 0.8);
    EXPECT_EQ(factor(0.02, 0.0), 1.0);
    EXPECT_DOUBLE_EQ(effect.bounds({{"relative_per_k", -0.02}}, {.temperature_change_k = 10.0}).threshold_relative,
                     0.2);
}

TEST(ModeHop, StepsThresholdAndPhaseWithTheMiddleOfAnInterval) {
    const Values values = {{"step_deg_h", 0.0}, {"threshold_ratio", -0.2}, {"phase_rad", 0.7}, {"time_s", 10.0}};
    const ChangeOver change = find("mode_hop")->change(values);
    EXPECT_EQ(change({.start_s = 9.0, .duration_s = 1.9}).threshold_factor, 1.0);
    EXPECT_EQ(change({.start_s = 9.0, .duration_s = 1.9}).coupling_phase_rad, 0.0);
    EXPECT_EQ(change({.start_s = 9.0, .duration_s = 2.1}).threshold_factor, 0.8);
    EXPECT_EQ(change({.start_s = 9.0, .duration_s = 2.1}).coupling_phase_rad, 0.7);
    const Bounds bounds = find("mode_hop")->bounds(values, {});
    EXPECT_EQ(bounds.threshold_relative, 0.2);
    EXPECT_EQ(bounds.coupling_phase_rad, 0.7);
}

TEST(MissedCounts, SetTheProbability) {
    EXPECT_EQ(configured("missed_counts", {{"probability_per_turn", 0.1}}).missed_count_probability, 0.1);
}

// What a fit relies on: a phase belongs to the size right before it, and everything that can act has a parameter that
// makes it act.
TEST(EffectRegistry, RolesMakeSense) {
    for (const Effect* effect : registry()) {
        bool acts = false;
        const Parameter* before = nullptr;
        for (const Parameter& p : effect->parameters()) {
            acts = acts || (p.role != Role::time && p.role != Role::frequency && p.role != Role::setting);
            if (p.role == Role::phase && before != nullptr) {
                EXPECT_EQ(before->role, Role::size) << effect->name() << "." << p.name;
            }
            if (p.role == Role::deviation || p.role == Role::probability) {
                EXPECT_EQ(p.min, 0.0) << effect->name() << "." << p.name;
            }
            before = &p;
        }
        EXPECT_TRUE(acts) << effect->name();
        EXPECT_FALSE(effect->adds_angle() && effect->rate_process(defaults_of(*effect), {}) != nullptr)
            << effect->name() << " either draws its rate or says what it adds";
    }
}

TEST(LockinTurnAsymmetry, SetsTheDifferenceBetweenTheTurns) {
    EXPECT_EQ(configured("lockin_turn_asymmetry", {{"ratio", 0.1}}).lockin_turn_asymmetry, 0.1);
}

TEST(EffectRegistry, ConstantsOfTheGyroAreLeftAloneByDefaults) {
    const gyro::Setup untouched;
    for (const Effect* effect : registry()) {
        gyro::Setup setup;
        effect->configure(defaults_of(*effect), setup);
        EXPECT_EQ(setup.dither_harmonic_ratio, untouched.dither_harmonic_ratio) << effect->name();
        EXPECT_EQ(setup.lockin_second_ratio, untouched.lockin_second_ratio) << effect->name();
        EXPECT_EQ(setup.lockin_turn_asymmetry, untouched.lockin_turn_asymmetry) << effect->name();
        EXPECT_EQ(setup.coupling_phase_rad, untouched.coupling_phase_rad) << effect->name();
        EXPECT_EQ(setup.missed_count_probability, untouched.missed_count_probability) << effect->name();
        EXPECT_EQ(setup.dither_asymmetry_ratio, untouched.dither_asymmetry_ratio) << effect->name();
    }
}

}  // namespace
}  // namespace effects_registry_test
}  // namespace ringlock::effects
