// Whole studies: what the scenarios say in their first lines, and what may not be claimed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <string>

#include "analysis/study/result/result_file.hpp"
#include "analysis/study/summary.hpp"
#include "engine/scenario/text/parse.hpp"
#include "tests/support/gyro_records.hpp"
#include "tests/support/temporary_directory.hpp"

namespace ringlock::test {
namespace studies_test {
namespace {

scenario::Scenario from_file(const std::string& name) {
    return scenario::parse_file(std::filesystem::path(RINGLOCK_SOURCE_DIR) / "scenarios" / name);
}

study::Summary run(const scenario::Scenario& scenario) {
    return study::summarise(study::run(study::Study(scenario), 2));
}

const study::ArmSummary& arm(const study::Summary& summary, const std::string& name) {
    for (const study::ArmSummary& each : summary.arms) {
        if (each.name == name) return each;
    }
    throw std::runtime_error("no arm " + name);
}

TEST(Scenarios, AllAreValid) {
    int found = 0;
    for (const auto& entry :
         std::filesystem::directory_iterator(std::filesystem::path(RINGLOCK_SOURCE_DIR) / "scenarios")) {
        if (entry.path().extension() != ".toml") continue;
        EXPECT_NO_THROW(scenario::parse_file(entry.path())) << entry.path();
        ++found;
    }
    EXPECT_GE(found, 2);
}

/// The answer of gao-deng-2007.toml, for an ensemble of that duration.
void expect_answer_of_gao_deng(double duration_s) {
    scenario::Scenario scenario = from_file("gao-deng-2007.toml");
    scenario.ensemble.duration_s = duration_s;
    const study::Summary summary = run(scenario);
    EXPECT_NEAR(summary.theory.arw_deg_rt_h, 0.0022490, 5e-8);
    EXPECT_NEAR(summary.theory.dead_band_deg_h, 2.632, 5e-4);
    const study::Figure& injected = arm(summary, "noise_injected").arw_deg_rt_h;
    const study::Figure& published = arm(summary, "noise_injected+compensated_published").arw_deg_rt_h;
    const study::Figure& corrected = arm(summary, "noise_injected+compensated").arw_deg_rt_h;
    ASSERT_TRUE(injected.median && published.median && corrected.median);
    EXPECT_LE(*injected.median_lo, summary.theory.arw_deg_rt_h);
    EXPECT_GE(*injected.median_hi, summary.theory.arw_deg_rt_h);
    EXPECT_LT(*injected.median_hi - *injected.median_lo, 0.1 * *injected.median);
    EXPECT_NEAR(*published.median / *injected.median, 1.0, 0.01);
    // The readout's 0.5 % of detector noise is what is left.
    EXPECT_NEAR(*corrected.median / *injected.median, 0.005, 0.0007);
    for (const study::ArmSummary& each : summary.arms) EXPECT_FALSE(each.bias_instability_deg_h) << each.name;
    EXPECT_FALSE(arm(summary, "uncompensated").arw_deg_rt_h.median);
}

TEST(Scenarios, GaoDeng2007ShortensToItsAnswer) { expect_answer_of_gao_deng(60.0); }
TEST(LongScenarios, GaoDeng2007) { expect_answer_of_gao_deng(600.0); }

TEST(LongScenarios, GaoDengTable1TurnsItsErrorsRound) {
    scenario::Scenario scenario = from_file("gao-deng-2007-table1.toml");
    EXPECT_EQ(scenario.ensemble.duration_s, 60.0);
    EXPECT_EQ(scenario.readout.angle_output, scenario::AngleOutput::quarter_fringe);
    scenario.ensemble.gyros = 8;
    // Readings are whole counts: from sample to sample the angle moves by multiples of K/4.
    const double count_arcsec = 0.25 * scenario.gyro.scale_factor_arcsec;
    double worst = 0.0;
    std::int64_t moved = 0;
    std::mutex mutex;
    const study::Study study = study::run(study::Study(scenario), 2, [&](const study::SampledAngles& samples) {
        if (scenario.arms[samples.arm].name.starts_with("compensated")) return;  // less a correction that is no count
        const std::lock_guard lock(mutex);
        const std::size_t length = samples.angle_arcsec.size() / samples.gyros;
        for (std::size_t gyro = 0; gyro < samples.gyros; ++gyro) {
            for (std::size_t i = 1; i < length; ++i) {
                const double* const angle = samples.angle_arcsec.data() + gyro * length + i;
                const double counts = (angle[0] - angle[-1]) / count_arcsec;
                worst = std::max(worst, std::abs(counts - std::nearbyint(counts)));
                ++moved;
            }
        }
    });
    EXPECT_GT(moved, 400000);
    // The dither is stripped at its own turn, from which the lock-in moves the phase's by b/a at most: b^2/(2
    // a), 1.2e-3 of a count.
    EXPECT_LT(worst, 1.3e-3);
    const study::Summary summary = study::summarise(study);
    const double answer[] = {0.105, -0.048, 0.061, -0.095};
    // A count over a minute is K/4/60 s = 0.002 deg/h, the mean of eight gyros has less.
    for (std::size_t i = 0; i < 4; ++i) {
        const double rate = 100.0 * (static_cast<double>(i) + 1.0);
        const auto error = [&](const char* name) { return arm(summary, name).sweep[i].output_rate_deg_h.mean - rate; };
        EXPECT_NEAR(error("uncompensated"), answer[i], 0.002) << rate;
        EXPECT_NEAR(error("compensated_published"), -answer[i], 0.002) << rate;
        EXPECT_NEAR(error("compensated"), 0.0, 0.002) << rate;
    }
}

TEST(Scenarios, GaoDengCoefficientsAreAlikeAtAllRates) {
    scenario::Scenario scenario = from_file("gao-deng-2007-coefficients.toml");
    EXPECT_EQ(scenario.input.sweep_stop_deg_h, 500.0);
    scenario.input.sweep_points = 3;
    scenario.ensemble.gyros = 16;
    scenario.ensemble.duration_s = 120.0;
    const study::Study study = study::run(study::Study(scenario), 2);
    const study::Summary summary = study::summarise(study);
    const study::Figure& injected = arm(summary, "noise_injected").arw_deg_rt_h;
    const study::Figure& published = arm(summary, "noise_injected+compensated_published").arw_deg_rt_h;
    const study::Figure& corrected = arm(summary, "noise_injected+compensated").arw_deg_rt_h;
    ASSERT_TRUE(injected.median && published.median && corrected.median);
    EXPECT_NEAR(*injected.median / summary.theory.arw_deg_rt_h, 1.0, 0.05);
    EXPECT_NEAR(*published.median / *injected.median, 1.0, 0.005);
    EXPECT_NEAR(*corrected.median, 1.3e-6, 0.1e-6);
    const auto& raw = study.arms[0].gyros;
    const auto& turned = study.arms[1].gyros;
    double sum = 0.0;
    double scale = 0.0;
    for (std::size_t i = 0; i < raw.size(); ++i) {
        sum += std::pow(raw[i].rate_error_deg_h + turned[i].rate_error_deg_h, 2);
        scale += std::pow(raw[i].rate_error_deg_h, 2);
    }
    // Each gyro's error with its sign turned, but for what the corrected coefficients leave.
    EXPECT_LT(std::sqrt(sum / scale), 0.01);
    EXPECT_LT(arm(summary, "noise_injected+compensated_exact").arw_deg_rt_h.hi.value(), 1e-8);
}

TEST(Scenarios, DeadBandEndsWhereItSays) {
    scenario::Scenario scenario = from_file("dead-band.toml");
    EXPECT_EQ(scenario.input.rate_deg_h, 0.0);
    EXPECT_EQ(scenario.input.sweep_stop_deg_h, 5.0);
    EXPECT_EQ(scenario.ensemble.dither_amplitude_sd_relative, 0.0);
    // The same study where it matters.
    scenario.input.rate_deg_h = 2.5;
    scenario.input.sweep_stop_deg_h = 2.8;
    scenario.input.sweep_points = 16;
    const study::Summary summary = run(scenario);
    const auto edge = study::locked_up_to_deg_h(arm(summary, "uncompensated"));
    ASSERT_TRUE(edge);
    EXPECT_NEAR(*edge, 2.64, 1e-9);
    EXPECT_FALSE(study::locked_up_to_deg_h(arm(summary, "compensated")));
    EXPECT_FALSE(study::locked_up_to_deg_h(arm(summary, "ideal")));
    for (const study::SweepPoint& point : arm(summary, "compensated").sweep) {
        EXPECT_NEAR(point.output_rate_deg_h.mean, point.input_rate_deg_h, 2e-3);
    }
}

TEST(Scenarios, TheStaircaseIsTheOneOfTheClosedForm) {
    scenario::Scenario scenario = from_file("staircase.toml");
    EXPECT_EQ(scenario.ensemble.dither_amplitude_sd_relative, 0.0);
    EXPECT_EQ(scenario.input.sweep_points, 1351);
    // Each tenth rate: the same range, 1 deg/h apart, gives the figures of its answer to 1 deg/h.
    scenario.input.sweep_points = 136;
    const study::Study study = study::run(study::Study(scenario), 2);
    const study::Summary summary = study::summarise(study);
    const study::ArmSummary& plain = arm(summary, "uncompensated");
    // N cycles gain N rotation numbers within a fringe; the readings are 1e-3 fringes off the turns.
    const double duration_s = study.schedule.sample_interval_s * static_cast<double>(study.schedule.samples - 1);
    const double fringe_deg_h = scenario.gyro.scale_factor_arcsec / duration_s;
    EXPECT_NEAR(fringe_deg_h, 0.0085, 5e-5);
    for (const study::GyroStatistics& gyro : study.arms.at(1).gyros) {
        ASSERT_TRUE(gyro.rate_error_closed_form_deg_h);
        EXPECT_NEAR(gyro.rate_error_deg_h, *gyro.rate_error_closed_form_deg_h, 1.01 * fringe_deg_h);
    }
    ASSERT_EQ(plain.steps.size(), 3U);
    const std::vector<std::pair<double, double>> steps = {{0.0, 2.0}, {61.0, 63.0}, {123.0, 127.0}};
    for (std::size_t n = 0; n < steps.size(); ++n) {
        EXPECT_EQ(plain.steps[n].order, static_cast<std::int64_t>(n));
        EXPECT_NEAR(plain.steps[n].output_rate_deg_h, 62.341 * static_cast<double>(n), 1e-3);
        EXPECT_NEAR(plain.steps[n].first_deg_h, steps[n].first, 1e-9);
        EXPECT_NEAR(plain.steps[n].last_deg_h, steps[n].second, 1e-9);
    }
}

TEST(LongScenarios, TheRateSweepShortensToItsAnswer) {
    scenario::Scenario scenario = from_file("rate-sweep.toml");
    EXPECT_EQ(scenario.input.rate_deg_h, -10.0);
    EXPECT_EQ(scenario.input.sweep_stop_deg_h, 500.0);
    scenario.input.sweep_points = 18;
    scenario.ensemble.duration_s = 30.0;
    const study::Study study = study::run(study::Study(scenario), 2);
    const study::Summary summary = study::summarise(study);
    const double duration_s = study.schedule.sample_interval_s * static_cast<double>(study.schedule.samples - 1);
    double squares = 0.0;
    for (int j = 0; j < 18; ++j) squares += std::pow(30.0 * (j - 8.5), 2);
    for (const study::ArmSummary& each : summary.arms) ASSERT_TRUE(each.scale_factor) << each.name;

    // Behind injected noise the random walk is all there is: over the record it scatters the rates by N/sqrt(T), and
    // that the slopes. 16 gyros at 18 rates: 240 degrees of freedom, 4.6 %; 15 of the slopes, 18 %; 3 of each allowed.
    const double rate_noise_deg_h = summary.theory.arw_deg_rt_h / std::sqrt(duration_s / 3600.0);
    for (const char* name : {"noise_injected", "noise_injected+compensated_published"}) {
        const study::ScaleFactor& line = *arm(summary, name).scale_factor;
        EXPECT_NEAR(line.scatter_deg_h / rate_noise_deg_h, 1.0, 0.14) << name;
        EXPECT_NEAR(line.noise_ppm, 1e6 * line.scatter_deg_h / std::sqrt(squares), 1e-9) << name;
        EXPECT_NEAR(*line.repeatability_ppm.value / line.noise_ppm, 1.0, 0.55) << name;
        EXPECT_FALSE(line.nonlinearity_ppm.value) << name;
        EXPECT_FALSE(line.scale_factor_ppm.mean) << name;
    }
    // A corrected gyro has the floor of the quantum noise, the same at all rates: bias, not slope.
    for (const char* name : {"compensated_exact", "noise_injected+compensated_exact"}) {
        const study::ScaleFactor& line = *arm(summary, name).scale_factor;
        EXPECT_LT(*line.repeatability_ppm.value, 0.3) << name;
        EXPECT_FALSE(line.nonlinearity_ppm.value) << name;
        EXPECT_LT(line.nonlinearity_ppm.hi, 2.0) << name;
        EXPECT_LT(std::abs(line.bias_deg_h.lo) + std::abs(line.bias_deg_h.hi),
                  4.0 * 1e-4 / std::sqrt(duration_s / 3600.0));
    }
    // Uncompensated gyros lock at bands up to 3.02 deg/h to either side.
    const study::ScaleFactor& raw = *arm(summary, "uncompensated").scale_factor;
    EXPECT_GT(raw.gyro_deviation_deg_h, 0.3);
    EXPECT_LT(raw.gyro_deviation_hi_deg_h, 3.3);
    EXPECT_GT(*raw.repeatability_ppm.value, 30.0);
}

/// The answer of ideal-readout.toml, for an ensemble of that size and duration.
study::Summary ideal_readout(std::int64_t gyros, double duration_s) {
    scenario::Scenario scenario = from_file("ideal-readout.toml");
    scenario.ensemble.gyros = gyros;
    scenario.ensemble.duration_s = duration_s;
    const study::Summary summary = run(scenario);
    const auto& published = arm(summary, "noise_injected+compensated_published").arw_reduction;
    const auto& corrected = arm(summary, "noise_injected+compensated").arw_reduction;
    EXPECT_TRUE(published && published->ratio && published->hi && corrected && corrected->ratio && corrected->hi);
    EXPECT_NEAR(*published->ratio, 1.0, 0.02);
    EXPECT_LE(corrected->lo, 1800.0);
    EXPECT_GE(*corrected->hi, 1600.0);
    return summary;
}

TEST(Scenarios, IdealReadoutShortensToItsAnswer) {
    const auto exact = arm(ideal_readout(16, 3600.0), "noise_injected+compensated_exact").arw_reduction;
    ASSERT_TRUE(exact);
    EXPECT_GT(exact->lo, 1e6);
}

TEST(LongScenarios, IdealReadout) {
    const study::Summary summary = ideal_readout(32, 18000.0);
    const auto& exact = arm(summary, "noise_injected+compensated_exact").arw_reduction;
    ASSERT_TRUE(exact && exact->ratio && exact->hi);
    std::printf("injected over exact: %.4g (%.4g .. %.4g)\n", *exact->ratio, exact->lo, *exact->hi);
    EXPECT_GT(exact->lo, 1e6);
}

TEST(LongScenarios, WhatIdealReadoutLeavesIsOfTheInjectedNoiseNotOfTables) {
    // Allan deviations at four minutes, over the ensemble.
    const auto left_deg_h = [](double turn_phase_rms_rad, double tolerance_rad) {
        scenario::Scenario scenario = from_file("ideal-readout.toml");
        scenario.ensemble.gyros = 16;
        scenario.ensemble.duration_s = 7200.0;
        scenario.noise_injection.turn_phase_rms_rad = turn_phase_rms_rad;
        scenario.propagation.turn_map_tolerance_rad = tolerance_rad;
        scenario.arms = scenario::parse_arms({"noise_injected+compensated_exact"});
        const study::Study study = study::run(study::Study(scenario), 2);
        const study::Summary summary = study::summarise(study);
        EXPECT_FALSE(summary.arms[0].allan.empty());
        for (const study::EnsemblePoint& point : summary.arms[0].allan) {
            if (point.tau_s < 250.0) continue;
            std::printf(
                "rms %g rad, tables to %g rad, off by %.2g: Allan deviation %.4g deg/h (%.2g .. %.2g) at %.0f s\n",
                turn_phase_rms_rad, tolerance_rad, study.turn_map_error_rad, point.dev_deg_h, point.lo, point.hi,
                point.tau_s);
            return point.dev_deg_h;
        }
        return 0.0;
    };
    const double usual = left_deg_h(4.0, 1e-10);
    // Two hours hold 27 spans of 263 s, 16 gyros 440: 3.4 %. The noise is the same but for its size.
    EXPECT_NEAR(left_deg_h(8.0, 1e-10) / usual, 2.0, 0.2);
    EXPECT_NEAR(left_deg_h(4.0, 1e-12) / usual, 1.0, 0.01);
    EXPECT_NEAR(left_deg_h(4.0, 1e-7) / usual, 1.0, 0.01);
    // Counts of 2^-32 fringes, rounded to 1/sqrt(12) of one, would leave sqrt(3) of that over the averaging time.
    const double counts_deg_h = std::sqrt(3.0 / 12.0) * 0.5 / 4294967296.0 / 263.0;
    std::printf("counts of 2^-32 fringes: %.2g deg/h\n", counts_deg_h);
    EXPECT_LT(counts_deg_h, 1e-3 * usual);
}

TEST(LongScenarios, TheDirectIntegratorGivesTheSameStudyAsTheTurnMap) {
    // Everything a scenario can ask for at once; 500 turns and two trajectories of two gyros.
    scenario::Scenario scenario;
    scenario.ensemble.gyros = 2;
    scenario.ensemble.duration_s = 1.0;
    scenario.ensemble.dither_asymmetry_sd_ratio = 0.01;
    scenario.ensemble.lockin_threshold_sd_relative = 0.05;
    scenario.output.sample_interval_s = 0.1;
    scenario.effects["detector_phase_offset"]["phase_rad"] = 0.3;
    scenario.effects["readout_ellipse"]["gain"] = 0.03;
    scenario.effects["bias_ramp"]["deg_h_per_h"] = 1000.0;
    scenario.effects["base_vibration"] = {{"frequency_hz", 7.0}, {"rate_deg_h", 50.0}, {"phase_rad", 1.0}};
    scenario.effects["dither_second_harmonic"] = {{"ratio", 0.01}, {"phase_rad", 0.5}};
    scenario.effects["lockin_second_harmonic"] = {{"ratio", 0.1}, {"phase_rad", -0.7}};
    scenario.effects["lockin_turn_asymmetry"]["ratio"] = 0.1;
    scenario.effects["lockin_temperature"]["relative_per_k"] = 0.02;
    scenario.environment = {.temperature_ramp_k_per_h = 900.0, .temperature_swing_k = 3.0, .temperature_period_s = 2.0};
    const auto records = [&](scenario::PropagationMethod method) {
        scenario.propagation.method = method;
        auto all = std::make_unique<GyroRecords>(scenario, 2);
        all->run(0, 2, 2);
        return all;
    };
    const auto map = records(scenario::PropagationMethod::turn_map);
    const auto direct = records(scenario::PropagationMethod::direct);
    for (const std::int64_t g : {0, 1}) {
        for (std::size_t a = 0; a < scenario.arms.size(); ++a) {
            ASSERT_EQ((*map)[g].counts[a].size(), (*direct)[g].counts[a].size());
            for (std::size_t i = 0; i < (*map)[g].counts[a].size(); ++i) {
                EXPECT_NEAR((*map)[g].angle_arcsec(a, i), (*direct)[g].angle_arcsec(a, i), 1e-8)
                    << scenario.arms[a].name << " cycle " << i;
            }
        }
    }
}

TEST(Scenarios, ADriftingThresholdShowsInTheRandomWalk) {
    // The random walk goes with the threshold: 20 % more after 10 K, so that its square over the run has the mean of
    // (1 + 0.2 x)^2 over x from 0 to 1. 16 gyros of 600 samples each: 0.7 % of the random walk.
    scenario::Scenario scenario;
    scenario.arms = scenario::parse_arms({"noise_injected"});
    scenario.noise_injection.turn_phase_rms_rad = 4.0;
    scenario.ensemble.gyros = 16;
    const double still = *run(scenario).arms[0].arw_deg_rt_h.median;
    scenario.environment.temperature_ramp_k_per_h = 60.0;
    scenario.effects["lockin_temperature"]["relative_per_k"] = 0.02;
    const double drifting = *run(scenario).arms[0].arw_deg_rt_h.median;
    EXPECT_NEAR(drifting / still, std::sqrt((std::pow(1.2, 3) - 1.0) / 0.6), 0.03);
}

TEST(Studies, AnglesBetweenTwoSamplesMayBeMoreThanCountsHold) {
    // 2.4e9 fringes from sample to sample; counts go round after 2^32. Records of hours at a high rate do the same.
    scenario::Scenario scenario;
    scenario.gyro = {.scale_factor_arcsec = 1e-3, .lockin_threshold_deg_h = 0.0};
    scenario.dither = {.frequency_hz = 10.0, .peak_rate_deg_s = 1e4};
    scenario.readout.model = scenario::ReadoutModel::ideal;
    scenario.input.rate_deg_h = 1000.0;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.ensemble.gyros = 1;
    scenario.ensemble.duration_s = 7200.0;
    scenario.ensemble.dither_asymmetry_sd_ratio = 0.0;
    scenario.output.sample_interval_s = 2400.0;
    scenario.arms = scenario::parse_arms({"ideal"});
    std::vector<double> angle_arcsec;
    const study::Study study = study::run(study::Study(scenario), 1, [&](const study::SampledAngles& samples) {
        angle_arcsec.insert(angle_arcsec.end(), samples.angle_arcsec.begin(), samples.angle_arcsec.end());
    });
    // A fringe is 1e-3 arcsec.
    EXPECT_NEAR(study.arms[0].gyros[0].rate_error_deg_h, 0.0, 1e-6);
    ASSERT_EQ(angle_arcsec.size(), 4U);
    for (std::size_t i = 1; i < 4; ++i) {
        EXPECT_NEAR(angle_arcsec[i] - angle_arcsec[0], 2.4e6 * static_cast<double>(i), 1e-3);
    }
}

TEST(Studies, TheSizeOfTheResultIsKnownBeforehand) {
    scenario::Scenario scenario;
    scenario.ensemble.gyros = 500;
    scenario.ensemble.duration_s = 3.1;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = scenario::ReadoutModel::ideal;
    scenario.arms = scenario::parse_arms({"ideal", "uncompensated"});
    const TemporaryDirectory directory;
    for (const bool record : {false, true}) {
        scenario.output.angle_record = record;
        const auto path = directory / (record ? "with.h5" : "without.h5");
        study::ResultWriter writer(path, study::Experiment(scenario));
        const study::Experiment experiment =
            study::run(study::Experiment(scenario), 2,
                       [&](const study::SampledAngles& samples) { writer.write_samples(samples); });
        store::Provenance provenance;
        writer.finish(experiment, study::summarise(experiment), provenance);
        // Names, units and descriptions of some hundred objects come on top.
        const auto size = static_cast<double>(std::filesystem::file_size(path));
        const auto expected = static_cast<double>(study::expected_size_bytes(experiment));
        EXPECT_GT(size, expected);
        EXPECT_LT(size, expected + 66e3);
    }
}

TEST(Studies, ATemperatureThatStaysTakesNoClosedFormAway) {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.effects["lockin_temperature"]["relative_per_k"] = 0.02;
    const auto arm = scenario::parse_arm("uncompensated");
    scenario.environment.temperature_period_s = 3600.0;
    EXPECT_TRUE(study::has_closed_form(scenario, arm));
    scenario.environment.temperature_swing_k = 1.0;
    EXPECT_FALSE(study::has_closed_form(scenario, arm));
    scenario.environment = {.temperature_ramp_k_per_h = 1.0};
    EXPECT_FALSE(study::has_closed_form(scenario, arm));
}

TEST(Claims, NoBiasInstabilityWithoutFlickerHoweverWellTheTurnsAreRandomised) {
    for (const double rms : {0.3, 1.0, 1.5, 2.1, 3.0}) {
        scenario::Scenario scenario;
        scenario.noise_injection.turn_phase_rms_rad = rms;
        scenario.ensemble.gyros = 8;
        scenario.ensemble.duration_s = 120.0;
        const study::Summary summary = run(scenario);
        for (const study::ArmSummary& each : summary.arms) {
            EXPECT_FALSE(each.bias_instability_deg_h) << each.name << " at " << rms << " rad";
            // There is quantum noise by default: every arm has a random walk, or a limit of it.
            EXPECT_TRUE(each.arw_deg_rt_h.median || each.arw_deg_rt_h.hi) << each.name;
            EXPECT_EQ(each.arw_reason.empty(), each.arw_deg_rt_h.median.has_value()) << each.name;
        }
    }
}

TEST(Claims, BiasInstabilityIsFoundWhereThereIsFlicker) {
    scenario::Scenario scenario;
    scenario.effects["bias_instability"]["deg_h"] = 0.05;
    scenario.arms = scenario::parse_arms({"ideal", "noise_injected+compensated"});
    scenario.ensemble.gyros = 16;
    scenario.ensemble.duration_s = 400.0;
    const study::Summary summary = run(scenario);
    for (const study::ArmSummary& each : summary.arms) {
        ASSERT_TRUE(each.bias_instability_deg_h) << each.name;
        EXPECT_NEAR(*each.bias_instability_deg_h->median, 0.05, 0.01) << each.name;
    }
}

TEST(Claims, TheQuantumNoiseFloorIsWhatACorrectedGyroIsLeftWith) {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 3e-4;
    scenario.readout.model = scenario::ReadoutModel::ideal;
    scenario.arms = scenario::parse_arms({"noise_injected+compensated"});
    scenario.ensemble.gyros = 16;
    scenario.ensemble.duration_s = 200.0;
    const study::Figure arw = run(scenario).arms.at(0).arw_deg_rt_h;
    ASSERT_TRUE(arw.median);
    EXPECT_NEAR(*arw.median, 3e-4, 0.05 * 3e-4);
}

TEST(Claims, ALimitOfARecordTooShortIsAboveTheRandomWalkThatIsThere) {
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        scenario::Scenario scenario;
        scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
        scenario.arms = scenario::parse_arms({"noise_injected"});
        scenario.ensemble.gyros = 16;
        scenario.ensemble.duration_s = 15.0;
        scenario.ensemble.seed = seed;
        const study::Summary summary = run(scenario);
        const study::Figure& arw = summary.arms.at(0).arw_deg_rt_h;
        EXPECT_FALSE(arw.median);
        ASSERT_TRUE(arw.hi);
        EXPECT_GT(*arw.hi, summary.theory.arw_deg_rt_h);
        EXPECT_LT(*arw.hi, 2.0 * summary.theory.arw_deg_rt_h);
    }
}

TEST(Claims, AGyroWithoutLockInHasNoRandomWalkOnlyALimit) {
    scenario::Scenario scenario;
    scenario.gyro.lockin_threshold_deg_h = 0.0;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = scenario::ReadoutModel::ideal;
    scenario.arms = scenario::parse_arms({"noise_injected"});
    scenario.ensemble.gyros = 4;
    scenario.ensemble.duration_s = 60.0;
    const study::Figure arw = run(scenario).arms.at(0).arw_deg_rt_h;
    EXPECT_FALSE(arw.median);
    ASSERT_TRUE(arw.hi);
    EXPECT_LT(*arw.hi, 1e-9);
}

TEST(Claims, ALimitCountsTheKicksThatSingleCyclesDoNotSee) {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = scenario::ReadoutModel::ideal;
    scenario.arms = scenario::parse_arms({"noise_injected"});
    scenario.ensemble.gyros = 64;
    scenario.ensemble.duration_s = 30.0;
    study::Study study = study::run(study::Study(scenario), 2);
    // Single cycles show 5/8 of the variance.
    double variance = 0.0;
    for (const study::GyroStatistics& gyro : study.arms[0].gyros) {
        variance += std::pow(gyro.allan.front().dev, 2) * gyro.allan.front().tau_s / 3600.0 / 64.0;
    }
    const double theory = study::summarise(study).theory.arw_deg_rt_h;
    EXPECT_NEAR(variance / (theory * theory), 0.625, 0.02);
    // As if no fit had been possible: Allan deviations alone are left to give a limit.
    for (study::GyroStatistics& gyro : study.arms[0].gyros) gyro.noise = {};
    const study::Figure arw = study::summarise(study).arms.at(0).arw_deg_rt_h;
    EXPECT_FALSE(arw.median);
    ASSERT_TRUE(arw.hi);
    std::printf("limit over the truth: %.4f\n", *arw.hi / theory);
    // More than half of the limits at 95 %, each the smallest over the averaging times, hold.
    EXPECT_GE(*arw.hi, theory);
    EXPECT_LT(*arw.hi, 1.1 * theory);
}

}  // namespace
}  // namespace studies_test
}  // namespace ringlock::test
