// Studies whose arms are read: the rules of their scenarios.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "engine/core/error.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/scenario/read_arms.hpp"
#include "engine/scenario/text/parse.hpp"
#include "tests/support/scenario_complaint.hpp"

namespace ringlock::scenario {
namespace scenario_reader_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr const char* read = "[reader]\noutput_hz = 100\n";

TEST(ScenarioReader, IsNoneByDefault) {
    const Scenario s;
    EXPECT_FALSE(reads_arms(s));
    EXPECT_EQ(outputs_hz(s), s.dither.frequency_hz);
    EXPECT_EQ(study_reader(s).latch_hz, 0.0);
    EXPECT_EQ(simulated_s(s), 600.0);
    EXPECT_EQ(least_fit_interval_s(s), 0.0);
}

TEST(ScenarioReader, SetsTheTimesOfAStudy) {
    Scenario s;
    s.ensemble.settle_s = 2.0;
    s.ensemble.duration_s = 60.0;
    s.output.sample_interval_s = 0.1;
    s.reader.output_hz = 100.0;
    s.reader.latch_hz = 1000.0;
    s.reader.stripping = reader::Stripping::reference_fir;
    s.reader.fir_order = 40;
    s.reader.reference_learning_s = 0.5;
    // The gains are learnt in eight time constants, then 41 taps fill.
    EXPECT_EQ(study_reader(s).warm_up_outputs, 405);
    EXPECT_DOUBLE_EQ(simulated_s(s), 66.05);
    EXPECT_DOUBLE_EQ(study_reader(s).delay_s, 0.02);
    EXPECT_DOUBLE_EQ(least_fit_interval_s(s), 0.4);
    const ensemble::Schedule schedule(s);
    EXPECT_EQ(schedule.output_s, 0.01);
    EXPECT_EQ(schedule.outputs_per_sample, 10);
    EXPECT_EQ(schedule.samples, 601);
    EXPECT_EQ(schedule.outputs(), 6001);
    EXPECT_EQ(schedule.samples_per_fit, 4);
    EXPECT_NEAR(schedule.start_s, 2.0 + 4.05 - 0.02, 0.5 / s.dither.frequency_hz);
    // All of it is simulated, and a cycle or two more.
    const auto cycles = static_cast<double>(schedule.turns() - schedule.settle_turns() - 1) / 2.0;
    EXPECT_GE(cycles / s.dither.frequency_hz, 64.05);
    EXPECT_LE(cycles / s.dither.frequency_hz, 64.05 + 2.0 / s.dither.frequency_hz);
}

TEST(ScenarioReader, TicksAreAWholeMultipleOfTheOutputs) {
    const std::string text = read;
    EXPECT_EQ(complaint(text + "latch_hz = 700"), "");
    EXPECT_THAT(complaint(text + "latch_hz = 250"),
                AllOf(HasSubstr("s.toml:3:12: key \"reader.latch_hz\" = 250.0: "),
                      HasSubstr("not a whole multiple of the 100 Hz at which the arms of a study are read"),
                      HasSubstr("set 300, or 0")));
    EXPECT_THAT(complaint(text + "latch_hz = 50"), HasSubstr("set 100, or 0"));
    // A record of samples has a rate of its own.
    EXPECT_THAT(complaint(text + "latch_hz = 300\n[record]\nkind = \"samples\"\nrate_hz = 200"),
                HasSubstr("at which samples are taken"));
    EXPECT_EQ(complaint(text + "latch_hz = 600\n[record]\nkind = \"samples\"\nrate_hz = 200"), "");
}

TEST(ScenarioReader, OutputsFitTheRun) {
    EXPECT_THAT(complaint("[reader]\noutput_hz = 0.5"),
                AllOf(HasSubstr("s.toml:2:13: key \"reader.output_hz\" = 0.5: "),
                      HasSubstr("at least one output of the reader apart, 2 s")));
    EXPECT_EQ(complaint("[reader]\noutput_hz = 0.5\n[output]\nsample_interval_s = 2"), "");
    EXPECT_THAT(complaint("[reader]\noutput_hz = 0.5\n[output]\nsample_interval_s = 2\n[ensemble]\nduration_s = 5"),
                HasSubstr("must hold at least 3 samples"));
    EXPECT_THAT(complaint(std::string(read) + "[output]\ntau_s = [0.001]"),
                HasSubstr("from 0.01 s (an output of the reader)"));
    EXPECT_EQ(complaint(std::string(read) + "[output]\ntau_s = [0.01]"), "");
    EXPECT_THAT(complaint("[output]\ntau_s = [0.001]"), HasSubstr("0.00802 s (a dither cycle)"));
    // 1e7 deg/h over 1000 s are 2e10 fringes.
    EXPECT_THAT(complaint("[dither]\npeak_rate_deg_s = 10000\n[input]\nrate_deg_h = 1e6\n[reader]\noutput_hz = 0.001\n"
                          "[output]\nsample_interval_s = 1000\n[ensemble]\nduration_s = 10000"),
                HasSubstr("set a higher reader.output_hz"));
}

TEST(ScenarioReader, AFilterFitsTheRun) {
    const std::string text = std::string(read) + "latch_hz = 1000\nstripping = \"fir\"\nfir_order = 2000\n";
    EXPECT_EQ(complaint(text), "");
    // Two seconds long: noise is fitted to samples that are 20 s apart.
    EXPECT_THAT(complaint(text + "[ensemble]\nduration_s = 50"), HasSubstr("here 20 s"));
    EXPECT_THAT(complaint(text + "[specification]\narw_deg_rt_h = 1"),
                AllOf(HasSubstr("the record has 30"), HasSubstr("or filter of the reader")));
}

TEST(ScenarioReader, AStudyIsStripped) {
    EXPECT_THAT(complaint(std::string(read) + "stripping = \"none\""),
                AllOf(HasSubstr("s.toml:3:13: key \"reader.stripping\" = \"none\": "),
                      HasSubstr("would contain the dither, 501.4 arcsec of it"), HasSubstr("`ringlock record`")));
    EXPECT_EQ(complaint("[reader]\nstripping = \"none\""), "");
}

TEST(ScenarioReader, WarmUpEnds) {
    const std::string text = std::string(read) + "reference_learning_s = ";
    EXPECT_EQ(complaint(text + "100"), "");
    EXPECT_THAT(complaint(text + "1000"),
                AllOf(HasSubstr("s.toml:3:24: key \"reader.reference_learning_s\" = 1000.0: "),
                      HasSubstr("simulated for 8e+03 s before they are fit for use")));
    EXPECT_THAT(complaint(std::string(read) + "stripping = \"notch\"\nnotch_bandwidth_hz = 5e-324"),
                HasSubstr("reader.notch_bandwidth_hz"));
}

TEST(ScenarioReader, RulesOfRecordsHoldForStudies) {
    EXPECT_THAT(complaint(std::string(read) + "stripping = \"fir\""), HasSubstr("set a higher reader.latch_hz"));
    EXPECT_THAT(complaint(std::string(read) + "reference_delay_s = 0.003"), HasSubstr("a quarter of a dither cycle"));
    EXPECT_THAT(complaint(std::string(read) + "latch_hz = 1000\nstripping = \"fir\"\nfir_order = 13"),
                HasSubstr("odd order"));
    EXPECT_THAT(complaint("[dither]\nfrequency_hz = 200\n[reader]\noutput_hz = 100\nstripping = \"notch\""),
                HasSubstr("within two bandwidths"));
    // Without output_hz nobody reads.
    EXPECT_EQ(complaint("[reader]\nreference_delay_s = 0.003"), "");
}

}  // namespace
}  // namespace scenario_reader_test
}  // namespace ringlock::scenario
