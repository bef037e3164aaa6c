// Records of samples by the reader that takes them, against what is known of the scenario.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numeric>

#include "analysis/instrument/simulate.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/text/parse.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/temporary_directory.hpp"

namespace ringlock::instrument {
namespace record_readers_test {
namespace {

using scenario::Scenario;
using testing::HasSubstr;

Scenario samples_of(const char* arm) {
    Scenario s;
    s.ensemble.gyros = 1;
    s.ensemble.duration_s = 3.0;
    s.ensemble.dither_amplitude_sd_relative = 0.0;
    s.ensemble.dither_asymmetry_sd_ratio = 0.0;
    s.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    s.record.kind = scenario::RecordKind::samples;
    s.record.rate_hz = 997.0;
    s.record.trajectory = scenario::parse_arm(arm);
    return s;
}

std::vector<double> angles_of(const record::Samples& samples) {
    std::vector<double> angles(samples.size());
    std::partial_sum(samples.values.begin(), samples.values.end(), angles.begin());
    return angles;
}

double dither_arcsec(const Scenario& s) {
    return s.dither.peak_rate_deg_s * units::arcsec_per_deg / (units::two_pi * s.dither.frequency_hz);
}

// The phase of half a million radians a second is known at every tick: what is left is rounding.
TEST(Readers, AReferenceWithoutErrorLeavesTheRotation) {
    Scenario s = samples_of("noise_injected");
    s.gyro.lockin_threshold_deg_h = 0.0;
    s.input.rate_deg_h = 1234.5;
    const record::Record r = simulate_record(s);
    EXPECT_EQ(r.samples->size(), 2991U);
    for (const double increment : r.samples->values) EXPECT_NEAR(increment, 1234.5 / 997.0, 1e-8);
    EXPECT_EQ(r.reader->settings.stripping, reader::Stripping::reference);
    EXPECT_EQ(r.reader->settings.latch_hz, 997.0);
    EXPECT_EQ(r.reader->residue_relative, 0.0);
}

// Faster than a half cycle lasts: the turns alone, 800 a second, would show less than half of it.
TEST(Readers, AVibrationIsReadBetweenTurnsToo) {
    Scenario s = samples_of("noise_injected");
    s.gyro.lockin_threshold_deg_h = 0.0;
    s.input.rate_deg_h = 0.0;
    s.effects["base_vibration"] = {{"rate_deg_h", 300.0}, {"frequency_hz", 411.3}, {"phase_rad", 0.4}};
    const record::Samples samples = *simulate_record(s).samples;
    const double w = units::two_pi * 411.3;
    const auto angle_arcsec = [&](double time_s) { return -300.0 / w * std::cos(w * time_s + 0.4); };
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const double end_s = samples.t0_s + static_cast<double>(i) / 997.0;
        EXPECT_NEAR(samples.values[i], angle_arcsec(end_s) - angle_arcsec(end_s - 1.0 / 997.0), 1e-8) << i;
    }
}

TEST(Readers, AWhiteRateIsWhiteBetweenTurnsToo) {
    Scenario s = samples_of("noise_injected");
    s.gyro.lockin_threshold_deg_h = 0.0;
    s.input.rate_deg_h = 0.0;
    s.record.rate_hz = 5003.0;
    s.effects["quantum_noise"]["deg_rt_h"] = 0.01;
    const record::Samples samples = *simulate_record(s).samples;
    const auto n = static_cast<double>(samples.size());
    double variance = 0.0;
    double neighbours = 0.0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
        variance += samples.values[i] * samples.values[i] / n;
        if (i > 0) neighbours += samples.values[i] * samples.values[i - 1] / n;
    }
    const double arcsec_rt_s = 0.01 / units::deg_rt_h_per_arcsec_rt_s;
    EXPECT_NEAR(variance * 5003.0 / (arcsec_rt_s * arcsec_rt_s), 1.0, 4.0 * std::sqrt(2.0 / n));
    EXPECT_NEAR(neighbours / variance, 0.0, 4.0 / std::sqrt(n));
}

TEST(Readers, WithoutStrippingTheDitherIsInTheSamples) {
    Scenario s = samples_of("uncompensated");
    s.gyro.lockin_threshold_deg_h = 0.0;
    s.input.rate_deg_h = -77.0;
    s.reader.stripping = reader::Stripping::none;
    const record::Samples samples = *simulate_record(s).samples;
    const std::vector<double> angles = angles_of(samples);
    const double w = units::two_pi * s.dither.frequency_hz;
    for (std::size_t i = 0; i < angles.size(); ++i) {
        const double t = static_cast<double>(i + 1) / 997.0;
        EXPECT_NEAR(angles[i], -77.0 * t + dither_arcsec(s) * (1.0 - std::cos(w * t)), 1e-7);
    }
}

TEST(Readers, ACountIsInQuarterFringes) {
    Scenario s = samples_of("noise_injected");
    s.reader.stripping = reader::Stripping::none;
    s.reader.fraction = reader::Fraction::none;
    const double quarter = 0.25 * s.gyro.scale_factor_arcsec;
    const record::Record record = simulate_record(s);
    ASSERT_FALSE(record.samples->values.empty());
    for (const double increment : record.samples->values) {
        EXPECT_NEAR(increment / quarter, std::nearbyint(increment / quarter), 1e-6);
    }
}

TEST(Readers, DetectorsReadWithinTheirNoise) {
    Scenario exact = samples_of("noise_injected");
    Scenario noisy = exact;
    noisy.reader.fraction = reader::Fraction::detectors;
    noisy.readout.detector_noise_relative = 0.02;
    const auto truth = angles_of(*simulate_record(exact).samples);
    const auto read = angles_of(*simulate_record(noisy).samples);
    double mean = 0.0;
    double square = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) mean += (read[i] - truth[i]) / static_cast<double>(truth.size());
    for (std::size_t i = 0; i < truth.size(); ++i) {
        square += std::pow(read[i] - truth[i] - mean, 2) / static_cast<double>(truth.size());
    }
    const double formula = 0.02 / units::two_pi * noisy.gyro.scale_factor_arcsec;
    EXPECT_NEAR(std::sqrt(square), formula, 0.06 * formula);
}

