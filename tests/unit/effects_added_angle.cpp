#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace effects_added_angle_test {
namespace {

/// The rate [deg/h] that an effect's equation names, at one time.
struct Stated {
    std::string name;
    Values values;
    std::function<double(double time_s, double temperature_change_k, double input_rate_deg_h)> rate_deg_h;
};

const std::vector<Stated>& stated() {
    static const std::vector<Stated> all = {
        {"base_vibration",
         {{"frequency_hz", 3.7}, {"rate_deg_h", 5.0}, {"phase_rad", 0.4}},
         [](double t, double, double) { return 5.0 * std::sin(2.0 * std::numbers::pi * 3.7 * t + 0.4); }},
        {"bias_ramp", {{"deg_h_per_h", -90.0}}, [](double t, double, double) { return -90.0 * t / 3600.0; }},
        {"bias_step",
         {{"step_deg_h", 2.0}, {"time_s", 10.125}},
         [](double t, double, double) { return t >= 10.125 ? 2.0 : 0.0; }},
        {"bias_temperature", {{"deg_h_per_k", 0.3}}, [](double, double k, double) { return 0.3 * k; }},
        {"mode_hop",
         {{"step_deg_h", -2.0}, {"threshold_ratio", 0.1}, {"phase_rad", 0.2}, {"time_s", 10.125}},
         [](double t, double, double) { return t >= 10.125 ? -2.0 : 0.0; }},
        // The temperature falls by 0.25 K a second.
        {"null_shift_ramp", {{"deg_h_per_k_h", 0.01}}, [](double, double, double) { return -0.01 * 900.0; }},
        {"scale_factor_error", {{"relative", 1e-3}}, [](double, double, double rate) { return 1e-3 * rate; }},
    };
    return all;
}

/// What a gyro is exposed to between two times, if both are linear in time.
Interval between(double from_s, double to_s) {
    const auto temperature = [](double t) { return 3.0 - 0.25 * t; };
    const auto rate = [](double t) { return -40.0 + 6.0 * t; };
    return {from_s, to_s - from_s, {temperature(from_s), temperature(to_s)}, {rate(from_s), rate(to_s)}};
}

TEST(AddedAngles, AreThoseOfAllEffectsThatSayTheyAddOne) {
    std::size_t adding = 0;
    for (const Effect* effect : registry()) {
        adding += effect->adds_angle() ? 1 : 0;
    }
    EXPECT_EQ(adding, stated().size());
    for (const Stated& s : stated()) {
        EXPECT_TRUE(find(s.name)->adds_angle()) << s.name;
    }
}

TEST(AddedAngles, AreTheIntegralsOfTheStatedRates) {
    for (const Stated& s : stated()) {
        for (const auto& [from, to] : {std::pair{0.0, 0.004}, {0.004, 0.015}, {9.0, 11.0}, {11.0, 40.0}}) {
            // The midpoint rule, with a step that ends where the bias steps; its error is h^2/24 times the change of
            // the slope, below 1e-6 arcsec for the vibration's 20 ms.
            const int steps = 8 * static_cast<int>(std::ceil((to - from) * 1000.0));
            double expected = 0.0;
            for (int i = 0; i < steps; ++i) {
                const double t = from + (i + 0.5) * (to - from) / steps;
                expected += s.rate_deg_h(t, 3.0 - 0.25 * t, -40.0 + 6.0 * t) * (to - from) / steps;
            }
            EXPECT_NEAR(find(s.name)->change(s.values)(between(from, to)).angle_arcsec, expected, 1e-6)
                << s.name << " from " << from << " to " << to;
        }
    }
}

// 20 s under a temperature of 3 K to -2 K and a rate of -40 to 80 deg/h: no rate is faster than its bound, and some
// are as fast, which an effect that leaves its bound at zero is not.
TEST(AddedAngles, StayWithinTheirBounds) {
    const Exposure exposure{20.0 / 3600.0, 3.0, 0.25 * 3600.0, 80.0, 6.0};
    for (const Stated& s : stated()) {
        const Effect& effect = *find(s.name);
        const double bound = effect.bounds(s.values, exposure).rate_deg_h;
        const std::optional<double> slope = effect.bounds(s.values, exposure).rate_slope_deg_h_s;
        double fastest = 0.0;
        double steepest = 0.0;
        double last = 0.0;
        for (int i = 0; i < 20000; ++i) {
            const Interval at = between(1e-3 * i, 1e-3 * (i + 1));
            const double rate = effect.change(s.values)(at).angle_arcsec / at.duration_s;
            fastest = std::max(fastest, std::abs(rate));
            if (i > 0) steepest = std::max(steepest, std::abs(rate - last) / at.duration_s);
            last = rate;
        }
        // Temperatures of a few kelvin, 2.5e-4 K apart, are rounded.
        EXPECT_LE(fastest, bound * (1.0 + 1e-11)) << s.name;
        EXPECT_GE(fastest, 0.99 * bound) << s.name;
        EXPECT_GT(bound, 0.0) << s.name;
        if (!slope) continue;
        // Differences of rates, over a millisecond, are rounded; a millisecond of 20 ms is not the steepest point.
        EXPECT_LE(steepest, *slope * (1.0 + 1e-6)) << s.name;
        EXPECT_GE(steepest, 0.95 * *slope) << s.name;
    }
}

TEST(AddedAngles, OfIntervalsThatFollowEachOtherAddUp) {
    std::mt19937_64 engine(20070303);
    std::uniform_real_distribution<double> length(0.0, 0.5);
    for (const Stated& s : stated()) {
        const Effect& effect = *find(s.name);
        double sum = 0.0;
        double t = 0.0;
        for (int i = 0; i < 200; ++i) {
            const double next = t + length(engine);
            sum += effect.change(s.values)(between(t, next)).angle_arcsec;
            t = next;
        }
        const double whole = effect.change(s.values)(between(0.0, t)).angle_arcsec;
        EXPECT_NEAR(sum, whole, 1e-12 * (1.0 + std::abs(whole))) << s.name;  // rounding
    }
}

TEST(AddedAngles, AreProportionalToTheSizes) {
    for (const Stated& s : stated()) {
        const Effect& effect = *find(s.name);
        Values twice = s.values;
        Values none = s.values;
        for (const Parameter& p : effect.parameters()) {
            if (p.role != Role::size) continue;
            twice.at(std::string(p.name)) *= 2.0;
            none.at(std::string(p.name)) = 0.0;
        }
        const Interval at = between(10.0, 10.5);
        EXPECT_EQ(effect.change(twice)(at).angle_arcsec, 2.0 * effect.change(s.values)(at).angle_arcsec) << s.name;
        EXPECT_EQ(effect.change(none)(at).angle_arcsec, 0.0) << s.name;
    }
}

TEST(BiasStep, ActsFromItsTimeOnAndInPartOfTheIntervalItFallsInto) {
    const Values values = {{"step_deg_h", 2.0}, {"time_s", 10.0}};
    const Effect& effect = *find("bias_step");
    EXPECT_EQ(effect.change(values)({.start_s = 0.0, .duration_s = 9.0}).angle_arcsec, 0.0);
    EXPECT_DOUBLE_EQ(effect.change(values)({.start_s = 9.0, .duration_s = 4.0}).angle_arcsec, 6.0);
    EXPECT_DOUBLE_EQ(effect.change(values)({.start_s = 13.0, .duration_s = 1.0}).angle_arcsec, 2.0);
}

TEST(BiasRamp, GrowsWithTheSquareOfTime) {
    const Values values = {{"deg_h_per_h", 3600.0}};  // 1 arcsec/s^2
    const Effect& effect = *find("bias_ramp");
    EXPECT_DOUBLE_EQ(effect.change(values)({.start_s = 0.0, .duration_s = 2.0}).angle_arcsec, 2.0);
    EXPECT_DOUBLE_EQ(effect.change(values)({.start_s = 2.0, .duration_s = 2.0}).angle_arcsec, 6.0);
}

TEST(BaseVibration, IsTheIntegralOfTheLine) {
    const double f = 37.0;
    const double phase = 0.4;
    const Values values = {{"frequency_hz", f}, {"rate_deg_h", 5.0}, {"phase_rad", phase}};
    const double w = 2.0 * std::numbers::pi * f;
    for (const auto& [start, duration] : {std::pair{0.0, 0.004}, {0.004, 0.011}, {0.015, 1.0}}) {
        const double expected = 5.0 / w * (std::cos(w * start + phase) - std::cos(w * (start + duration) + phase));
        EXPECT_NEAR(find("base_vibration")->change(values)({.start_s = start, .duration_s = duration}).angle_arcsec,
                    expected, 1e-14);
    }
}

TEST(BaseVibration, AddsUpToTheSameAngleLateInALongRun) {
    const Values values = {{"frequency_hz", 10.0}, {"rate_deg_h", 1.0}, {"phase_rad", 0.0}};
    // A quarter of a period: the integral is A/(2 pi f).
    EXPECT_NEAR(find("base_vibration")->change(values)({.start_s = 1e7, .duration_s = 0.025}).angle_arcsec,
                1.0 / (20.0 * std::numbers::pi), 1e-9);
}

}  // namespace
}  // namespace effects_added_angle_test
}  // namespace ringlock::effects
