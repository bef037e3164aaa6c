// Studies whose arms are read by the scenario's reader, against the same gyros without one, against what is known of
// the reader, and against the records that it makes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include "analysis/instrument/simulate.hpp"
#include "analysis/study/summary.hpp"
#include "engine/core/units.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/read_arms.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock::study {
namespace read_studies_test {
namespace {

using scenario::Scenario;

/// Gyros without noise but that of the lock-in, read at 100 Hz by a reader without error.
Scenario read_at_100_hz(const std::vector<std::string>& arms) {
    Scenario s;
    s.ensemble.gyros = 16;
    s.ensemble.duration_s = 60.0;
    s.output.sample_interval_s = 0.1;
    s.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    s.arms = scenario::parse_arms(arms);
    s.reader.output_hz = 100.0;
    return s;
}

Study run_checked(const Scenario& s, int threads = 2, const OnSamples& on_samples = nullptr) {
    for (const scenario::Complaint& complaint : scenario::check(s)) ADD_FAILURE() << complaint.problem;
    return run(Study(s), threads, on_samples);
}

/// Mean of the logarithm of the gyros' random walks, and its standard error.
struct LogWalk {
    double mean;
    double error;
};
LogWalk log_walk(const ArmStatistics& arm) {
    const std::vector<double> walks = random_walks_deg_rt_h(arm);
    const auto n = static_cast<double>(walks.size());
    double mean = 0.0;
    double square = 0.0;
    for (const double walk : walks) mean += std::log(walk) / n;
    for (const double walk : walks) square += std::pow(std::log(walk) - mean, 2) / (n - 1.0);
    return {mean, std::sqrt(square / n)};
}

/// The two agree within four standard errors of their difference.
void expect_alike(const LogWalk& a, const LogWalk& b) {
    EXPECT_NEAR(a.mean, b.mean, 4.0 * std::hypot(a.error, b.error));
}

/// Every gyro's record of an arm.
class Records {
   public:
    Records(const Scenario& s, std::size_t arm) : arm_(arm), rows_(static_cast<std::size_t>(s.ensemble.gyros)) {}
    OnSamples sink() {
        return [this](const SampledAngles& samples) {
            if (samples.arm != arm_) return;
            const std::lock_guard lock(mutex_);
            const std::size_t length = samples.angle_arcsec.size() / samples.gyros;
            for (std::size_t i = 0; i < samples.gyros; ++i) {
                auto& row = rows_[static_cast<std::size_t>(samples.first_gyro) + i];
                const auto from = samples.angle_arcsec.begin() + static_cast<std::ptrdiff_t>(i * length);
                row.insert(row.end(), from, from + static_cast<std::ptrdiff_t>(length));
            }
        };
    }
    const std::vector<double>& of(std::size_t gyro) const { return rows_[gyro]; }

