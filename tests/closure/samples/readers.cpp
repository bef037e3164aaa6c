// Records of simulated readers without any effect: the loop finds nothing that the reader or the turns do not account
// for.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/samples/declared/declared_reader.hpp"
#include "analysis/closure/samples/declared/dither_noise.hpp"
#include "analysis/closure/samples/declared/turn_pattern.hpp"
#include "analysis/closure/samples/residual/rate_beat.hpp"
#include "analysis/instrument/simulate.hpp"
#include "engine/core/units.hpp"
#include "engine/random/stream.hpp"
#include "engine/scenario/devices.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock::closure {
namespace samples_readers_test {
namespace {

using reader::Stripping;

scenario::Scenario samples_at(double rate_hz, double duration_s) {
    scenario::Scenario s;
    s.ensemble.gyros = 1;
    s.ensemble.duration_s = duration_s;
    s.record.kind = scenario::RecordKind::samples;
    s.record.rate_hz = rate_hz;
    return s;
}

std::string effects_of(const Closure& closure) {
    std::string names;
    for (const Step& step : closure.steps) names += step.name() + " ";
    return names + (closure.unexplained ? closure.unexplained->detail : "");
}

// The default scenario: 2.49 turns in a sample, so that two of them or three share the kicks of a sample.
TEST(SampleReaders, KicksBelongToTheTurnsOfTheDither) {
    const record::Record record = instrument::simulate_record(samples_at(100.0, 200.0));
    SampleSeries series = prepare_samples(record);
    const Rows rows(series.size(), 1);
    const SampleFit base(series, SampleModel{}, rows);
    const auto pattern = find_turn_pattern(base, record.declared);
    ASSERT_TRUE(pattern.has_value());
    EXPECT_NEAR(pattern->turn_hz, 2.0 * *record.declared.dither_frequency_hz, 2e-3);
    // Tick 0 falls on a turn.
    EXPECT_NEAR(std::remainder(pattern->place, 1.0), 0.0, 0.05);
    EXPECT_GT(pattern->share, 0.9);
    double turns = 0.0;
    for (std::size_t i = 0; i < series.size(); ++i) turns += pattern->kicks->variance[i] + pattern->kicks->carried[i];
    EXPECT_NEAR(turns, pattern->turn_hz * 200.0, 0.02 * turns);
    SampleModel model;
    take_turn_pattern(*pattern, model.noise);
    const SampleFit with(series, std::move(model), rows);
    EXPECT_GT(with.gain_over(base), 100.0);
}

TEST(SampleReaders, WithoutADeclaredDitherThereIsNoPattern) {
    record::Record record = instrument::simulate_record(samples_at(100.0, 100.0));
    record.declared.dither_frequency_hz.reset();
    const SampleSeries series = prepare_samples(record);
    const Rows rows(series.size(), 1);
    EXPECT_FALSE(find_turn_pattern(SampleFit(series, SampleModel{}, rows), record.declared).has_value());
}

TEST(SampleReaders, ARecordWithoutEffectMissesNothing) {
    for (const double rate_hz : {10.0, 100.0}) {
        const Closure closure = close_loop(instrument::simulate_record(samples_at(rate_hz, 200.0)));
        EXPECT_EQ(closure.verdict, Verdict::nothing_missing) << rate_hz << " Hz: " << effects_of(closure);
    }
}

// Beside a strong line and a step the base model's innovations do not show the turns; after these are in the model they
// do.
TEST(LongSampleReaders, TurnsAreFoundOnceStrongEffectsAreInTheModel) {
    scenario::Scenario s = samples_at(100.0, 120.0);
    s.effects.at("bias_step") = {{"step_deg_h", 3.0}, {"time_s", 70.0}};
    s.effects.at("base_vibration").at("rate_deg_h") = 8.0;
    s.effects.at("base_vibration").at("frequency_hz") = 17.3;
    const Closure closure = close_loop(instrument::simulate_record(s));
    EXPECT_EQ(closure.verdict, Verdict::closed) << effects_of(closure);
    EXPECT_EQ(effects_of(closure), "base_vibration bias_step ");
    EXPECT_TRUE(std::any_of(closure.notes.begin(), closure.notes.end(), [](const std::string& note) {
        return note.find("comes in kicks at the turns") != std::string::npos;
    }));
}

TEST(LongSampleReaders, WholeCyclesAndFiltersAreNoEffects) {
    for (const Stripping stripping : {Stripping::whole_cycle, Stripping::reference_fir}) {
        scenario::Scenario s = samples_at(100.0, 100.0);
        s.reader.stripping = stripping;
        s.reader.fraction = reader::Fraction::detectors;
        if (stripping == Stripping::reference_fir) s.reader.latch_hz = 1000.0;
        const Closure closure = close_loop(instrument::simulate_record(s));
        EXPECT_EQ(closure.verdict, Verdict::nothing_missing)
            << reader::stripping_names.at(static_cast<std::size_t>(stripping)) << ": " << effects_of(closure);
    }
}

// Counts of whole quarter fringes at the zero crossings: their error follows the angle. It is a narrow line and its
// harmonics, and jumps; noise of the measured dither blurs it.
TEST(LongSampleReaders, CountsOverWholeCyclesAreNoEffects) {
    struct Kind {
        const char* arm;
        double rate_hz, duration_s, jitter_arcsec;
    };
    for (const Kind& kind : {Kind{"noise_injected+compensated", 250.0, 40.0, 0.1},
                             Kind{"noise_injected", 25.0, 120.0, 0.0}, Kind{"noise_injected", 25.0, 120.0, 0.3}}) {
        scenario::Scenario s = scenario::read_device(*scenario::find_device("triangle-51mm")).scenario;
        s.ensemble.gyros = 1;
        s.ensemble.duration_s = kind.duration_s;
        s.record.kind = scenario::RecordKind::samples;
        s.record.rate_hz = kind.rate_hz;
        s.record.trajectory = scenario::parse_arm(kind.arm);
        s.reader.stripping = Stripping::whole_cycle;
        s.reader.fraction = reader::Fraction::none;
        s.reader.reference_noise_arcsec = kind.jitter_arcsec;
        const Closure closure = close_loop(instrument::simulate_record(s));
        EXPECT_EQ(closure.verdict, Verdict::nothing_missing)
            << kind.arm << " at " << kind.rate_hz << " Hz: " << effects_of(closure);
    }
}

// The filter's states have the autocovariance of the sawtooth of a phase that diffuses, within what the harmonics that
// are left out have.
TEST(SampleReaders, StatesOfACountsErrorAreThoseOfASawtooth) {
    const SampleNoise::CountError error{
        .step_arcsec = 1.0, .hz = 13.5, .width_hz = 0.2, .latch_hz = 200.0, .harmonics = 4};
    constexpr double interval_s = 1.0 / 200.0;
    const int lags = 60;
    std::vector<double> of_states(lags, 0.0);
    SampleNoise noise;
    noise.from_hz = 200.0;
    noise.count_error = error;
    const SampleStates states(noise, interval_s);
    for (int m = 1; m <= error.harmonics; ++m) {
        const int i = 2 * m - 1;  // two states each, behind the angle
        std::complex<double> turned = states.start[i][i];
        const std::complex<double> turn(states.f[i][i], states.f[i][i + 1]);
        for (int k = 0; k < lags; ++k, turned *= turn) of_states[static_cast<std::size_t>(k)] += turned.real();
    }
    random::NormalStream normal({1, 1}, random::Purpose::bootstrap);
    constexpr int latches = 400000;
    std::vector<double> sawtooth(latches);
    double angle = 0.3;
    // Full width 2 pi D/q^2 at half maximum.
    const double walk = std::sqrt(error.width_hz / units::two_pi * interval_s);
    for (double& e : sawtooth) {
        angle += error.hz * interval_s + walk * normal();
        e = 0.5 - (angle - std::floor(angle));
    }
    double left_out = 1.0 / 12.0;
    for (int m = 1; m <= error.harmonics; ++m) left_out -= 0.5 * std::pow(error.amplitude_arcsec(m), 2);
    for (int k = 0; k < lags; ++k) {
        double sum = 0.0;
        for (int i = k; i < latches; ++i) {
            sum += sawtooth[static_cast<std::size_t>(i)] * sawtooth[static_cast<std::size_t>(i - k)];
        }
        EXPECT_NEAR(sum / (latches - k), of_states[static_cast<std::size_t>(k)], left_out + 0.001) << k;
    }
}

// Of a uniform place within a step and normal jitter the mean error at each place has this first harmonic.
TEST(SampleReaders, JitterBlursASawtooth) {
    const SampleNoise::CountError error{.step_arcsec = 0.8, .jitter_arcsec = 0.2, .harmonics = 2};
    random::NormalStream normal({2, 1}, random::Purpose::bootstrap);
    constexpr int draws = 400000;
    std::complex<double> first = 0.0;
    std::complex<double> second = 0.0;
    for (int i = 0; i < draws; ++i) {
        const double place = (i + 0.5) / draws;
        const double counted = place + error.jitter_arcsec / error.step_arcsec * normal();
        const double off = error.step_arcsec * (0.5 - (counted - std::floor(counted)));
        first += off * std::polar(2.0 / draws, -units::two_pi * place);
        second += off * std::polar(2.0 / draws, -2.0 * units::two_pi * place);
    }
    EXPECT_NEAR(std::abs(first), error.amplitude_arcsec(1), 0.003);
    EXPECT_NEAR(std::abs(second), error.amplitude_arcsec(2), 0.003);
}

TEST(SampleReaders, ADitherThatWasLeftIsNamed) {
    scenario::Scenario s = samples_at(100.0, 60.0);
    s.reader.stripping = Stripping::none;
    s.reader.fraction = reader::Fraction::detectors;
    s.record.trajectory = scenario::parse_arm("ideal");
    // Unequal half cycles would make harmonics, lines of their own.
    s.ensemble.dither_asymmetry_sd_ratio = 0.0;
    const Closure closure = close_loop(instrument::simulate_record(s));
    ASSERT_FALSE(closure.steps.empty());
    for (const Step& step : closure.steps) EXPECT_EQ(step.name(), "dither_residue") << effects_of(closure);
}

// A notch takes off the line of the dither and leaves its injected noise, which varies over a half cycle: at the turns
// it is that of the scenario, 3 rad.
TEST(LongSampleReaders, TheNoiseOfADitherThatANotchLeavesIsNoEffect) {
    scenario::Scenario s = samples_at(100.0, 60.0);
    s.dither.frequency_hz = 390.444;
    s.reader.stripping = Stripping::notch;
    s.reader.latch_hz = 2500.0;
    s.reader.fraction = reader::Fraction::detectors;
    s.ensemble.dither_asymmetry_sd_ratio = 0.0;
    const record::Record record = instrument::simulate_record(s);
    const SampleSeries series = prepare_samples(record);
    const Rows rows(series.size(), 1);
    const SampleFit base(series, SampleModel{}, rows);
    const auto noise = find_dither_noise(base, record);
    ASSERT_TRUE(noise.has_value());
    EXPECT_NEAR(noise->turn_hz, 2.0 * 390.444, 2e-3);
    EXPECT_GT(noise->share, 0.9);
    EXPECT_LT(noise->memory, 0.5);
    SampleModel model;
    take_dither_noise(*noise, model.noise);
    const SampleFit with(series, std::move(model), rows);
    const double at_turns_arcsec = 3.0 * *record.declared.scale_factor_arcsec / (2.0 * std::acos(-1.0));
    EXPECT_NEAR(with.model().noise.angle_arcsec, at_turns_arcsec, 0.05 * at_turns_arcsec);
    const Closure closure = close_loop(record);
    EXPECT_EQ(closure.verdict, Verdict::nothing_missing) << effects_of(closure);
}

// The dither itself is named, and its noise belongs to the base. Faster samples are summed until one lasts for a half
// cycle.
TEST(SampleReaders, BesideADitherThatWasLeftNothingElseIsNamed) {
    scenario::Scenario s = samples_at(1000.0, 20.0);
    s.reader.stripping = Stripping::none;
    s.reader.fraction = reader::Fraction::detectors;
    s.ensemble.dither_asymmetry_sd_ratio = 0.0;
    const record::Record record = instrument::simulate_record(s);
    std::string note;
    const record::Record summed = summed_for_reader(record, note);
    EXPECT_GE(2.0 * *record.declared.dither_frequency_hz / summed.samples->rate_hz, 1.0);
    EXPECT_FALSE(note.empty());
    const Closure closure = close_loop(record);
    EXPECT_EQ(closure.verdict, Verdict::closed) << effects_of(closure);
    EXPECT_EQ(effects_of(closure), "dither_residue ");
}

// A noisy drive: the amplitude of a resonator, between half cycles of unequal length.
// At 400 samples a second the dither of 266.983 Hz shows at 133.017 Hz, and its second harmonic at 133.966 Hz.
TEST(LongSampleReaders, AHarmonicAliasedNextToTheDitherIsAccountedFor) {
    scenario::Scenario s = scenario::read_device(*scenario::find_device("triangle-51mm")).scenario;
    s.ensemble.gyros = 1;
    s.ensemble.duration_s = 39.0;
    s.ensemble.seed = 24;
    s.dither.frequency_hz = 266.983;
    s.record.kind = scenario::RecordKind::samples;
    s.record.rate_hz = 400.0;
    s.reader.stripping = Stripping::none;
    s.reader.fraction = reader::Fraction::none;
    const Closure closure = close_loop(instrument::simulate_record(s));
    EXPECT_EQ(closure.verdict, Verdict::closed) << effects_of(closure);
    EXPECT_EQ(effects_of(closure), "dither_residue ");
    EXPECT_TRUE(std::any_of(closure.notes.begin(), closure.notes.end(), [](const std::string& note) {
        return note.find("is harmonic 2 of the dither") != std::string::npos;
    }));
}

TEST(LongSampleReaders, BesideTheDitherOfANoisyDriveNothingElseIsNamed) {
    scenario::Scenario s = samples_at(400.0, 25.0);
    s.reader.stripping = Stripping::none;
    s.reader.fraction = reader::Fraction::detectors;
    s.noise_injection.model = scenario::NoiseModel::drive;
    s.noise_injection.turn_phase_rms_rad = 10.0;
    const record::Record record = instrument::simulate_record(s);
    const Closure closure = close_loop(record);
    EXPECT_EQ(closure.verdict, Verdict::closed) << effects_of(closure);
    EXPECT_EQ(effects_of(closure), "dither_residue ");
}

// Without injected noise the kicks go on as evenly as the phase does: 30 Hz under 15 deg/h of a gyro of 0.5 arcsec.
TEST(LongSampleReaders, WithoutInjectedNoiseTheBeatOfTheInputRateIsNamed) {
    scenario::Scenario s = samples_at(100.0, 40.0);
    s.record.trajectory = scenario::parse_arm("uncompensated");
    const record::Record record = instrument::simulate_record(s);
    const SampleSeries series = prepare_samples(record);
    const Rows rows(series.size(), 1);
    const SampleFit base(series, SampleModel{}, rows);
    const auto beat = find_rate_beat(base, record.declared);
    ASSERT_TRUE(beat.has_value());
    EXPECT_NEAR(beat->hz, 15.0 / s.gyro.scale_factor_arcsec, 0.05 * beat->hz);
    EXPECT_LT(beat->rate_deg_h, beat->most_deg_h);
    const Closure closure = close_loop(record);
    ASSERT_TRUE(closure.unexplained.has_value());
    EXPECT_NE(closure.unexplained->detail.find("no noise randomises"), std::string::npos) << effects_of(closure);
    for (const Step& step : closure.steps) {
        EXPECT_NE(on_samples(*step.effect), OnSamples::transport);
        EXPECT_FALSE(is_line(*step.effect)) << step.name();
    }
}

TEST(SampleReaders, WithInjectedNoiseThereIsNoBeatOfTheInputRate) {
    const record::Record record = instrument::simulate_record(samples_at(100.0, 100.0));
    const SampleSeries series = prepare_samples(record);
    const Rows rows(series.size(), 1);
    EXPECT_FALSE(find_rate_beat(SampleFit(series, SampleModel{}, rows), record.declared).has_value());
}

// White rate noise through a filter of the length of an interval: all of its variance stays in a row and the next.
TEST(SampleReaders, AFilterDividesARowsNoiseWithTheNext) {
    scenario::Scenario s = samples_at(25.0, 50.0);
    s.reader.stripping = Stripping::fir;
    s.reader.latch_hz = 1000.0;
    const record::Record record = instrument::simulate_record(s);
    const auto rows = filtered_rows(record);
    ASSERT_NE(rows, nullptr);
    const double total = rows->variance[0] + rows->carried[0] + 2.0 * rows->covariance[0];
    EXPECT_NEAR(total, 1.0, 1e-9);
    EXPECT_GT(rows->covariance[0], 0.01);
}

// A damaged file can declare a filter of 2e12 taps.
TEST(SampleReaders, AFilterLongerThanTheRecordIsLeftOut) {
    record::Record record = instrument::simulate_record(samples_at(25.0, 50.0));
    record.reader->settings.stripping = Stripping::fir;
    record.reader->settings.latch_hz = 1e6;
    record.reader->delay_s = 1e6;
    std::string note;
    EXPECT_EQ(summed_for_reader(record, note).samples->size(), record.samples->size());
    EXPECT_TRUE(note.empty());
    EXPECT_EQ(filtered_rows(record), nullptr);
}

}  // namespace
}  // namespace samples_readers_test
}  // namespace ringlock::closure
