// Records that were taken at another rate and interpolated to their own, which the closed loop reads.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/samples/loop/loop.hpp"
#include "analysis/closure/samples/model/source.hpp"
#include "tests/closure/generator/samples.hpp"

namespace ringlock::test::closure {
namespace samples_resampled_test {
namespace {

using ringlock::closure::close_samples;
using ringlock::closure::Closure;
using ringlock::closure::Estimate;
using ringlock::closure::find_straight_lines;
using ringlock::closure::Step;
using ringlock::closure::Verdict;

/// A gyro whose readings have 0.3 arcsec of noise, taken at that rate; 0: at that of the record.
SampleTruth taken_at(double from_hz, std::uint64_t seed, std::size_t size = 30000) {
    SampleTruth truth;
    truth.size = size;
    truth.seed = seed;
    truth.white_angle_arcsec = 0.3;
    truth.rates.quantum_noise_deg_rt_h = 0.01;
    truth.resampling.from_hz = from_hz;
    return truth;
}

void expect_only_resampling(const Closure& found) {
    EXPECT_EQ(found.verdict, Verdict::closed);
    ASSERT_EQ(found.steps.size(), 1U);
    EXPECT_EQ(found.steps[0].name(), "resampling");
    // The noise is that of the samples as they were taken: four standard errors
    EXPECT_NEAR(found.base[1].value, 0.3, 4.0 * found.base[1].sd);
    EXPECT_NEAR(found.base[2].value, 0.01, 4.0 * found.base[2].sd);
}

// Resampled from below, a third of the samples follow from the others: their rounding was taken for innovations.
TEST(LongResampledRecords, ClosesWhatWasTakenAtALowerRate) {
    for (const double from_hz : {61.8, 83.1}) {
        const Closure found = close_samples(generate_samples(taken_at(from_hz, 5, 10000)));
        expect_only_resampling(found);
        EXPECT_NEAR(found.steps[0].parameters[0].value, from_hz, 1e-6);
    }
}

// From less than two fifths of the record's rate neighbours lie on one straight line and are the same, which tells
// the source's clock exactly; largest values come several times, and a stretch has few readings.
TEST(LongResampledRecords, OfSlowSourcesHaveStraightLines) {
    for (const double from_hz : {5.1, 12.3, 23.7, 31.9, 39.1}) {
        const SampleTruth truth = taken_at(from_hz, 4, 6000);
        const record::Record record = generate_samples(truth);
        const auto source = find_straight_lines(record.samples->values, truth.rate_hz);
        ASSERT_TRUE(source) << from_hz;
        EXPECT_NEAR(source->from_hz, from_hz, 1e-8 * from_hz);
        const Closure found = close_samples(record);
        expect_only_resampling(found);
        EXPECT_NEAR(found.steps[0].parameters[0].value, from_hz, 1e-6) << from_hz;
    }
    for (const double from_hz : {0.0, 45.2, 61.8}) {
        const SampleTruth truth = taken_at(from_hz, 4, 6000);
        EXPECT_FALSE(find_straight_lines(generate_samples(truth).samples->values, truth.rate_hz)) << from_hz;
    }
}

// Just below the record's rate a small error of one reading grows from interval to interval, and what digits would do
// grows with it. The rows that they reach are no structure.
TEST(LongResampledRecords, DigitsThatGrowAreNoStructure) {
    const Closure found = close_samples(generate_samples(taken_at(95.81, 7)));
    expect_only_resampling(found);
    EXPECT_NEAR(found.steps[0].parameters[0].value, 95.81, 1e-6);
}

/// Whether the answer has that rate, or says that the record cannot tell it from the one it has.
bool tells(const Closure& found, double from_hz) {
    if (found.steps.size() != 1 || found.steps[0].name() != "resampling") return false;
    if (std::abs(found.steps[0].parameters[0].value - from_hz) < 1e-3) return true;
    const std::string other = fmt::format("a source of {:.6g} Hz", from_hz);
    return std::any_of(found.notes.begin(), found.notes.end(),
                       [&](const std::string& note) { return note.starts_with(other); });
}

// Errors of readings average out where they are interpolated, and what is left of them looks like a rate: with the
// noises of a record as it is, images of the rate were likelier than the rate, or none explained enough.
TEST(LongResampledRecords, ImagesOfTheRateAreNotTheRate) {
    struct Source {
        double hz, rate_noise_deg_rt_h;
        std::uint64_t seed;
    };
    for (const Source& source : {Source{134.33, 0.025, 3}, {157.2, 0.005, 11}, {134.33, 0.04, 11}, {188.1, 0.02, 11}}) {
        SampleTruth truth = taken_at(source.hz, source.seed);
        truth.white_angle_arcsec = 0.1;
        truth.rates.quantum_noise_deg_rt_h = source.rate_noise_deg_rt_h;
        const Closure found = close_samples(generate_samples(truth));
        EXPECT_EQ(found.verdict, Verdict::closed) << source.hz;
        EXPECT_TRUE(tells(found, source.hz)) << source.hz << " " << source.rate_noise_deg_rt_h;
    }
}

// Near twice the record's rate readings share nothing: the variance alone says that they are interpolated, and how far
// the rate is from a multiple of the record's.
TEST(LongResampledRecords, AreToldByTheirVarianceAlone) {
    const Closure found = close_samples(generate_samples(taken_at(186.87, 8)));
    expect_only_resampling(found);
    const double from_hz = found.steps[0].parameters[0].value;
    EXPECT_NEAR(std::abs(from_hz - 100.0 * std::round(0.01 * from_hz)), 13.13, 1e-3);
}

// By how much a variance swings tells whether interpolation may do that.
TEST(LongResampledRecords, OtherVariancesThatRepeatAreNoResampling) {
    for (const double depth : {0.2, 0.4}) {
        SampleTruth truth = taken_at(0.0, 9);
        truth.noise_modulation = {depth, 0.0763};
        const Closure found = close_samples(generate_samples(truth));
        EXPECT_EQ(found.verdict, Verdict::unexplained) << depth;
        EXPECT_TRUE(found.steps.empty()) << depth;
        ASSERT_TRUE(found.unexplained);
        EXPECT_EQ(found.unexplained->where, ringlock::closure::Where::time);
    }
}

// A motion of the case is on the source's straight lines like all else: taken off as the witness has it, at the
// record's own times, it would break them.
TEST(LongResampledRecords, MotionIsResampledToo) {
    SampleTruth truth = taken_at(59.44, 3);
    truth.accelerometers = true;
    truth.case_motion.witness = "accel_x";
    truth.case_motion.coherence = 0.65;
    truth.case_motion.rms_arcsec = 0.2;
    truth.case_motion.centre_hz = 11.9;
    truth.case_motion.width_hz = 0.9;
    const Closure found = close_samples(generate_samples(truth));
    EXPECT_EQ(found.verdict, Verdict::closed);
    ASSERT_EQ(found.steps.size(), 2U);
    EXPECT_EQ(found.steps[0].name(), "resampling");
    EXPECT_EQ(found.steps[1].name(), "case_motion");
}

// What a resampled record's source was given, it has on the straight lines between the source's times.
TEST(LongResampledRecords, KnownInputIsResampledToo) {
    SampleTruth truth = taken_at(77.3, 5, 10000);
    truth.white_angle_arcsec = 0.2;
    truth.input_profile_deg_h = {{0.0, 30.0, 31.0, 65.0, 66.0, 100.0}, {200.0, 200.0, -300.0, -300.0, 50.0, 50.0}};
    truth.scale_factor_error = 0.01;
    const auto found = close_samples(generate_samples(truth));
    EXPECT_EQ(found.verdict, Verdict::closed);
    ASSERT_EQ(found.steps.size(), 2U);
    EXPECT_EQ(found.steps[0].name(), "resampling");
    EXPECT_EQ(found.steps[1].name(), "scale_factor_error");
    const auto& relative = found.steps[1].parameters.at(0);
    EXPECT_NEAR(relative.value, 0.01, 4.0 * relative.sd);
}

const Estimate& named(const Closure& found, const std::string& effect, const std::string& parameter) {
    for (const Step& step : found.steps) {
        if (step.name() != effect) continue;
        for (const Estimate& estimate : step.parameters) {
            if (estimate.name == parameter) return estimate;
        }
    }
    throw std::runtime_error("no " + parameter + " of " + effect);
}

// A line a hundred times the noise has images far above it, which look like lines of their own and go when their source
// is known; whose clock the line tells, if all that the clock moves is fitted with it, better than anything else.
TEST(LongResampledRecords, StrongLinesHaveImagesAndTellTheClock) {
    struct Case {
        double from_hz, shown_hz, amplitude_arcsec;
        std::uint64_t seed;
    };
    // At 125 Hz images of the line are 25 Hz apart, and the variance comes back every four samples as they do.
    for (const Case& of : {Case{125.0, 48.1, 1.0, 1}, Case{61.8, 24.5, 3.0, 2}, Case{157.2, 34.3, 0.3, 6}}) {
        SCOPED_TRACE(of.from_hz);
        SampleTruth truth = taken_at(of.from_hz, of.seed, 20000);
        truth.white_angle_arcsec = 0.05;
        truth.dither_residue = {3.0 * of.from_hz + of.shown_hz, 1e-4, of.amplitude_arcsec, 0.0};
        const Closure found = close_samples(generate_samples(truth));
        EXPECT_EQ(found.verdict, Verdict::closed);
        ASSERT_EQ(found.steps.size(), 2U);
        const auto expect_near = [&](const Estimate& estimate, double value) {
            EXPECT_NEAR(estimate.value, value, 4.0 * estimate.sd) << estimate.name;
        };
        expect_near(found.base.at(1), 0.05);
        expect_near(named(found, "resampling", "from_hz"), of.from_hz);
        expect_near(named(found, "dither_residue", "frequency_hz"), of.shown_hz);
        expect_near(named(found, "dither_residue", "drift_hz_per_s"), 1e-4);
        expect_near(named(found, "dither_residue", "amplitude_arcsec"), of.amplitude_arcsec);
        EXPECT_LT(named(found, "resampling", "from_hz").sd, 1e-4);
    }
}

// A line on a curve that was resampled: its phase is lost from one part of the record to the next, its power is not.
TEST(LongResampledRecords, ALineOnACurveToo) {
    SampleTruth truth = taken_at(157.2, 4);
    truth.white_angle_arcsec = 0.05;
    truth.dither_residue = {437.3, 0.0, 0.3, 0.0, -0.5, 250.0};
    const Closure found = close_samples(generate_samples(truth));
    EXPECT_EQ(found.verdict, Verdict::closed);
    ASSERT_EQ(found.steps.size(), 2U);
    const Estimate from_hz = named(found, "resampling", "from_hz");
    EXPECT_NEAR(from_hz.value, 157.2, 4.0 * from_hz.sd);
    const Estimate amplitude = named(found, "dither_residue", "amplitude_arcsec");
    EXPECT_NEAR(amplitude.value, 0.3, 4.0 * amplitude.sd);
}

// Of a line the record has the straight lines between the source's readings: it is weaker there, and has others beside
// it. Where the source is faster it may be above half the record's rate, and shows below; found first or last.
TEST(LongResampledRecords, LinesAreThoseOfTheSource) {
    constexpr double dither_hz = 430.0;
    struct Case {
        double from_hz, amplitude_arcsec;
    };
    for (const Case& of : {Case{81.0, 0.04}, Case{125.3, 0.04}, Case{125.3, 0.5}}) {
        SCOPED_TRACE(testing::Message() << of.from_hz << " Hz, " << of.amplitude_arcsec << " arcsec");
        SampleTruth truth = taken_at(of.from_hz, 6);
        truth.declared.emplace().dither_frequency_hz = dither_hz;
        truth.dither_residue = {430.11, 0.0, of.amplitude_arcsec, 0.4};
        const Closure found = close_samples(generate_samples(truth));
        EXPECT_EQ(found.verdict, Verdict::closed);
        ASSERT_EQ(found.steps.size(), 2U);
        const Estimate from_hz = named(found, "resampling", "from_hz");
        EXPECT_NEAR(from_hz.value, of.from_hz, 4.0 * from_hz.sd);
        const Estimate amplitude = named(found, "dither_residue", "amplitude_arcsec");
        EXPECT_NEAR(amplitude.value, of.amplitude_arcsec, 4.0 * amplitude.sd);
        const Estimate hz = named(found, "dither_residue", "frequency_hz");
        EXPECT_NEAR(hz.value, 430.11, 4.0 * hz.sd);
    }
}

}  // namespace
}  // namespace samples_resampled_test
}  // namespace ringlock::test::closure
