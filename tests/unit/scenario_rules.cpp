#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "engine/core/error.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/text/parse.hpp"
#include "engine/scenario/text/render.hpp"
#include "tests/support/scenario_complaint.hpp"

namespace ringlock::scenario {
namespace scenario_rules_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(ScenarioRules, TheDefaultsBreakNone) {
    EXPECT_THAT(check(Scenario{}), IsEmpty());
    EXPECT_FALSE(rules().empty());
}

TEST(ScenarioRules, TheDitherMustReverseTheRate) {
    // Half of 109.1 deg/s is 196380 deg/h, less six sigma of amplitude and asymmetry: 0.994^2 of it.
    EXPECT_EQ(complaint("[input]\nrate_deg_h = 194000"), "");
    EXPECT_THAT(complaint("[input]\nrate_deg_h = -194100"),
                AllOf(HasSubstr("s.toml:2:14: key \"input.rate_deg_h\" = -194100.0: "), HasSubstr("below 194031 deg/h"),
                      HasSubstr("the rate must reverse")));
    EXPECT_THAT(complaint("[effects.dither_asymmetry]\nratio = 0.2\n[input]\nrate_deg_h = 180000"),
                HasSubstr("s.toml:4:14: key \"input.rate_deg_h\""));
}

TEST(ScenarioRules, TheCulpritIsAKeyThatTheFileNames) {
    EXPECT_THAT(complaint("[dither]\npeak_rate_deg_s = 0.005"),
                HasSubstr("s.toml:2:19: key \"dither.peak_rate_deg_s\""));
}

TEST(ScenarioRules, TheSweepsEndCounts) {
    const std::string sweep = "[input]\nsweep_stop_deg_h = 3e5\n";
    EXPECT_EQ(complaint(sweep), "");  // not used without a sweep
    EXPECT_THAT(complaint(sweep + "sweep_points = 3"),
                HasSubstr("s.toml:2:20: key \"input.sweep_stop_deg_h\" = 300000.0"));
}

TEST(ScenarioRules, ASweepGoesSomewhere) {
    EXPECT_THAT(complaint("[input]\nsweep_points = 3"),
                AllOf(HasSubstr("s.toml:2:16: key \"input.sweep_points\" = 3: "), HasSubstr("another rate")));
    EXPECT_EQ(complaint("[input]\nrate_deg_h = 0\nsweep_stop_deg_h = 5\nsweep_points = 51"), "");
}

TEST(ScenarioRules, AProfileIsAProfile) {
    const std::string profile = "[input]\nprofile_time_s = [0, 5.5]\n";
    EXPECT_EQ(complaint(profile + "profile_rate_deg_h = [-3, 4]"), "");
    EXPECT_THAT(
        complaint(profile + "profile_rate_deg_h = [1]"),
        AllOf(HasSubstr("s.toml:3:22: key \"input.profile_rate_deg_h\" = [1.0]: "), HasSubstr("as many rates")));
    EXPECT_THAT(complaint(profile), HasSubstr("as many rates, not 0"));
    EXPECT_THAT(complaint("[input]\nprofile_time_s = [0, 5, 5]\nprofile_rate_deg_h = [0, 1, 2]"),
                AllOf(HasSubstr("s.toml:2:18: key \"input.profile_time_s\""), HasSubstr("5 s comes after 5 s")));
    EXPECT_THAT(complaint(profile + "profile_rate_deg_h = [0, 1]\nsweep_points = 2\nsweep_stop_deg_h = 0"),
                HasSubstr("cannot be swept"));
    EXPECT_THAT(complaint(profile + "profile_rate_deg_h = [0, -2e5]"), HasSubstr("the rate must reverse"));
    EXPECT_THAT(
        complaint(profile + "profile_rate_deg_h = [0, 1e9]"),
        AllOf(HasSubstr("s.toml:3:26: key \"input.profile_rate_deg_h\" = 1000000000.0: "), HasSubstr("between")));
    EXPECT_THAT(complaint(profile + "profile_rate_deg_h = [0, nan]"), HasSubstr("finite"));
    EXPECT_THAT(complaint("[input]\nprofile_time_s = 5"),
                AllOf(HasSubstr("a list of numbers"), HasSubstr("whole number")));
}

TEST(ScenarioRules, AveragingTimesLieInTheRecord) {
    const std::string run = "[ensemble]\nduration_s = 101\n[output]\ntau_s = ";
    EXPECT_EQ(complaint(run + "[0.008, 1, 33.3, 50]"), "");
    EXPECT_THAT(complaint(run + "[1, 60]"), AllOf(HasSubstr("s.toml:4:9: key \"output.tau_s\""), HasSubstr("60 s"),
                                                  HasSubstr("half of the record")));
    EXPECT_THAT(complaint(run + "[0.001]"), HasSubstr("a dither cycle"));
    EXPECT_THAT(complaint(run + "[0]"), HasSubstr("must be above 0"));
    std::string many = "[1";
    for (int i = 0; i < 100; ++i) many += ", 1";
    EXPECT_THAT(complaint(run + many + "]"), HasSubstr("101 averaging times"));
}

TEST(ScenarioRules, ASpecificationCanBeMet) {
    const std::string run = "[ensemble]\nduration_s = 101\n[specification]\n";
    EXPECT_EQ(complaint(run + "arw_deg_rt_h = 0.001\nrate_error_deg_h = 0.1\n"), "");
    EXPECT_EQ(complaint(run + "bias_stability_deg_h = 0.01\nat_s = 50\nangle_error_arcsec = 1\nafter_s = 101\n"), "");
    EXPECT_EQ(complaint(run + "at_s = 500\n"), "") << "of a limit that is not asked for";
    EXPECT_THAT(complaint(run + "bias_stability_deg_h = 0.01\nat_s = 51\n"),
                AllOf(HasSubstr("key \"specification.at_s\" = 51"), HasSubstr("half of the record")));
    EXPECT_THAT(complaint(run + "angle_error_arcsec = 1\nafter_s = 102\n"),
                AllOf(HasSubstr("key \"specification.after_s\" = 102"), HasSubstr("ends after 101 s")));
    EXPECT_THAT(complaint(run + "arw_deg_rt_h = 0.001\n[effects.quantum_noise]\ndeg_rt_h = 0.0011\n"),
                AllOf(HasSubstr("no arm can meet it"), HasSubstr("0.0011")));
    EXPECT_EQ(complaint(run + "arw_deg_rt_h = 0.001\n[effects.quantum_noise]\ndeg_rt_h = 0.0009\n"), "");
}

TEST(ScenarioRules, TheAmplitudeStays) {
    EXPECT_EQ(complaint("[dither]\namplitude_wander_relative_rt_s = 1e-3"), "");
    EXPECT_THAT(complaint("[dither]\namplitude_wander_relative_rt_s = 0.01"),
                AllOf(HasSubstr("s.toml:2:34: key \"dither.amplitude_wander_relative_rt_s\""), HasSubstr("0.5")));
    EXPECT_THAT(complaint("[dither]\namplitude_drift_relative_per_h = -4"),
                HasSubstr("key \"dither.amplitude_drift_relative_per_h\""));
}

TEST(InputProfile, IsLinearBetweenItsPointsAndIntegratedExactly) {
    const InputRate input{.profile_time_s = {1.0, 2.0, 4.0}, .profile_rate_deg_h = {10.0, 20.0, 0.0}};
    EXPECT_EQ(profile_rate_deg_h(input, 0.0), 10.0);
    EXPECT_EQ(profile_rate_deg_h(input, 1.5), 15.0);
    EXPECT_EQ(profile_rate_deg_h(input, 3.0), 10.0);
    EXPECT_EQ(profile_rate_deg_h(input, 9.0), 0.0);
    EXPECT_DOUBLE_EQ(profile_angle_arcsec(input, 0.0, 1.0), 10.0);
    EXPECT_DOUBLE_EQ(profile_angle_arcsec(input, 0.0, 5.0), 10.0 + 15.0 + 20.0);
    EXPECT_DOUBLE_EQ(profile_angle_arcsec(input, 1.5, 1.5), 0.25 * 35.0 + 15.0);
    EXPECT_DOUBLE_EQ(profile_angle_arcsec(input, 6.0, 2.0), 0.0);
    EXPECT_DOUBLE_EQ(profile_angle_arcsec(input, 2.0, 0.0), 0.0);
}

TEST(ScenarioRules, ASweepIsNotTooLarge) {
    EXPECT_THAT(complaint("[input]\nsweep_points = 100000\nsweep_stop_deg_h = 0\n[ensemble]\ngyros = 1001"),
                AllOf(HasSubstr("s.toml:5:9: key \"ensemble.gyros\" = 1001: "), HasSubstr("100000000 gyros")));
}

TEST(ScenarioRules, TurnsCanBeCounted) {
    // The extremes of each key by itself are allowed: 1e9 s twice at 1e5 Hz are 4e14 half cycles.
    const std::string longest =
        "[dither]\nfrequency_hz = 1e5\npeak_rate_deg_s = 1e4\n[propagation]\nmethod = \"direct\"\n"
        "[ensemble]\nduration_s = 1e9\nsettle_s = 1e9\ngyros = ";
    EXPECT_EQ(complaint(longest + "2500"), "");
    EXPECT_THAT(complaint(longest + "2501"), AllOf(HasSubstr("s.toml:7:14: key \"ensemble.duration_s\""),
                                                   HasSubstr("1e+18 half cycles of the dither")));
    EXPECT_THAT(complaint(longest + "100\n[input]\nrate_deg_h = 0\nsweep_points = 100000"),
                HasSubstr("4e+21 half cycles"));
}

TEST(ScenarioRules, TemperatureLeavesAThreshold) {
    EXPECT_THAT(
        complaint("[effects.lockin_temperature]\nrelative_per_k = 0.1\n[environment]\ntemperature_swing_k = 20"),
        AllOf(HasSubstr("effects.lockin_temperature.relative_per_k"), HasSubstr("20 K"), HasSubstr("0.9")));
    EXPECT_EQ(complaint("[effects.lockin_temperature]\nrelative_per_k = 0.1\n[environment]\ntemperature_swing_k = 5"),
              "");
}

TEST(Environment, TemperatureIsARampAndAWave) {
    const Environment environment{
        .temperature_ramp_k_per_h = 6.0, .temperature_swing_k = 2.0, .temperature_period_s = 400.0};
    EXPECT_EQ(temperature_change_k(environment, 0.0), 0.0);
    EXPECT_NEAR(temperature_change_k(environment, 700.0), 7.0 / 6.0 - 2.0, 1e-12);
}

TEST(Environment, TemperatureFollowsAProfile) {
    Environment environment;
    environment.profile_time_s = {-100.0, 100.0, 300.0};
    environment.profile_temperature_k = {290.0, 300.0, 296.0};
    EXPECT_TRUE(temperature_varies(environment));
    EXPECT_EQ(temperature_change_k(environment, 0.0), 0.0) << "295 K is that at the start";
    EXPECT_NEAR(temperature_change_k(environment, 50.0), 2.5, 1e-12);
    EXPECT_NEAR(temperature_change_k(environment, 100.0), 5.0, 1e-12);
    EXPECT_NEAR(temperature_change_k(environment, 200.0), 3.0, 1e-12);
    EXPECT_NEAR(temperature_change_k(environment, 1e6), 1.0, 1e-12);
    environment.profile_temperature_k = {290.0, 290.0, 290.0};
    EXPECT_FALSE(temperature_varies(environment));
}

TEST(ScenarioRules, AProfileOfTheTemperatureIsOne) {
    const std::string profile = "[environment]\nprofile_time_s = [0, 100, 200]\nprofile_temperature_k = ";
    EXPECT_EQ(complaint(profile + "[293, 300, 295]"), "");
    EXPECT_THAT(complaint(profile + "[293]"), AllOf(HasSubstr("s.toml:3:25: key \"environment.profile_temperature_k\""),
                                                    HasSubstr("as many temperatures")));
    EXPECT_THAT(complaint("[environment]\nprofile_time_s = [0, 0]\nprofile_temperature_k = [1, 2]"),
                HasSubstr("0 s comes after 0 s"));
    EXPECT_THAT(complaint(profile + "[293, 300, 295]\ntemperature_swing_k = 1"), HasSubstr("no ramp and no swing"));
    // Effects that follow the temperature know how far it goes, and how fast.
    EXPECT_THAT(complaint(profile + "[293, 304, 295]\n[effects.lockin_temperature]\nrelative_per_k = 0.1"),
                AllOf(HasSubstr("effects.lockin_temperature.relative_per_k"), HasSubstr("11 K")));
    EXPECT_EQ(complaint(profile + "[293, 301, 295]\n[effects.lockin_temperature]\nrelative_per_k = 0.1"), "");
}

TEST(ScenarioRules, TheTurnMapNeedsFringes) {
    // 2 Omega_D / (K w_D) is 2005 at the default and 10 at 0.544 deg/s.
    const std::string weak =
        "[gyro]\nlockin_threshold_deg_h = 20\n[noise_injection]\nturn_phase_rms_rad = 1\n[dither]\n";
    EXPECT_THAT(complaint(weak + "peak_rate_deg_s = 0.54"),
                AllOf(HasSubstr("key \"dither.peak_rate_deg_s\" = 0.54: 9.93 fringes in a half cycle"),
                      HasSubstr("propagation.method = \"direct\"")));
    EXPECT_EQ(complaint(weak + "peak_rate_deg_s = 0.54\n[propagation]\nmethod = \"direct\""), "");
    EXPECT_EQ(complaint(weak + "peak_rate_deg_s = 0.55"), "");
}

TEST(ScenarioRules, TheTurnMapNeedsSmallKicks) {
    // kappa is 0.152 rad at 300 deg/h.
    EXPECT_EQ(complaint("[gyro]\nlockin_threshold_deg_h = 1970"), "");
    EXPECT_THAT(complaint("[gyro]\nlockin_threshold_deg_h = 2000"),
                AllOf(HasSubstr("s.toml:2:26: key \"gyro.lockin_threshold_deg_h\" = 2000.0: "), HasSubstr("1.01 rad"),
                      HasSubstr("propagation.method = \"direct\"")));
    EXPECT_EQ(complaint("[gyro]\nlockin_threshold_deg_h = 2000\n[propagation]\nmethod = \"direct\""), "");
}

TEST(ScenarioRules, TheTurnMapNeedsFastMiddles) {
    // 11 fringes: a swing of M = 34.7 rad from the zero-rate point to the middle without input, of which 10 must be
    // left.
    const std::string weak =
        "[dither]\npeak_rate_deg_s = 0.6\n[gyro]\nlockin_threshold_deg_h = 20\n[noise_injection]\n"
        "turn_phase_rms_rad = 1\n";
    EXPECT_EQ(complaint(weak + "[input]\nrate_deg_h = 500"), "");
    EXPECT_THAT(
        complaint(weak + "[input]\nrate_deg_h = -1000"),
        AllOf(HasSubstr("s.toml:8:14: key \"input.rate_deg_h\" = -1000.0: "), HasSubstr("too few fringes between")));
    EXPECT_EQ(complaint(weak + "[input]\nrate_deg_h = -1000\n[propagation]\nmethod = \"direct\""), "");
    EXPECT_THAT(complaint(weak + "[effects.base_vibration]\nrate_deg_h = 1500"), HasSubstr("too few fringes between"));
}

// Every effect that adds a rate takes from the swing, and so does the input's profile; a run would fail.
TEST(ScenarioRules, AllRatesTakeFromTheFastMiddles) {
    const std::string slow = "[dither]\npeak_rate_deg_s = 20\n[ensemble]\nduration_s = 3000\n";
    EXPECT_EQ(complaint(slow), "");
    EXPECT_THAT(
        complaint(slow + "[effects.bias_ramp]\ndeg_h_per_h = 1e5"),
        AllOf(HasSubstr("s.toml:6:15: key \"effects.bias_ramp.deg_h_per_h\""), HasSubstr("too few fringes between")));
    EXPECT_THAT(complaint(slow + "[effects.bias_temperature]\ndeg_h_per_k = 100\n"
                                 "[environment]\ntemperature_ramp_k_per_h = 1000"),
                AllOf(HasSubstr("s.toml:6:15: key \"effects.bias_temperature.deg_h_per_k\""),
                      HasSubstr("too few fringes between")));
    // To a rate of 0.49 of the dither's peak a tenth is added, and tables leave twice that for it: 10 rad of M = 46 are
    // left up to 0.63.
    const std::string fast =
        "[dither]\npeak_rate_deg_s = 0.8\n[gyro]\nlockin_threshold_deg_h = 20\n[noise_injection]\n"
        "turn_phase_rms_rad = 0.1\n[input]\nrate_deg_h = 1400\n";
    EXPECT_EQ(complaint(fast), "");
    EXPECT_THAT(complaint(fast + "[effects.scale_factor_error]\nrelative = 0.1"), HasSubstr("too few fringes between"));
}

TEST(ScenarioRules, AProfileTakesFromTheFastMiddlesLikeAConstantRate) {
    const std::string slow = "[dither]\npeak_rate_deg_s = 0.8\n[gyro]\nlockin_threshold_deg_h = 20\n[input]\n";
    EXPECT_THAT(complaint(slow + "rate_deg_h = 1400"),
                AllOf(HasSubstr("s.toml:6:14: key \"input.rate_deg_h\""), HasSubstr("too few fringes between")));
    EXPECT_THAT(complaint(slow + "profile_time_s = [0, 600]\nprofile_rate_deg_h = [0, 1400]"),
                AllOf(HasSubstr("s.toml:7:22: key \"input.profile_rate_deg_h\" = [0.0, 1400.0]"),
                      HasSubstr("too few fringes between")));
    EXPECT_THAT(complaint(slow + "profile_time_s = [0, 600]\nprofile_rate_deg_h = [-1400, 0]"),
                HasSubstr("too few fringes between"));
    EXPECT_EQ(complaint(slow + "profile_time_s = [0, 600]\nprofile_rate_deg_h = [0, 400]"), "");
}

TEST(ScenarioRules, InjectedNoiseLeavesHalfTheSwing) {
    // 8 s / sqrt(2) <= M / 2, M = 6299 rad.
    const std::string noisy = "[noise_injection]\nturn_phase_rms_rad = 560\n";
    EXPECT_THAT(complaint(noisy), AllOf(HasSubstr("s.toml:2:22: key \"noise_injection.turn_phase_rms_rad\" = 560.0: "),
                                        HasSubstr("must not exceed 556.9 rad")));
    EXPECT_EQ(complaint(noisy + "[arms]\nnames = [\"ideal\", \"uncompensated\"]"), "");
    EXPECT_EQ(complaint("[noise_injection]\nturn_phase_rms_rad = 556"), "");
}

TEST(ScenarioRules, NoiseOfADriveLeavesHalfTheSwing) {
    // 8 s <= M / 2; M is 81 rad for triangle-20mm.
    const std::string noisy = "device = \"triangle-20mm\"\n[noise_injection]\nmodel = \"drive\"\n";
    EXPECT_THAT(complaint(noisy + "turn_phase_rms_rad = 5.1"),
                AllOf(HasSubstr("s.toml:4:22: key \"noise_injection.turn_phase_rms_rad\" = 5.1: "),
                      HasSubstr("must not exceed 5.05"), HasSubstr(" rad")));
    EXPECT_EQ(complaint(noisy + "turn_phase_rms_rad = 5.0"), "");
    EXPECT_THAT(complaint(noisy + "drive_noise_relative = 1.0"),
                AllOf(HasSubstr("s.toml:4:24: key \"noise_injection.drive_noise_relative\" = 1.0: "),
                      HasSubstr("must not exceed 0."), HasSubstr("of the force")));
    EXPECT_EQ(complaint(noisy + "drive_noise_relative = 0.3"), "");
}

TEST(ScenarioRules, TheStrengthOfNoiseIsGivenOnce) {
    const std::string drive = "[noise_injection]\nmodel = \"drive\"\ndrive_noise_relative = 0.01\n";
    EXPECT_EQ(complaint(drive), "");
    EXPECT_THAT(complaint(drive + "turn_phase_rms_rad = 3.0"),
                AllOf(HasSubstr("s.toml:3:24: key \"noise_injection.drive_noise_relative\" = 0.01: "),
                      HasSubstr("given twice")));
    EXPECT_THAT(complaint("[noise_injection]\ndrive_noise_relative = 0.01"), HasSubstr("model = \"drive\""));
    // Writing a scenario names every key, and must come back.
    const Scenario s = parse_string(drive, "s.toml");
    EXPECT_EQ(to_toml(parse_string(to_toml(s), "again.toml")), to_toml(s));
    EXPECT_EQ(s.noise_injection.turn_phase_rms_rad, 0.0);
}

TEST(ScenarioRules, KeysOfADriveNeedADrive) {
    for (const char* key : {"resonator_q = 50.0", "form = \"white\"", "distribution = \"binary\"",
                            "hold_half_cycles = 2", "modulation_hz = 2.0", "amplitude_loop_hz = 1.0"}) {
        EXPECT_THAT(complaint(std::string("[noise_injection]\n") + key),
                    AllOf(HasSubstr("s.toml:2:"), HasSubstr("only with noise_injection.model = \"drive\"")))
            << key;
        EXPECT_EQ(complaint(std::string("[noise_injection]\nmodel = \"drive\"\n") + key), "") << key;
    }
}

TEST(ScenarioRules, ADriveHasAStableLoopAndASlowModulation) {
    const std::string drive = "[noise_injection]\nmodel = \"drive\"\n";
    EXPECT_THAT(complaint(drive + "amplitude_loop_hz = 100.0"),
                AllOf(HasSubstr("s.toml:3:21: key \"noise_injection.amplitude_loop_hz\""), HasSubstr("not stable")));
    EXPECT_EQ(complaint(drive + "amplitude_loop_hz = 1.2"), "");
    EXPECT_THAT(
        complaint(drive + "amplitude_loop_hz = 1e-6"),
        AllOf(HasSubstr("s.toml:3:21: key \"noise_injection.amplitude_loop_hz\""), HasSubstr("set a faster loop")));
    EXPECT_THAT(complaint(drive + "form = \"sinusoidal\"\nmodulation_hz = 125.0"), HasSubstr("slower than the dither"));
    EXPECT_EQ(complaint(drive + "form = \"sinusoidal\"\nmodulation_hz = 120.0"), "");
}

TEST(ScenarioRules, GrowingAmplitudesNeedMoebiusMaps) {
    const std::string both =
        "[noise_injection]\nmodel = \"drive\"\n[effects.lockin_second_harmonic]\nratio = 0.2\n[propagation]\n";
    EXPECT_THAT(complaint(both), AllOf(HasSubstr("second harmonic"), HasSubstr("propagation.method = \"direct\"")));
    EXPECT_EQ(complaint(both + "method = \"direct\""), "");
}

TEST(ScenarioRules, KeysOfTheInstrumentNeedTheInstrument) {
    for (const char* key : {"phase_from = \"detectors\"", "comparator_noise_relative = 0.001",
                            "comparator_hysteresis_relative = 0.1", "detector_bandwidth_hz = 2e6", "adc_bits = 8"}) {
        const std::string name(key, std::string_view(key).find(' '));
        const std::string line = std::string("[readout]\n") + key + "\n";
        EXPECT_THAT(complaint(line), AllOf(HasSubstr("s.toml:2:"), HasSubstr("key \"readout." + name + "\" = "),
                                           HasSubstr("set readout.model = \"instrument\"")));
        EXPECT_EQ(complaint(line + "model = \"instrument\""), "");
    }
}

TEST(ScenarioRules, TheInstrumentFollowsTheFringes) {
    const std::string instrument = "[readout]\nmodel = \"instrument\"\n";
    EXPECT_THAT(complaint(instrument + "detector_bandwidth_hz = 5e5"),
                AllOf(HasSubstr("s.toml:3:"), HasSubstr("the counter loses fringes")));
    EXPECT_EQ(complaint(instrument + "detector_bandwidth_hz = 0"), "");
    // 796000 fringes a second by the dither, 380000 more by the fastest rate of the profile.
    const std::string narrow = instrument + "detector_bandwidth_hz = 9e5\n[input]\n";
    EXPECT_EQ(complaint(narrow), "");
    EXPECT_THAT(complaint(narrow + "profile_time_s = [0, 9]\nprofile_rate_deg_h = [0, -190000]"),
                HasSubstr("the counter loses fringes"));
    EXPECT_THAT(complaint(instrument + "comparator_hysteresis_relative = 0.01"),
                AllOf(HasSubstr("s.toml:3:"), HasSubstr("at least 4 times the noise")));
    EXPECT_THAT(complaint(instrument + "[effects.readout_ellipse]\noffset_sin = 0.3"),
                AllOf(HasSubstr("s.toml:4:"), HasSubstr("the converter holds 1.25")));
    EXPECT_THAT(complaint("[readout]\nmodel = \"ideal\"\nellipse_correction = true"),
                AllOf(HasSubstr("s.toml:3:"), HasSubstr("no ellipse to correct")));
}

TEST(ScenarioRules, AnArmThatExtrapolatesPulsesNeedsThem) {
    const std::string arms = "[arms]\nnames = [\"ideal\", \"noise_injected+compensated_extrapolated\"]\n[readout]\n";
    EXPECT_THAT(complaint(arms + "model = \"latched\""),
                AllOf(HasSubstr("s.toml:2:"), HasSubstr("key \"arms.names\""),
                      HasSubstr("arm \"noise_injected+compensated_extrapolated\" needs the pulses' times; set "
                                "readout.model = \"instrument\"")));
    EXPECT_THAT(complaint("[arms]\nnames = [\"compensated_adaptive\"]\n"),
                HasSubstr("arm \"compensated_adaptive\" needs the pulses' times"));
    EXPECT_EQ(complaint(arms + "model = \"instrument\""), "");
    EXPECT_EQ(complaint(arms + "model = \"ideal\""), "");
    EXPECT_EQ(complaint("[arms]\nnames = [\"compensated_two_train\"]\n[readout]\nmodel = \"latched\""), "");
}

TEST(ScenarioRules, ASampleHoldsACycleAndARunHoldsSamples) {
    EXPECT_THAT(complaint("[output]\nsample_interval_s = 0.008"),
                AllOf(HasSubstr("s.toml:2:21: key \"output.sample_interval_s\" = 0.008: "), HasSubstr("0.00802041 s")));
    EXPECT_EQ(complaint("[ensemble]\nduration_s = 3"), "");
    EXPECT_THAT(complaint("[ensemble]\nduration_s = 2.9"),
                AllOf(HasSubstr("s.toml:2:14: key \"ensemble.duration_s\" = 2.9: "), HasSubstr("at least 3 samples")));
}

TEST(ScenarioRules, TheDitherMustReverseEffectsWhateverTheMethod) {
    // 20 deg/s are 72000 deg/h; 1000 K/h are 833 K in 3000 s, and these 83333 deg/h.
    const std::string ramp =
        "[dither]\npeak_rate_deg_s = 20\n[environment]\ntemperature_ramp_k_per_h = 1000\n[ensemble]\n"
        "duration_s = 3000\n[propagation]\nmethod = \"direct\"\n[effects.bias_temperature]\ndeg_h_per_k = ";
    EXPECT_THAT(complaint(ramp + "100"),
                AllOf(HasSubstr("s.toml:10:15: key \"effects.bias_temperature.deg_h_per_k\" = 100.0: "),
                      HasSubstr("as much as 83348"), HasSubstr("must reverse"), HasSubstr("stronger dither")));
    EXPECT_EQ(complaint(ramp + "70"), "");
}

TEST(ScenarioRules, TablesHoldTheirTolerance) {
    // At 0.38 of the dither's peak rate the zero-rate point is 465 rad from the turn, and moves by 0.08 rad with each
    // radian of the amplitude: by 0.4 rad over eight standard deviations of noise of 1 rad, by 43 rad with 100 rad,
    // which 28 terms do not follow.
    const std::string fast = "[input]\nrate_deg_h = 150000\n[noise_injection]\nturn_phase_rms_rad = ";
    EXPECT_EQ(complaint(fast + "1"), "");
    EXPECT_THAT(complaint(fast + "100"),
                AllOf(HasSubstr("s.toml:2:14: key \"input.rate_deg_h\" = 150000.0: the tables of the turn map"),
                      HasSubstr("turn_map_tolerance_rad"), HasSubstr("propagation.method = \"direct\"")));
    EXPECT_EQ(complaint(fast + "100\n[propagation]\nmethod = \"direct\""), "");
    EXPECT_THAT(complaint(fast + "100\n[propagation]\nmethod = \"direct\"\n[arms]\nnames = [\"noise_injected\", "
                                 "\"noise_injected+compensated_exact\"]"),
                HasSubstr("leave out the arms"));
    // A jump of the input's profile is in one table.
    EXPECT_THAT(complaint("[input]\nprofile_time_s = [0, 1, 1.001]\nprofile_rate_deg_h = [0, 0, 150000]"),
                HasSubstr("s.toml:3:22: key \"input.profile_rate_deg_h\""));
    EXPECT_EQ(complaint("[input]\nprofile_time_s = [0, 300]\nprofile_rate_deg_h = [0, 150000]\n"
                        "[noise_injection]\nturn_phase_rms_rad = 1"),
              "");
}

TEST(ScenarioRules, TheClockTellsPulsesApart) {
    // A quarter fringe takes sqrt(pi/(M w_D^2)) = 28.5 us, less six sigma of amplitude and asymmetry.
    const std::string instrument = "[readout]\nmodel = \"instrument\"\nclock_hz = ";
    EXPECT_THAT(complaint(instrument + "5e4"), AllOf(HasSubstr("s.toml:3:12: key \"readout.clock_hz\" = 50000.0: "),
                                                     HasSubstr("2.83e-05 s"), HasSubstr("7.06e+04 or more")));
    EXPECT_EQ(complaint(instrument + "7.1e4"), "");
    EXPECT_EQ(complaint(instrument + "0"), "");
    EXPECT_EQ(complaint("[readout]\nclock_hz = 5e4"), "");
}

TEST(ScenarioRules, TheReadoutFollowsThePhaseToItsTurn) {
    // 10000 deg/s are 183700 fringes in a half cycle: M = 577300 rad, and at 0.056 of the peak rate M 0.056^2/2 = 891
    // rad, with 42 rad for the steps in time; at 0.11 four times as much.
    const std::string fast =
        "[dither]\npeak_rate_deg_s = 1e4\n[noise_injection]\nturn_phase_rms_rad = 0\n[arms]\n"
        "names = [\"uncompensated\"]\n[input]\nrate_deg_h = ";
    EXPECT_EQ(complaint(fast + "2e6"), "");
    EXPECT_THAT(complaint(fast + "-4e6"), AllOf(HasSubstr("s.toml:8:14: key \"input.rate_deg_h\" = -4000000.0: "),
                                                HasSubstr("2250 rad"), HasSubstr("lower the input rate")));
}

TEST(ScenarioRules, PulsesComeBeforeTheMiddle) {
    // 2 fringes in a half cycle are 6.3 rad from a turn to the middle.
    const std::string few =
        "[gyro]\nscale_factor_arcsec = 500\nlockin_threshold_deg_h = 0\n[propagation]\nmethod = \"direct\"\n"
        "[noise_injection]\nturn_phase_rms_rad = 0\n[arms]\nnames = [\"uncompensated\"]\n[readout]\nmodel = ";
    EXPECT_EQ(complaint(few + "\"latched\""), "");
    EXPECT_THAT(complaint(few + "\"instrument\"\ncomparator_noise_relative = 0"),
                AllOf(HasSubstr("s.toml:2:23: key \"gyro.scale_factor_arcsec\" = 500.0: "),
                      HasSubstr("too few quarter fringes")));
}

TEST(ScenarioRules, UnlikeHalfCyclesDoNotMeetAmongThePulsesOfAnExtrapolation) {
    Scenario s;
    s.readout.model = ReadoutModel::ideal;
    s.arms = parse_arms({"compensated_extrapolated"});
    s.input.rate_deg_h = 17950.0;
    EXPECT_TRUE(check(s).empty()) << "half cycles of common gyros are alike enough";
    s.effects["dither_asymmetry"]["ratio"] = 0.1;
    const auto found = check(s);
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found.front().keys.front(), "input.rate_deg_h");
    EXPECT_NE(found.front().problem.find("two unlike half cycles"), std::string::npos);
    s.input.rate_deg_h = 15.0;
    EXPECT_TRUE(check(s).empty());
    s.input.rate_deg_h = 17950.0;
    s.arms = parse_arms({"compensated_exact"});
    EXPECT_TRUE(check(s).empty()) << "other arms do not extrapolate";
}

}  // namespace
}  // namespace scenario_rules_test
}  // namespace ringlock::scenario
