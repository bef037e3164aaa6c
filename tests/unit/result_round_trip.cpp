// A study that is read from a result file, against the one that was written to it.
#include <gtest/gtest.h>
#include <hdf5.h>

#include <cmath>
#include <filesystem>
#include <optional>

#include "analysis/study/result/result_file.hpp"
#include "engine/scenario/text/parse.hpp"
#include "tests/support/open_file.hpp"
#include "tests/unit/result_support.hpp"

namespace ringlock::study {
namespace result_round_trip_test {
namespace {

using test::ResultFile;
using test::small;
using test::write;
namespace fs = std::filesystem;

bool same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }
bool same(const std::optional<double>& a, const std::optional<double>& b) {
    return a.has_value() == b.has_value() && (!a || same(*a, *b));
}
bool same(const noise::Coefficient& a, const noise::Coefficient& b) {
    return a.resolved == b.resolved && same(a.value, b.value) && same(a.lo, b.lo) && same(a.hi, b.hi);
}
bool same(const noise::NoiseFit& a, const noise::NoiseFit& b) {
    return same(a.quantization_arcsec, b.quantization_arcsec) && same(a.arw_deg_rt_h, b.arw_deg_rt_h) &&
           same(a.bias_instability_deg_h, b.bias_instability_deg_h) && same(a.rrw_deg_h_rt_h, b.rrw_deg_h_rt_h) &&
           same(a.rate_ramp_deg_h_h, b.rate_ramp_deg_h_h) && a.described == b.described;
}
bool same(const allan::Point& a, const allan::Point& b) {
    return a.m == b.m && same(a.tau_s, b.tau_s) && same(a.dev, b.dev) && a.terms == b.terms && a.alpha == b.alpha &&
           same(a.edf, b.edf) && same(a.lo, b.lo) && same(a.hi, b.hi);
}
bool same(const Figure& a, const Figure& b) {
    return same(a.median, b.median) && same(a.lo, b.lo) && same(a.hi, b.hi) && same(a.median_lo, b.median_lo) &&
           same(a.median_hi, b.median_hi) && a.resolved == b.resolved;
}
bool same(const MeanFigure& a, const MeanFigure& b) {
    return same(a.mean, b.mean) && same(a.lo, b.lo) && same(a.hi, b.hi);
}
bool same(const gyro::Setup& a, const gyro::Setup& b) {
    return a.scale_factor_arcsec == b.scale_factor_arcsec && a.lockin_threshold_deg_h == b.lockin_threshold_deg_h &&
           a.coupling_phase_rad == b.coupling_phase_rad && a.dither_frequency_hz == b.dither_frequency_hz &&
           a.dither_peak_rate_deg_s == b.dither_peak_rate_deg_s &&
           a.dither_asymmetry_ratio == b.dither_asymmetry_ratio && a.input_rate_deg_h == b.input_rate_deg_h &&
           a.initial_phase_rad == b.initial_phase_rad;
}

TEST_F(ResultFile, GivesTheStudyBack) {
    scenario::Scenario scenario = small(true);
    scenario.arms = scenario::parse_arms({"ideal", "noise_injected", "noise_injected+compensated"});
    scenario.input = {.rate_deg_h = 1.0, .sweep_stop_deg_h = 2.0, .sweep_points = 2};
    ResultWriter writer(path_, Experiment(scenario));
    std::vector<double> record;                                       // of gyro 4 in the first arm
    const OnSamples on_samples = [&](const SampledAngles& samples) {  // one thread
        writer.write_samples(samples);
        const std::int64_t row = 4 - samples.first_gyro;
        if (samples.arm != 0 || row < 0 || row >= static_cast<std::int64_t>(samples.gyros)) return;
        const auto count = static_cast<std::ptrdiff_t>(samples.angle_arcsec.size() / samples.gyros);
        record.insert(record.end(), samples.angle_arcsec.begin() + row * count,
                      samples.angle_arcsec.begin() + (row + 1) * count);
    };
    const Experiment experiment = run(Experiment(scenario), 1, on_samples);
    const Study& study = experiment.points.front();
    store::Provenance provenance = store::collect_provenance({}, 1, "small.toml");
    provenance.wall_s = 1.5;
    writer.finish(experiment, summarise(experiment), provenance);

    const Study read = read_result(path_).points.front();
    EXPECT_EQ(read.scenario, study.scenario);
    EXPECT_EQ(read.factors, study.factors);
    EXPECT_EQ(read.turns, study.turns);
    EXPECT_EQ(read.tables_remade, study.tables_remade);
    EXPECT_EQ(read.contradictory_readings, study.contradictory_readings);
    EXPECT_EQ(read.turn_map_error_rad, study.turn_map_error_rad);
    ASSERT_EQ(read.gyros.size(), 6U);
    for (std::size_t g = 0; g < read.gyros.size(); ++g) EXPECT_TRUE(same(read.gyros[g], study.gyros[g])) << g;
    ASSERT_EQ(read.arms.size(), study.arms.size());
    for (std::size_t a = 0; a < read.arms.size(); ++a) {
        EXPECT_EQ(read.arms[a].arm, study.arms[a].arm);
        for (std::size_t g = 0; g < read.gyros.size(); ++g) {
            const GyroStatistics& x = read.arms[a].gyros[g];
            const GyroStatistics& y = study.arms[a].gyros[g];
            EXPECT_EQ(x.rate_error_deg_h, y.rate_error_deg_h);
            EXPECT_TRUE(same(x.noise, y.noise)) << read.arms[a].arm.name << " " << g;
            ASSERT_EQ(x.allan.size(), y.allan.size());
            for (std::size_t t = 0; t < x.allan.size(); ++t) EXPECT_TRUE(same(x.allan[t], y.allan[t])) << t;
        }
    }

    const Summary one = summarise(study);
    const Summary other = summarise(read);
    EXPECT_EQ(other.seed, one.seed);
    EXPECT_EQ(other.turns, one.turns);
    EXPECT_EQ(other.theory.arw_deg_rt_h, one.theory.arw_deg_rt_h);
    EXPECT_EQ(other.theory.dead_band_deg_h, one.theory.dead_band_deg_h);
    for (std::size_t a = 0; a < one.arms.size(); ++a) {
        EXPECT_TRUE(same(other.arms[a].arw_deg_rt_h, one.arms[a].arw_deg_rt_h));
        EXPECT_EQ(other.arms[a].bias_instability_deg_h.has_value(), one.arms[a].bias_instability_deg_h.has_value());
        EXPECT_TRUE(same(other.arms[a].rate_error_deg_h, one.arms[a].rate_error_deg_h));
        ASSERT_EQ(other.arms[a].sweep.size(), 2U);
        EXPECT_TRUE(same(other.arms[a].sweep[1].output_rate_deg_h, one.arms[a].sweep[1].output_rate_deg_h));
    }

    const store::File file = test::open_file(path_);
    const auto angle = file.dataset("arms/ideal/angle_arcsec").read_rows<double>(4, 1);
    EXPECT_EQ(angle, record);
    EXPECT_EQ(read_provenance(path_).wall_s, 1.5);
    EXPECT_EQ(read_provenance(path_).scenario_file, "small.toml");
    // The scenario in the file is a scenario.
    EXPECT_EQ(scenario::parse_string(file.dataset("scenario").read<std::string>().at(0), "resolved"), scenario);
}

TEST_F(ResultFile, GivesClosedFormsBackWhereTheDriveRepeatsItself) {
    scenario::Scenario scenario = small(false);
    scenario.arms = scenario::parse_arms({"ideal", "uncompensated", "compensated", "noise_injected"});
    scenario.input = {.rate_deg_h = 1.0, .sweep_stop_deg_h = 15.0, .sweep_points = 2};
    const auto read = [&] {
        fs::remove(path_);
        write(path_, scenario);
        return read_result(path_).points.front();
    };
    for (const ArmStatistics& arm : read().arms) {
        for (const GyroStatistics& gyro : arm.gyros) EXPECT_FALSE(gyro.rate_error_closed_form_deg_h) << arm.arm.name;
    }
    EXPECT_FALSE(test::open_file(path_).has_dataset("arms/uncompensated/rate_error_closed_form_deg_h"));

    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    const Study study = read();
    const double fringe_deg_h = scenario.gyro.scale_factor_arcsec /
                                (study.schedule.sample_interval_s * static_cast<double>(study.schedule.samples - 1));
    for (const ArmStatistics& arm : study.arms) {
        for (const GyroStatistics& gyro : arm.gyros) {
            const auto& closed_form = gyro.rate_error_closed_form_deg_h;
            ASSERT_EQ(closed_form.has_value(), arm.arm.name == "uncompensated") << arm.arm.name;
            if (!closed_form) continue;
            // The instrument's reading noise, 0.005 rad, is small against a fringe.
            EXPECT_NEAR(*closed_form, gyro.rate_error_deg_h, 1.01 * fringe_deg_h);
        }
    }
    const ArmSummary summary = summarise(study).arms.at(1);
    ASSERT_EQ(summary.sweep.size(), 2U);
    EXPECT_NEAR(summary.sweep[0].closed_form_rate_deg_h.value(), 0.0, 1e-9) << "locked";
    EXPECT_NEAR(summary.sweep[1].closed_form_rate_deg_h.value(), 14.8, 0.2);
    ASSERT_EQ(summary.steps.size(), 1U);
    EXPECT_EQ(summary.steps[0].order, 0);
    EXPECT_EQ(summary.steps[0].first_deg_h, 1.0);
    EXPECT_EQ(summary.steps[0].last_deg_h, 1.0);

    // Results of programs that knew no closed form are read as they are.
    const hid_t file = H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    ASSERT_GE(H5Ldelete(file, "arms/uncompensated/rate_error_closed_form_deg_h", H5P_DEFAULT), 0);
    H5Fclose(file);
    const ArmSummary older = summarise(read_result(path_)).front().arms.at(1);
    EXPECT_FALSE(older.sweep.at(0).closed_form_rate_deg_h);
    EXPECT_TRUE(older.steps.empty());
}

TEST(ClosedForm, IsThereWhereNoEffectAddsARateThatVaries) {
    const auto repeats = [](const std::string& effect, const std::string& parameter, double value) {
        scenario::Scenario scenario;
        scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
        if (!effect.empty()) scenario.effects.at(effect).at(parameter) = value;
        EXPECT_FALSE(has_closed_form(scenario, scenario::parse_arm("ideal")));
        EXPECT_FALSE(has_closed_form(scenario, scenario::parse_arm("compensated")));
        EXPECT_FALSE(has_closed_form(scenario, scenario::parse_arm("noise_injected")));
        return has_closed_form(scenario, scenario::parse_arm("uncompensated"));
    };
    EXPECT_FALSE(has_closed_form(scenario::Scenario(), scenario::parse_arm("uncompensated"))) << "quantum noise";
    EXPECT_TRUE(repeats("", "", 0.0));
    EXPECT_TRUE(repeats("dither_asymmetry", "ratio", 0.01));
    EXPECT_TRUE(repeats("detector_phase_offset", "phase_rad", 0.3));
    EXPECT_TRUE(repeats("readout_ellipse", "gain", 0.03));
    EXPECT_FALSE(repeats("quantum_noise", "deg_rt_h", 1e-6));
    EXPECT_FALSE(repeats("bias_instability", "deg_h", 0.01));
    EXPECT_FALSE(repeats("bias_ramp", "deg_h_per_h", 1.0));
    EXPECT_FALSE(repeats("bias_step", "step_deg_h", 1.0));
    EXPECT_FALSE(repeats("base_vibration", "rate_deg_h", 1.0));
    EXPECT_FALSE(repeats("rate_random_walk", "deg_h_rt_h", 1.0));
}

}  // namespace
}  // namespace result_round_trip_test
}  // namespace ringlock::study