// Between turns the correction is that of the half cycles gone through: what is left of the lock-in there is second
// order, and what a tick within a kick sees of it.
TEST(Readers, CompensationActsBetweenTurnsToo) {
    const auto deviation = [](const char* arm) {
        Scenario s = samples_of(arm);
        s.readout.model = scenario::ReadoutModel::ideal;
        s.input.rate_deg_h = 15.0;
        const auto angles = angles_of(*simulate_record(s).samples);
        std::vector<double> off;
        for (std::size_t i = 0; i < angles.size(); ++i)
            off.push_back(angles[i] - 15.0 * static_cast<double>(i + 1) / 997.0);
        double mean = 0.0;
        for (const double x : off) mean += x / static_cast<double>(off.size());
        double square = 0.0;
        for (const double x : off) square += (x - mean) * (x - mean) / static_cast<double>(off.size());
        return std::sqrt(square);
    };
    const double raw = deviation("noise_injected");
    for (const char* arm : {"noise_injected+compensated", "noise_injected+compensated_exact"}) {
        const double left = deviation(arm);
        std::printf("%s: %.3g of %.3g arcsec\n", arm, left, raw);
        EXPECT_LT(left, 0.05 * raw) << arm;
    }
}

TEST(Readers, EveryReaderOfEveryArmMakesARecordWithoutFault) {
    for (const auto stripping : {reader::Stripping::none, reader::Stripping::whole_cycle, reader::Stripping::reference,
                                 reader::Stripping::fir, reader::Stripping::notch, reader::Stripping::reference_fir}) {
        for (const char* arm : {"ideal", "uncompensated", "noise_injected+compensated_adaptive"}) {
            Scenario s = samples_of(arm);
            s.readout.model = scenario::ReadoutModel::instrument;
            s.ensemble.duration_s = 1.0;
            s.output.sample_interval_s = 0.1;
            s.record.rate_hz = 100.0;
            s.reader.latch_hz = 1000.0;
            s.reader.stripping = stripping;
            s.reader.fraction = reader::Fraction::detectors;
            s.reader.reference_learning_s = 0.1;
            ASSERT_TRUE(scenario::check(s).empty()) << scenario::check(s).front().problem;
            const record::Record r = simulate_record(s);
            EXPECT_EQ(r.samples->size(), 100U);
            EXPECT_EQ(r.reader->settings.stripping, stripping);
            for (const record::Finding& finding : record::check(r)) ADD_FAILURE() << finding.where << finding.what;
        }
    }
}

