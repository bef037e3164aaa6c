// Deviations that are taken afterwards from the angle records of a result.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/estimator.hpp"
#include "analysis/study/family.hpp"
#include "analysis/study/result/result_file.hpp"
#include "engine/core/error.hpp"
#include "engine/store/hdf5.hpp"
#include "tests/support/open_file.hpp"
#include "tests/unit/result_support.hpp"

namespace ringlock::study {
namespace result_family_test {
namespace {

using test::ResultFile;
using test::small;
using test::write;
using testing::AllOf;
using testing::HasSubstr;

constexpr std::array oadev = {allan::Estimator::oadev};

/// Mean of the squares of all second differences over 2 (m tau0)^2: NIST SP1065 equation 11, as it is printed.
double overlapping_variance(const std::vector<double>& angle_arcsec, std::size_t m, double interval_s) {
    double sum = 0.0;
    std::size_t terms = 0;
    for (; terms + 2 * m < angle_arcsec.size(); ++terms) {
        const double second = angle_arcsec[terms + 2 * m] - 2.0 * angle_arcsec[terms + m] + angle_arcsec[terms];
        sum += second * second;
    }
    const double tau_s = static_cast<double>(m) * interval_s;
    return sum / (2.0 * tau_s * tau_s * static_cast<double>(terms));
}

TEST_F(ResultFile, DeviationsAtFactorsAskedForAreThoseOfTheStoredAngles) {
    write(path_, small(true));
    const Experiment experiment = read_result(path_);
    const Study& study = experiment.points.front();
    ASSERT_EQ(study.schedule.samples, 45);
    const std::vector<std::int64_t> factors = {1, 7, 22};  // no octaves; 22 is the largest of 45 samples
    const auto family = family_deviations(path_, experiment, 0, oadev, factors);
    ASSERT_EQ(family.size(), study.arms.size());
    const double interval_s = study.schedule.sample_interval_s;
    const store::File file = test::open_file(path_);
    for (std::size_t a = 0; a < family.size(); ++a) {
        const std::string name = study.arms[a].arm.name;
        ASSERT_EQ(family[a].size(), 1U) << name;
        EXPECT_EQ(family[a][0].estimator, allan::Estimator::oadev);
        const std::vector<EnsemblePoint>& points = family[a][0].points;
        ASSERT_EQ(points.size(), factors.size()) << name;
        const store::Dataset angles = file.group("arms").group(name).dataset("angle_arcsec");
        for (std::size_t i = 0; i < factors.size(); ++i) {
            SCOPED_TRACE(name + " " + std::to_string(factors[i]));
            double variance = 0.0;
            double variance_of_estimator = 0.0;
            double edf = 0.0;
            for (std::size_t g = 0; g < study.gyros.size(); ++g) {
                const auto record = angles.read_rows<double>(g, 1);
                variance += overlapping_variance(record, static_cast<std::size_t>(factors[i]), interval_s) / 3.0;
                const auto phase = allan::centred_phase(record, allan::Kind::phase, interval_s);
                const auto point =
                    allan::deviation(allan::Estimator::oadev, phase, interval_s, std::array{factors[i]}).at(0);
                variance_of_estimator += point.dev * point.dev / 3.0;
                edf += point.edf;
            }
            EXPECT_DOUBLE_EQ(points[i].tau_s, static_cast<double>(factors[i]) * interval_s);
            // Rounding: here no line is taken away before the differences are formed.
            EXPECT_NEAR(points[i].dev_deg_h / std::sqrt(variance), 1.0, 1e-9);
            EXPECT_NEAR(points[i].dev_deg_h / std::sqrt(variance_of_estimator), 1.0, 1e-14);
            EXPECT_DOUBLE_EQ(points[i].edf, edf);
            EXPECT_LT(points[i].lo, points[i].dev_deg_h);
            EXPECT_GT(points[i].hi, points[i].dev_deg_h);
        }
    }
}

// With a sample every cycle the records hold all that the deviations of a run are made of. At long averaging times a
// run takes fewer terms of it.
TEST_F(ResultFile, DeviationsOfSamplesAtEveryCycleAreThoseOfTheRun) {
    scenario::Scenario scenario = small(true);
    scenario.ensemble.duration_s = 10.0;
    scenario.output.sample_interval_s = 1.0 / scenario.dither.frequency_hz;
    write(path_, scenario);
    const Experiment experiment = read_result(path_);
    const Study& study = experiment.points.front();
    ASSERT_EQ(study.schedule.outputs_per_sample, 1);
    const Summary summary = summarise(study);
    const auto family = family_deviations(path_, experiment, 0, oadev, study.factors);
    for (std::size_t a = 0; a < family.size(); ++a) {
        const std::vector<EnsemblePoint>& run = summary.arms[a].allan;
        ASSERT_EQ(family[a][0].points.size(), run.size());
        std::size_t compared = 0;
        for (std::size_t i = 0; i < run.size(); ++i) {
            const std::int64_t all = allan::term_count(oadev[0], study.factors[i], study.schedule.samples);
            if (study.arms[a].gyros[0].allan[i].terms != all) continue;
            ++compared;
            SCOPED_TRACE(summary.arms[a].name + " " + std::to_string(run[i].tau_s));
            EXPECT_DOUBLE_EQ(family[a][0].points[i].tau_s, run[i].tau_s);
            EXPECT_NEAR(family[a][0].points[i].dev_deg_h / run[i].dev_deg_h, 1.0, 1e-9);
        }
        EXPECT_GE(compared, 3U) << summary.arms[a].name;
    }
}

TEST_F(ResultFile, WithoutFactorsDeviationsAreAtOctaves) {
    write(path_, small(true));
    const Experiment experiment = read_result(path_);
    const auto octaves = family_deviations(path_, experiment, 0, oadev).at(0).at(0).points;
    const std::vector<std::int64_t> factors = {1, 2, 4, 8, 16};
    const auto given = family_deviations(path_, experiment, 0, oadev, factors).at(0).at(0).points;
    ASSERT_EQ(octaves.size(), given.size());
    for (std::size_t i = 0; i < given.size(); ++i) {
        EXPECT_EQ(octaves[i].tau_s, given[i].tau_s);
        EXPECT_EQ(octaves[i].dev_deg_h, given[i].dev_deg_h);
    }
}

std::string complaint_at(const std::filesystem::path& path, const std::vector<std::int64_t>& factors) {
    try {
        (void)family_deviations(path, read_result(path), 0, oadev, factors);
    } catch (const InputError& error) {
        return error.what();
    }
    return "(accepted)";
}

TEST_F(ResultFile, FactorsThatRecordsDoNotHaveAreRefused) {
    write(path_, small(true));
    EXPECT_EQ(complaint_at(path_, {22}), "(accepted)");
    EXPECT_THAT(complaint_at(path_, {23}), HasSubstr("23"));
    EXPECT_THAT(complaint_at(path_, {0}), HasSubstr("0"));
    std::filesystem::remove(path_);
    write(path_, small(false));
    EXPECT_THAT(complaint_at(path_, {22}), AllOf(HasSubstr(path_.string()), HasSubstr("no angle records")));
}

}  // namespace
}  // namespace result_family_test
}  // namespace ringlock::study
