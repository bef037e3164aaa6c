// Records of simulated gyros against what is known of the scenario.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "analysis/instrument/simulate.hpp"
#include "analysis/study/study.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/gyro/device.hpp"
#include "tests/support/expect_throw.hpp"

namespace ringlock::instrument {
namespace record_simulated_test {
namespace {

using scenario::Scenario;
using testing::AllOf;
using testing::HasSubstr;

Scenario short_run() {
    Scenario s;
    s.ensemble.gyros = 3;
    s.ensemble.duration_s = 4.0;
    s.ensemble.dither_amplitude_sd_relative = 0.0;
    s.output.sample_interval_s = 1.0;
    s.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    return s;
}

Scenario plain_run() {
    Scenario s = short_run();
    s.record.trajectory = scenario::parse_arm("uncompensated");
    return s;
}

std::string faults(const record::Record& record) {
    std::string text;
    for (const record::Finding& finding : record::check(record)) text += finding.where + ": " + finding.what + "\n";
    return text;
}

/// Quarter that the detectors name, modulo 4.
std::int64_t quarter(double sine, double cosine) {
    return (static_cast<std::int64_t>(std::floor(std::atan2(sine, cosine) / (0.5 * units::pi))) + 4) % 4;
}

TEST(SimulatedRecord, EveryReadoutGivesARecordWithoutFault) {
    for (const auto model :
         {scenario::ReadoutModel::ideal, scenario::ReadoutModel::latched, scenario::ReadoutModel::instrument}) {
        for (const auto& trajectory : {scenario::parse_arm("uncompensated"), scenario::parse_arm("noise_injected")}) {
            Scenario s = short_run();
            s.readout.model = model;
            s.record.trajectory = trajectory;
            s.environment.temperature_ramp_k_per_h = 100.0;
            const record::Record r = simulate_record(s, 1);
            EXPECT_EQ(faults(r), "");
            EXPECT_NEAR(static_cast<double>(r.turns->size()), 2.0 * 4.0 * s.dither.frequency_hz, 2.0);
            EXPECT_EQ(r.turns->direction.front(), 1);
            EXPECT_EQ(r.declared.lockin_threshold_deg_h, s.gyro.lockin_threshold_deg_h);
            EXPECT_EQ(r.declared.clock_hz, model == scenario::ReadoutModel::ideal ? 0.0 : s.readout.clock_hz);
            EXPECT_NEAR(r.temperature_c.at(3.6), 20.1, 1e-12);
            EXPECT_EQ(r.input_rate_deg_h.at(1.0), s.input.rate_deg_h);
        }
    }
}

// Without lock-in, input and errors the drive alone decides: times, counts, accelerations in closed form.
TEST(SimulatedRecord, OfAGyroWithoutLockinIsItsDrive) {
    Scenario s = plain_run();
    s.gyro.lockin_threshold_deg_h = 0.0;
    s.readout.model = scenario::ReadoutModel::ideal;
    s.input.rate_deg_h = 0.0;
    s.ensemble.dither_asymmetry_sd_ratio = 0.0;
    const gyro::Setup setup = ensemble::draw_setup(s, 0);
    const gyro::Device device(setup);
    const record::Turns t = *simulate_record(s).turns;
    const double w = units::two_pi * s.dither.frequency_hz;
    for (std::size_t i = 0; i < t.size(); ++i) {
        const double phase = device.initial_phase_rad + (i % 2 == 0 ? 0.0 : 2.0 * device.dither_amplitude_rad);
        EXPECT_NEAR(t.time_s[i], 0.5 * static_cast<double>(i) / s.dither.frequency_hz, 1e-12);
        EXPECT_EQ(t.quarter_count[i], static_cast<std::int64_t>(std::floor(phase / (0.5 * units::pi))));
        EXPECT_NEAR(t.sine[i], std::sin(phase), 1e-9);
        EXPECT_NEAR(t.cosine[i], std::cos(phase), 1e-9);
        EXPECT_NEAR(t.accel_after_rad_s2[i] / (device.dither_amplitude_rad * w * w), 1.0, 1e-9);
    }
}

// With an input rate Omega the zero-rate points of a drive Omega_D sin(w t) lie at sin(w t) = -Omega/Omega_D; at minima
// before those of the dither where Omega is positive.
TEST(SimulatedRecord, TimesAreThoseAtWhichTheRateVanishes) {
    for (const double rate_deg_h : {30000.0, -30000.0}) {
        Scenario s = plain_run();
        s.gyro.lockin_threshold_deg_h = 0.0;
        s.readout.model = scenario::ReadoutModel::ideal;
        s.input.rate_deg_h = rate_deg_h;
        s.ensemble.dither_asymmetry_sd_ratio = 0.0;
        const double w = units::two_pi * s.dither.frequency_hz;
        const double early = std::asin(rate_deg_h / (s.dither.peak_rate_deg_s * 3600.0)) / w;
        const auto expect_times = [&](double tolerance_s) {
            const record::Turns t = *simulate_record(s).turns;
            for (std::size_t i = 0; i < t.size(); ++i) {
                const double nominal = 0.5 * static_cast<double>(i) / s.dither.frequency_hz;
                ASSERT_NEAR(t.time_s[i], nominal + (i % 2 == 0 ? -early : early), tolerance_s) << i;
            }
        };
        expect_times(1e-12);
        // A tick either way for each pulse; the curve's asymmetry about the turn, O(t^2 w tan(w early)), is the rest.
        s.readout.model = scenario::ReadoutModel::latched;
        expect_times(5e-8);
    }
}

TEST(SimulatedRecord, TimesOfAClockAreWholeTicks) {
    for (const auto model : {scenario::ReadoutModel::latched, scenario::ReadoutModel::instrument}) {
        Scenario s = short_run();
        s.readout.model = model;
        s.readout.clock_hz = 1e6;
        const record::Turns clocked = *simulate_record(s).turns;
        s.readout.clock_hz = 0.0;
        const record::Turns continuous = *simulate_record(s).turns;
        ASSERT_EQ(clocked.size(), continuous.size());
        for (std::size_t i = 0; i < clocked.size(); ++i) {
            const double ticks = clocked.time_s[i] * 1e6;
            EXPECT_NEAR(ticks, std::nearbyint(ticks), 1e-6);
            // Two floored pulses and a floored middle. Where nearest pulses fall together others may be taken.
            EXPECT_NEAR(clocked.time_s[i], continuous.time_s[i], 3e-6);
        }
    }
}

TEST(SimulatedRecord, CountsAndDetectorsNameTheSameQuarter) {
    Scenario s = short_run();
    s.readout.model = scenario::ReadoutModel::ideal;
    const record::Turns t = *simulate_record(s).turns;
    for (std::size_t i = 0; i < t.size(); ++i) {
        ASSERT_EQ(((t.quarter_count[i] % 4) + 4) % 4, quarter(t.sine[i], t.cosine[i])) << i;
    }
}

TEST(SimulatedRecord, DetectorsKeepTheirEllipse) {
    Scenario s = short_run();
    s.readout.model = scenario::ReadoutModel::instrument;
    s.effects["readout_ellipse"]["gain"] = 0.1;
    const record::Turns t = *simulate_record(s).turns;
    double sine = 0.0;
    double cosine = 0.0;
    for (std::size_t i = 0; i < t.size(); ++i) {
        sine = std::max(sine, std::abs(t.sine[i]));
        cosine = std::max(cosine, std::abs(t.cosine[i]));
    }
    EXPECT_NEAR(sine, 1.1, 0.03);
    EXPECT_NEAR(cosine, 1.0, 0.03);
}

// Swings of a dither that drifts: 2 M (1 + drift t) fringes, and as much off a straight line as its wander makes.
TEST(SimulatedRecord, AmplitudesDriftAndWander) {
    Scenario s = plain_run();
    s.gyro.lockin_threshold_deg_h = 0.0;
    s.readout.model = scenario::ReadoutModel::ideal;
    s.ensemble.duration_s = 40.0;
    s.dither.amplitude_drift_relative_per_h = 3.6;
    const double swing = 4.0 * ensemble::nominal_setup(s).dither_peak_rate_deg_s * 3600.0 * 2.0 /
                         (units::two_pi * s.dither.frequency_hz * s.gyro.scale_factor_arcsec);
    record::Turns t = *simulate_record(s).turns;
    for (std::size_t i = 1; i < t.size(); i += 997) {
        const double middle_s = 0.5 * (t.time_s[i] + t.time_s[i - 1]);
        const auto gain = static_cast<double>(std::abs(t.quarter_count[i] - t.quarter_count[i - 1]));
        EXPECT_NEAR(gain, swing * (1.0 + 1e-3 * middle_s), 1.5) << i;
    }
    s.dither.amplitude_drift_relative_per_h = 0.0;
    s.dither.amplitude_wander_relative_rt_s = 1e-2;
    t = *simulate_record(s).turns;
    // Over n steps of a second each, W gains 1e-2 rms: the sum of squares is chi-square, six standard errors allowed.
    const auto a_second = static_cast<std::size_t>(std::llround(2.0 * s.dither.frequency_hz));
    double sum = 0.0;
    int steps = 0;
    double last = 0.0;
    for (std::size_t i = 1; i < t.size(); i += a_second) {
        const auto now = static_cast<double>(std::abs(t.quarter_count[i] - t.quarter_count[i - 1])) / swing - 1.0;
        if (steps++ > 0) sum += (now - last) * (now - last);
        last = now;
    }
    const double n = steps - 1;
    EXPECT_GT(n, 30);
    EXPECT_NEAR(sum / (n * 1e-4), 1.0, 6.0 * std::sqrt(2.0 / n));
}

TEST(SimulatedRecord, TheInputFollowsItsProfile) {
    Scenario s = plain_run();
    s.gyro.lockin_threshold_deg_h = 0.0;
    s.readout.model = scenario::ReadoutModel::ideal;
    s.input.profile_time_s = {1.0, 2.0};
    s.input.profile_rate_deg_h = {0.0, 3600.0};
    s.record.kind = scenario::RecordKind::samples;
    s.record.rate_hz = 10.0;
    const record::Record r = simulate_record(s);
    EXPECT_EQ(faults(r), "");
    ASSERT_EQ(r.samples->size(), 40U);
    EXPECT_NEAR(r.samples->t0_s, 0.1, 1e-12);
    double angle = 0.0;
    for (std::size_t i = 0; i < 40; ++i) {
        // 3600 arcsec/s^2 between 1 s and 2 s; the rate is constant over each half cycle, linear between turns.
        const double t = 0.1 * static_cast<double>(i + 1);
        const double expected = t < 1.0 ? 0.0 : t < 2.0 ? 1800.0 * (t - 1.0) * (t - 1.0) : 1800.0 + 3600.0 * (t - 2.0);
        angle += r.samples->values[i];
        EXPECT_NEAR(angle, expected, 1800.0 * std::pow(0.5 / s.dither.frequency_hz, 2)) << t;
    }
    EXPECT_NEAR(r.input_rate_deg_h.at(1.5), 1800.0, 1e-9);
    EXPECT_EQ(r.input_rate_deg_h.at(4.0), 3600.0);
    EXPECT_NEAR(*r.declared.input_rate_deg_h, (1800.0 + 7200.0) / 4.0, 15.0) << "the mean";
}

// A study sees the same profile: without lock-in and noise the mean output rate is the mean of the profile.
TEST(SimulatedRecord, AStudySeesTheSameProfileAndAmplitudes) {
    Scenario s = plain_run();
    s.ensemble.duration_s = 6.0;
    s.input.profile_time_s = {1.0, 2.0, 2.5};
    s.input.profile_rate_deg_h = {-1000.0, 3600.0, 50.0};
    s.dither.amplitude_wander_relative_rt_s = 1e-3;
    s.readout.model = scenario::ReadoutModel::ideal;
    s.arms = scenario::parse_arms({"ideal", "noise_injected+compensated_exact"});
    const study::Study study = study::run(study::Study(s), 1);
    for (const study::ArmStatistics& arm : study.arms) {
        for (const study::GyroStatistics& gyro : arm.gyros) {
            // Half a cycle's change of rate over the run; what the compensator leaves is far less.
            EXPECT_NEAR(gyro.rate_error_deg_h, 0.0, arm.arm.ideal ? 1e-3 : 0.05) << arm.arm.name;
        }
    }
}

// The turn map, whose tables must follow amplitudes and rates, against every fringe integrated.
TEST(LongSimulatedRecord, TurnMapAndDirectIntegrationAgree) {
    Scenario s = short_run();
    s.ensemble.duration_s = 3.0;
    s.input.profile_time_s = {0.0, 3.0};
    s.input.profile_rate_deg_h = {-2000.0, 3000.0};
    s.dither.amplitude_wander_relative_rt_s = 3e-3;
    s.dither.amplitude_drift_relative_per_h = 20.0;
    s.readout.model = scenario::ReadoutModel::ideal;
    const record::Turns map = *simulate_record(s).turns;
    s.propagation.method = scenario::PropagationMethod::direct;
    const record::Turns direct = *simulate_record(s).turns;
    ASSERT_EQ(map.size(), direct.size());
    for (std::size_t i = 0; i < map.size(); ++i) {
        // 1e-10 rad a half cycle on either way, over 750 of them.
        ASSERT_NEAR(
            std::remainder(std::atan2(map.sine[i], map.cosine[i]) - std::atan2(direct.sine[i], direct.cosine[i]),
                           units::two_pi),
            0.0, 2e-7)
            << i;
        ASSERT_NEAR(map.time_s[i], direct.time_s[i], 1e-12);
    }
}

TEST(SimulatedRecord, DependsOnSeedAndGyroAlone) {
    Scenario s = short_run();
    const record::Turns one = *simulate_record(s, 2).turns;
    EXPECT_EQ(simulate_record(s, 2).turns->sine, one.sine);
    EXPECT_NE(simulate_record(s, 1).turns->sine, one.sine);
    s.ensemble.seed = 2;
    EXPECT_NE(simulate_record(s, 2).turns->sine, one.sine);
}

TEST(SimulatedRecord, TimesGoOnAfterSettling) {
    Scenario s = plain_run();
    s.ensemble.settle_s = 2.0;
    const record::Turns t = *simulate_record(s).turns;
    EXPECT_NEAR(t.time_s.front(), 2.0, 0.01);
    EXPECT_NEAR(t.time_s.back(), 6.0, 0.01);
}

TEST(SimulatedRecord, RefusesWhatCannotBe) {
    Scenario s = short_run();
    EXPECT_THAT(test::message_of<InputError>([&] { simulate_record(s, 3); }), HasSubstr("0 to 2"));
    s.noise_injection.turn_phase_rms_rad = 2000.0;
    s.arms = scenario::parse_arms({"uncompensated"});
    EXPECT_THAT(test::message_of<InputError>([&] { simulate_record(s); }), HasSubstr("record.trajectory"));
    s = short_run();
    s.ensemble.duration_s = 1e9;
    EXPECT_THAT(test::message_of<InputError>([&] { simulate_record(s); }), HasSubstr("ensemble.duration_s"));
    s = short_run();
    s.record.kind = scenario::RecordKind::samples;
    s.record.rate_hz = 0.1;
    EXPECT_THAT(test::message_of<InputError>([&] { simulate_record(s); }), HasSubstr("record.rate_hz"));
}

}  // namespace
}  // namespace record_simulated_test
}  // namespace ringlock::instrument
