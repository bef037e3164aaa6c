// The closed loop on turns of gyros unlike the standard one: locked, of strong coupling, of large ellipses and rates.
#include <gmock/gmock.h>

#include <cstdio>

#include "analysis/closure/closure.hpp"
#include "analysis/instrument/simulate.hpp"
#include "tests/closure/answers.hpp"
#include "tests/closure/generator/generator.hpp"
#include "tests/closure/generator/plain_gyro.hpp"

namespace ringlock::test::closure {
namespace turns_gyros_test {
namespace {

using ringlock::closure::close_loop;
using ringlock::closure::Closure;
using ringlock::closure::Verdict;

TEST(TurnLoop, ALockedGyroIsNoRiddle) {
    scenario::Scenario scenario = gyro(6000, 111, 0.0);
    scenario.input.rate_deg_h = scenario.input.sweep_stop_deg_h = 0.0;
    const Closure closure = close_loop(instrument::simulate_record(scenario));
    print("locked", closure);
    EXPECT_EQ(closure.verdict, Verdict::nothing_missing);
    EXPECT_THAT(closure.notes, testing::Contains(testing::HasSubstr("locked")));
}

/// What is answered for a locked gyro with so much injected noise, for each; made side by side.
std::vector<Closure> close_noisy(const Truth& locked, const std::vector<double>& injected_rad) {
    std::vector<Truth> truths;
    for (const double injected : injected_rad) {
        truths.push_back(locked);
        truths.back().injected_noise_rad = injected;
    }
    std::vector<Closure> answers;
    for (const auto& record : generate(truths)) {
        answers.push_back(close_loop(record));
        print("locked, with noise", answers.back());
    }
    return answers;
}

// What the lock-in adds on the way to a turn goes with the noise there: sizes follow phases by more than they do.
TEST(LongTurnLoop, InjectedNoiseInALockedGyroIsNoStructure) {
    Truth truth;
    truth.scale_factor_arcsec = 1.6;
    truth.dither_frequency_hz = 233.7;
    truth.dither_peak_rate_deg_s = 68.0;
    truth.lockin_threshold_deg_h = 800.0;
    truth.readout_noise = 0.001;
    truth.bias_deg_h = -1.5;
    truth.turns = 10000;
    truth.seed = 7007;
    for (const Closure& closure : close_noisy(truth, {0.5, 1.5})) {
        EXPECT_EQ(closure.verdict, Verdict::nothing_missing);
        EXPECT_LT(deviation(closure.base, "lockin_threshold_deg_h", 800.0), 4.0);
    }
}

// Noise between bounds goes with the lock-in before the turn otherwise than a normal one does.
TEST(LongTurnLoop, NoiseOfEvenDensityInALockedGyroIsNoStructure) {
    Truth truth;
    truth.scale_factor_arcsec = 1.6;
    truth.dither_frequency_hz = 105.497;
    truth.dither_peak_rate_deg_s = 192.28;
    truth.lockin_threshold_deg_h = 1216.9;
    truth.readout_noise = 0.003;
    truth.bias_deg_h = -0.482;
    truth.turns = 8000;
    truth.seed = 1;
    truth.injected_noise_even = 1.0;
    for (const Closure& closure : close_noisy(truth, {0.5, 1.0})) {
        EXPECT_EQ(closure.verdict, Verdict::nothing_missing);
        EXPECT_LT(deviation(closure.base, "lockin_threshold_deg_h", 1216.9), 3.0);
    }
}

/// In step, its threshold going up and down by a sixth.
Truth swinging_threshold() {
    Truth truth;
    truth.scale_factor_arcsec = 2.0;
    truth.dither_frequency_hz = 285.0;
    truth.dither_peak_rate_deg_s = 116.0;
    truth.lockin_threshold_deg_h = 1400.0;
    truth.turns = 8000;
    truth.seed = 1;
    truth.temperature.swing_k = 1.0;
    truth.temperature.period_s = 6.0;
    truth.temperature.interval_s = 0.05;
    truth.lockin_temperature_per_k = 0.16;
    return truth;
}

/// The loop's answer names this effect alone, near its true value.
void expect_alone(const Closure& closure, const std::string& effect, const std::string& parameter, double value) {
    EXPECT_EQ(closure.verdict, Verdict::closed);
    ASSERT_EQ(closure.steps.size(), 1U);
    EXPECT_EQ(closure.steps[0].name(), effect);
    EXPECT_LT(deviation(closure.steps[0].parameters, parameter, value), 3.0);
}

// Kicks of a locked gyro go with more than the first power of its threshold.
TEST(LongTurnLoop, AThresholdThatSwingsByASixthIsFollowed) {
    Truth truth = swinging_threshold();
    truth.readout_noise = 0.005;
    truth.bias_deg_h = 0.5;
    const Closure closure = close_loop(generate({&truth, 1}).front());
    print("locked, its threshold follows the temperature", closure);
    expect_alone(closure, "lockin_temperature", "relative_per_k", 0.16);
}

// Before the swing is in the model what it leaves is flatter than normal noise: no shape of the noise beside it.
TEST(LongTurnLoop, TheShapeOfTheNoiseIsReadAnewBesideAnEffect) {
    Truth truth = swinging_threshold();
    truth.readout_noise = 0.02;
    truth.input_rate_deg_h = 40.0;
    const Closure closure = close_loop(generate({&truth, 1}).front());
    print("in step now and then", closure);
    expect_alone(closure, "lockin_temperature", "relative_per_k", 0.16);
}

/// Without injected noise, read with errors of 2 %.
Truth coarsely_read(std::uint64_t seed) {
    Truth truth;
    truth.scale_factor_arcsec = 0.8;
    truth.dither_frequency_hz = 209.173;
    truth.dither_peak_rate_deg_s = 49.5325;
    truth.lockin_threshold_deg_h = 485.0;
    truth.readout_noise = 0.02;
    truth.turns = 12000;
    truth.seed = seed;
    return truth;
}

// What a kick makes of the reading's error is not linear in it, and adds up: about the phases that were read each of
// these had a step of the bias as well.
TEST(LongTurnLoop, CoarseReadingsAreNoStep) {
    Truth plain = coarsely_read(104);
    plain.input_rate_deg_h = 71.3;
    const Closure closure = close_loop(generate({&plain, 1}).front());
    print("read coarsely", closure);
    EXPECT_EQ(closure.verdict, Verdict::nothing_missing);
    for (const std::uint64_t seed : {117U, 129U}) {
        Truth truth = coarsely_read(seed);
        truth.input_rate_deg_h = 64.8654;
        truth.rates.bias_ramp_deg_h_per_h = 0.558;
        const Closure ramp = close_loop(generate({&truth, 1}).front());
        print("read coarsely, with a ramp", ramp);
        expect_alone(ramp, "bias_ramp", "deg_h_per_h", 0.558);
    }
}

// Beside injected noise the first fit may have given the lock-in what the amplitude did.
TEST(LongTurnLoop, AWanderingAmplitudeOfALockedGyroIsTheDithersOwn) {
    for (const double correlation_s : {1.0, 0.1}) {
        Truth truth;
        truth.scale_factor_arcsec = 0.3;
        truth.dither_frequency_hz = 92.338;
        truth.dither_peak_rate_deg_s = 54.08;
        truth.lockin_threshold_deg_h = 155.6;
        truth.readout_noise = 0.001;
        truth.bias_deg_h = -0.017;
        truth.initial_phase_rad = 2.958;
        truth.turns = 16000;
        truth.seed = 1038;
        truth.injected_noise_rad = 0.5;
        truth.wander.rms = 1.65e-5;
        truth.wander.correlation_s = correlation_s;
        const Closure closure = close_loop(generate({&truth, 1}).front());
        print("locked, amplitude wanders", closure);
        EXPECT_EQ(closure.verdict, Verdict::nothing_missing);
    }
}

// The rate of a walk moves zero-rate points as any rate does: minima one way, maxima the other.
TEST(LongTurnLoop, ARateThatWalksIsNoShapeOfTheDither) {
    Truth truth;
    truth.scale_factor_arcsec = 2.0;
    truth.dither_frequency_hz = 436.002;
    truth.dither_peak_rate_deg_s = 46.99;
    truth.lockin_threshold_deg_h = 42.6;
    truth.readout_noise = 0.01;
    truth.wander.walk_per_turn = 1.8e-8;
    truth.wander.drift_per_s = 6.96e-6;
    truth.bias_deg_h = 0.675;
    truth.initial_phase_rad = 2.205;
    truth.rates.rate_random_walk_deg_h_rt_h = 222.3;
    truth.turns = 40000;
    truth.seed = 20010;
    const Closure closure = close_loop(generate({&truth, 1}).front());
    print("walk", closure);
    ASSERT_EQ(closure.steps.size(), 1U);
    EXPECT_EQ(closure.steps[0].name(), "rate_random_walk");
    EXPECT_EQ(closure.verdict, Verdict::closed);
}

TEST(LongTurnLoop, ASteepRampLeadsTheFitBack) {
    Truth truth;
    truth.scale_factor_arcsec = 1.6;
    truth.dither_frequency_hz = 497.9;
    truth.dither_peak_rate_deg_s = 68.5;
    truth.lockin_threshold_deg_h = 141.0;
    truth.readout_noise = 0.005;
    truth.bias_deg_h = 35.0;
    truth.rates.bias_ramp_deg_h_per_h = 4000.0;
    truth.turns = 8000;
    truth.seed = 20016;
    const Closure closure = close_loop(generate({&truth, 1}).front());
    print("steep ramp", closure);
    ASSERT_EQ(closure.steps.size(), 1U);
    EXPECT_EQ(closure.steps[0].name(), "bias_ramp");
    EXPECT_TRUE(closure.steps[0].confounded_with.empty());
    EXPECT_LT(deviation(closure.steps[0].parameters, "deg_h_per_h", 4000.0), 4.0);
    EXPECT_LT(deviation(closure.base, "lockin_threshold_deg_h", 141.0), 4.0);
}

// Its offsets are in units of the fringe, not of the mean radius, and the noise that is left is no longer round.
TEST(LongTurnLoop, AnEllipseOfASixthIsMadeRound) {
    Truth truth;
    truth.scale_factor_arcsec = 1.2;
    truth.dither_frequency_hz = 168.3;
    truth.dither_peak_rate_deg_s = 288.0;
    truth.lockin_threshold_deg_h = 542.0;
    truth.readout_noise = 0.01;
    truth.bias_deg_h = 19.0;
    truth.turns = 8000;
    truth.seed = 20000;
    truth.readout_ellipse.gain = 0.176;
    truth.readout_ellipse.offset_sin = 0.095;
    truth.readout_ellipse.orthogonality_rad = 0.1;
    const Closure closure = close_loop(generate({&truth, 1}).front());
    print("ellipse", closure);
    EXPECT_EQ(closure.verdict, Verdict::closed);
    ASSERT_EQ(closure.steps.size(), 1U);
    EXPECT_EQ(closure.steps[0].name(), "readout_ellipse");
    EXPECT_LT(deviation(closure.steps[0].parameters, "gain", 0.176), 4.0);
    EXPECT_LT(deviation(closure.steps[0].parameters, "offset_sin", 0.095), 4.0);
    EXPECT_LT(deviation(closure.steps[0].parameters, "offset_cos", 0.0), 4.0);
    EXPECT_LT(deviation(closure.steps[0].parameters, "orthogonality_rad", 0.1), 4.0);
    EXPECT_LT(deviation(closure.base, "readout_noise_rad", 0.01), 4.0);
}

/// How far the thresholds of so many locked gyros come out, squared and summed, in standard errors; by how fast they
/// lock. All that the lock-in does before a turn follows from the very phase that is read there. So many of the records
/// may show something by chance, at a level of 0.3 % each.
double squares_of_locked_gyros(int gyros, std::uint64_t seed, int by_chance) {
    double squares = 0.0;
    int shown = 0;
    for (int k = 0; k < gyros; ++k) {
        scenario::Scenario scenario = gyro(6000, seed + static_cast<std::uint64_t>(k), 0.0);
        scenario.input.rate_deg_h = scenario.input.sweep_stop_deg_h = 0.1 * (k % 12) - 0.5;
        const Closure closure = close_loop(instrument::simulate_record(scenario));
        if (closure.verdict != Verdict::nothing_missing) {
            print("locked", closure);
            ++shown;
        }
        const double off = deviation(closure.base, "lockin_threshold_deg_h", 300.0);
        EXPECT_LT(off, 4.0) << k;
        squares += off * off;
    }
    EXPECT_LE(shown, by_chance);
    std::printf("threshold of %d locked gyros: rms %.2f standard errors\n", gyros, std::sqrt(squares / gyros));
    return squares;
}

TEST(LongTurnLoop, ALockedGyroTellsItsThresholdWithAnHonestError) {
    // Chi-squared of twelve: one in 2000 is above 34.
    EXPECT_LT(squares_of_locked_gyros(12, 300, 0), 34.0);
}

TEST(LongTurnLoop, LockedGyrosTellTheirThresholdsWithHonestErrors) {
    // Chi-squared of 120: one in 2000 is above 178. Three records or more by chance: one in 170.
    EXPECT_LT(squares_of_locked_gyros(120, 700, 2), 178.0);
}

}  // namespace
}  // namespace turns_gyros_test
}  // namespace ringlock::test::closure