TEST(Readers, AreDeclaredInTheFile) {
    const test::TemporaryDirectory folder;
    Scenario s = samples_of("noise_injected");
    s.reader.latch_hz = 3.0 * 997.0;
    s.reader.stripping = reader::Stripping::reference_fir;
    s.reader.fraction = reader::Fraction::none;
    s.reader.reference_gain_error_relative = -0.01;
    s.reader.reference_learning_s = 0.2;
    s.reader.fir_order = 12;
    s.reader.fir_cutoff_hz = 200.0;
    const record::Record made = simulate_record(s);
    const std::string path = (folder.path() / "r.h5").string();
    record::write_record(path, made);
    const record::Record read = record::read_record(path);
    ASSERT_TRUE(read.reader.has_value());
    EXPECT_EQ(read.reader->settings, made.reader->settings);
    EXPECT_EQ(read.reader->delay_s, 6.0 / (3.0 * 997.0));
    EXPECT_TRUE(read.ignored.empty());
    // The record begins when the filter is full and the reference is learnt.
    EXPECT_GT(read.samples->t0_s, 1.6);
}

TEST(Readers, AreDeclaredInText) {
    const test::TemporaryDirectory folder;
    const std::string path = (folder.path() / "r.csv").string();
    const auto write = [&](const std::string& line) {
        std::ofstream file(path);
        file << "# rate_hz = 100\n" << line << "\nangle_increment_arcsec\n0.1\n0.2\n0.3\n";
    };
    write("# reader.stripping = whole_cycle\n# reader.latch_hz = 100");
    const record::Record read = record::read_record(path);
    ASSERT_TRUE(read.reader.has_value());
    EXPECT_EQ(read.reader->settings.stripping, reader::Stripping::whole_cycle);
    write("# reader.stripping = sieve");
    EXPECT_THAT(test::message_of<InputError>([&] { record::read_record(path); }),
                HasSubstr("is \"sieve\"; must be one of none, whole_cycle, reference, fir, notch, reference+fir"));
    write("# reader.latch_hz = -4");
    EXPECT_THAT(test::message_of<InputError>([&] { record::read_record(path); }), HasSubstr("must be a finite number"));
}

TEST(Readers, BreakRulesWithTheKeysNamed) {
    const auto problem = [](Scenario s, const char* key) {
        for (const scenario::Complaint& complaint : scenario::check(s)) {
            for (const std::string& named : complaint.keys) {
                if (named == key) return complaint.problem;
            }
        }
        return std::string();
    };
    Scenario s = samples_of("noise_injected");
    s.reader.latch_hz = 1000.0;
    EXPECT_THAT(problem(s, "reader.latch_hz"), HasSubstr("whole multiple"));
    s = samples_of("noise_injected");
    s.record.rate_hz = 100.0;
    s.reader.stripping = reader::Stripping::fir;
    EXPECT_THAT(problem(s, "reader.latch_hz"), HasSubstr("set a higher reader.latch_hz"));
    s.reader.latch_hz = 1000.0;
    s.reader.fir_order = 13;
    EXPECT_THAT(problem(s, "reader.fir_order"), HasSubstr("odd order"));
    s.reader.fir_order = 12;
    s.reader.fir_cutoff_hz = 500.0;
    EXPECT_THAT(problem(s, "reader.fir_cutoff_hz"), HasSubstr("not below half"));
    s = samples_of("noise_injected");
    s.record.rate_hz = s.dither.frequency_hz;
    s.reader.stripping = reader::Stripping::notch;
    EXPECT_THAT(problem(s, "reader.notch_bandwidth_hz"), HasSubstr("within two bandwidths"));
    s.reader.stripping = reader::Stripping::reference;
    s.reader.reference_delay_s = 3e-3;
    EXPECT_THAT(problem(s, "reader.reference_delay_s"), HasSubstr("a quarter of a dither cycle"));
    s = samples_of("noise_injected+compensated");
    s.record.kind = scenario::RecordKind::turns;
    EXPECT_THAT(problem(s, "record.trajectory"), HasSubstr("before any compensation"));
}

}  // namespace
}  // namespace record_readers_test
}  // namespace ringlock::instrument