   private:
    std::size_t arm_;
    std::mutex mutex_;
    std::vector<std::vector<double>> rows_;
};

TEST(ReadStudies, AReaderWithoutErrorLeavesTheRandomWalk) {
    const Scenario read = read_at_100_hz({"noise_injected"});
    Scenario at_turns = read;
    at_turns.reader.output_hz = 0.0;
    const LogWalk through = log_walk(run_checked(read).arms.front());
    const Study plain = run_checked(at_turns);
    const LogWalk without = log_walk(plain.arms.front());
    expect_alike(through, without);
    expect_alike(through, {std::log(summarise(plain).theory.arw_deg_rt_h), 0.0});
}

// White noise of K/(4 sqrt(12)) on each output: its Allan variance is 3 Q^2/tau^2 at every tau of whole outputs.
TEST(ReadStudies, ACountIsWhiteAngleNoise) {
    Scenario s = read_at_100_hz({"noise_injected"});
    s.reader.fraction = reader::Fraction::none;
    s.output.sample_interval_s = 0.05;
    const Study study = run_checked(s);
    const Summary summary = summarise(study);
    const double q_arcsec = s.gyro.scale_factor_arcsec / (4.0 * std::sqrt(12.0));
    const double n_arcsec_rt_s = summary.theory.arw_deg_rt_h / units::deg_rt_h_per_arcsec_rt_s;
    for (std::size_t octave = 0; octave < 3; ++octave) {
        const EnsemblePoint& point = summary.arms.front().allan[octave];
        const double walk = n_arcsec_rt_s * n_arcsec_rt_s / point.tau_s;
        const double angle = (point.dev_deg_h * point.dev_deg_h - walk) * point.tau_s * point.tau_s / 3.0;
        const double share = point.dev_deg_h * point.dev_deg_h * point.tau_s * point.tau_s / 3.0 / angle;
        EXPECT_NEAR(std::sqrt(angle) / q_arcsec, 1.0, 4.0 * share / std::sqrt(2.0 * point.edf)) << point.tau_s;
    }
    double mean = 0.0;
    double square = 0.0;
    const auto& gyros = study.arms.front().gyros;
    for (const GyroStatistics& gyro : gyros) {
        ASSERT_TRUE(gyro.noise.quantization_arcsec.value.has_value());
        const double q = *gyro.noise.quantization_arcsec.value / q_arcsec;
        mean += q / static_cast<double>(gyros.size());
        square += q * q / static_cast<double>(gyros.size());
    }
    const double error = std::sqrt((square - mean * mean) / static_cast<double>(gyros.size() - 1));
    EXPECT_NEAR(mean, 1.0, 4.0 * error);
    EXPECT_LT(error, 0.02);
    expect_alike(log_walk(study.arms.front()), {std::log(summary.theory.arw_deg_rt_h), 0.0});
}

// Samples are 100 cycles of this dither apart, so that what a filter leaves of it is the same in all of them.
TEST(ReadStudies, FiltersLeaveARandomWalk) {
    constexpr double declared_deg_rt_h = 0.002;
    for (const auto stripping : {reader::Stripping::fir, reader::Stripping::notch, reader::Stripping::whole_cycle}) {
        Scenario s = read_at_100_hz({"ideal"});
        s.dither.frequency_hz = 125.0;
        s.ensemble.duration_s = 40.0;
        s.output.sample_interval_s = 0.8;
        s.effects["quantum_noise"]["deg_rt_h"] = declared_deg_rt_h;
        s.reader.latch_hz = 500.0;
        s.reader.stripping = stripping;
        s.reader.notch_bandwidth_hz = 10.0;
        const LogWalk walk = log_walk(run_checked(s).arms.front());
        EXPECT_NEAR(walk.mean, std::log(declared_deg_rt_h), 4.0 * walk.error) << static_cast<int>(stripping);
        EXPECT_LT(walk.error, 0.05);
    }
}

// The outputs of a study are those that `ringlock record` writes of the same gyro, the first one apart. Blocks of a
// study go through turns in other pieces than a record, to which tables and the compensator's learning are right to
// 1e-8 arcsec. A drive's noise makes gyros that are ahead of others wait for them.
TEST(ReadStudies, OutputsAreThoseOfARecord) {
    for (const auto stripping : {reader::Stripping::whole_cycle, reader::Stripping::reference_fir}) {
        Scenario s = read_at_100_hz({"ideal", "uncompensated", "noise_injected+compensated"});
        s.ensemble.gyros = 20;
        s.ensemble.duration_s = 4.0;
        s.ensemble.settle_s = 0.3;
        s.output.sample_interval_s = 0.01;
        s.effects["quantum_noise"]["deg_rt_h"] = 0.001;
        s.noise_injection.model = scenario::NoiseModel::drive;
        s.reader.latch_hz = 500.0;
        s.reader.stripping = stripping;
        s.reader.fraction = reader::Fraction::detectors;
        s.reader.reference_gain_error_relative = 0.01;
        s.reader.reference_learning_s = 0.1;
        Records records(s, 2);
        const Study study = run_checked(s, 2, records.sink());
        EXPECT_EQ(study.turns, ensemble::expected_turns(s, s.arms));
        for (const std::int64_t gyro : {0, 7, 18}) {
            Scenario one = s;
            one.record.kind = scenario::RecordKind::samples;
            one.record.rate_hz = 100.0;
            one.record.trajectory = s.arms[2];
            const auto recorded = instrument::simulate_record(one, gyro).samples->values;
            const std::vector<double>& angles = records.of(static_cast<std::size_t>(gyro));
            ASSERT_EQ(angles.size(), recorded.size() + 1);
            for (std::size_t i = 0; i < recorded.size(); ++i) {
                ASSERT_NEAR(angles[i + 1] - angles[i], recorded[i], 1e-6) << gyro << " " << i;
            }
        }
    }
}

// The mean rate of the record is compared with that of the input at the times that the outputs are of: the record
// begins after the warm-up, and its outputs are late. 16 ms would be 0.16 deg/h here, and the warm-up 0.4 deg/h.
TEST(ReadStudies, AProfileIsThatOfTheOutputs) {
    Scenario s = read_at_100_hz({"ideal"});
    s.ensemble.gyros = 2;
    s.ensemble.duration_s = 10.0;
    s.ensemble.settle_s = 1.0;
    s.input.profile_time_s = {0.0, 100.0};
    s.input.profile_rate_deg_h = {0.0, 1000.0};
    s.reader.latch_hz = 1000.0;
    s.reader.stripping = reader::Stripping::reference_fir;
    const Study study = run_checked(s);
    ASSERT_FALSE(study.arms.front().gyros.empty());
    for (const GyroStatistics& gyro : study.arms.front().gyros) EXPECT_NEAR(gyro.rate_error_deg_h, 0.0, 1e-4);
}

TEST(ReadStudies, AreTheSameOnAnyNumberOfThreads) {
    Scenario s = read_at_100_hz({"ideal", "noise_injected", "noise_injected+compensated"});
    s.ensemble.gyros = 24;
    s.ensemble.duration_s = 5.0;
    s.reader.fraction = reader::Fraction::detectors;
    s.reader.stripping = reader::Stripping::whole_cycle;
    s.reader.reference_noise_arcsec = 0.1;
    s.effects["missed_counts"]["probability_per_turn"] = 1e-3;
    const Study one = run_checked(s, 1);
    const Study several = run_checked(s, 3);
    for (std::size_t arm = 0; arm < s.arms.size(); ++arm) {
        for (std::size_t gyro = 0; gyro < 24; ++gyro) {
            const GyroStatistics& a = one.arms[arm].gyros[gyro];
            const GyroStatistics& b = several.arms[arm].gyros[gyro];
            EXPECT_EQ(a.rate_error_deg_h, b.rate_error_deg_h);
            EXPECT_EQ(a.noise.pooling.arw_best_deg_rt_h, b.noise.pooling.arw_best_deg_rt_h);
            ASSERT_EQ(a.allan.size(), b.allan.size());
            for (std::size_t i = 0; i < a.allan.size(); ++i) EXPECT_EQ(a.allan[i].dev, b.allan[i].dev);
        }
    }
}

// A reference that is 1 % off leaves 1.4 arcsec of the dither, by which the output of a gyro that stands still moves.
TEST(ReadStudies, ALockedGyroIsLockedInSpiteOfADitherThatIsLeft) {
    Scenario s = read_at_100_hz({"uncompensated"});
    s.ensemble.gyros = 4;
    s.ensemble.duration_s = 20.0;
    s.ensemble.dither_asymmetry_sd_ratio = 0.0;
    s.ensemble.dither_amplitude_sd_relative = 0.0;
    s.input.rate_deg_h = 1.0;
    s.input.sweep_stop_deg_h = 2.0;
    s.input.sweep_points = 2;
    s.reader.reference_gain_error_relative = 0.01;
    const Study study = run_checked(s);
    double largest_arcsec = 0.0;
    for (std::size_t gyro = 0; gyro < 4; ++gyro) {
        const double rate_deg_h = study.arms.front().gyros[gyro].rate_error_deg_h + s.input.rate_deg_h;
        largest_arcsec = std::max(largest_arcsec, std::abs(rate_deg_h) * s.ensemble.duration_s);
    }
    EXPECT_GT(largest_arcsec, s.gyro.scale_factor_arcsec);
    const auto summary = summarise(study);
    ASSERT_FALSE(summary.arms.front().sweep.empty());
    for (const SweepPoint& point : summary.arms.front().sweep) EXPECT_EQ(point.locked, 4);
}

// The answer of read-by-count.toml, for fewer gyros and half of the time.
TEST(ReadStudies, AnswerTheirScenario) {
    Scenario s = scenario::parse_file(std::filesystem::path(RINGLOCK_SOURCE_DIR) / "scenarios" / "read-by-count.toml");
    EXPECT_EQ(s.reader.stripping, reader::Stripping::whole_cycle);
    s.ensemble.gyros = 8;
    s.ensemble.duration_s = 60.0;
    const Study study = run_checked(s);
    const Summary summary = summarise(study);
    expect_alike(log_walk(study.arms[1]), {std::log(0.0022), 0.0});
    EXPECT_FALSE(summary.arms[0].arw_deg_rt_h.median);
    EXPECT_FALSE(summary.arms[2].arw_deg_rt_h.median);
    EXPECT_LT(summary.arms[2].arw_deg_rt_h.hi.value(), 3e-4);
    const auto deviation = [&](double tau_s) {
        const auto& points = summary.arms[0].allan;
        return std::find_if(points.begin(), points.end(), [&](const auto& p) { return p.tau_s == tau_s; })->dev_deg_h;
    };
    EXPECT_NEAR(deviation(1.0), 0.07, 0.005);
    EXPECT_NEAR(deviation(10.0), 0.005, 0.001);
}

}  // namespace
}  // namespace read_studies_test
}  // namespace ringlock::study
