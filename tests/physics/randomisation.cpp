// What injected noise does to the lock-in error: statistics over ensembles, with an ideal readout.
#include <cstdio>

#include "analysis/study/study.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/ensemble/schedule.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace randomisation_test {
namespace {

struct Outcome {
    double arw_over_theory;  ///< from increments over 1 s
    double bias_deg_h;
    double spread_deg_h;  ///< standard error of the bias
};

Outcome injected(double rms_rad, double rate_deg_h, std::int64_t gyros, double duration_s) {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = scenario::ReadoutModel::ideal;
    scenario.noise_injection.turn_phase_rms_rad = rms_rad;
    scenario.input.rate_deg_h = rate_deg_h;
    scenario.ensemble.gyros = gyros;
    scenario.ensemble.duration_s = duration_s;
    scenario.ensemble.dither_amplitude_sd_relative = 0.0;
    scenario.ensemble.dither_asymmetry_sd_ratio = 0.0;
    scenario.arms = scenario::parse_arms({"noise_injected"});
    const ensemble::Schedule schedule(scenario);
    std::vector<double> rate(static_cast<std::size_t>(gyros));
    std::vector<double> variance(rate.size());
    std::vector<std::vector<double>> angle(rate.size());  // one slot a gyro: blocks write beside each other
    const auto on_samples = [&](const study::SampledAngles& block) {
        const std::size_t samples = block.angle_arcsec.size() / block.gyros;
        for (std::size_t g = 0; g < block.gyros; ++g) {
            auto& all = angle[static_cast<std::size_t>(block.first_gyro) + g];
            all.insert(all.end(), block.angle_arcsec.begin() + static_cast<std::ptrdiff_t>(g * samples),
                       block.angle_arcsec.begin() + static_cast<std::ptrdiff_t>((g + 1) * samples));
        }
    };
    study::run(study::Study(scenario), 2, on_samples);
    for (std::size_t g = 0; g < angle.size(); ++g) {
        const auto& x = angle[g];
        const auto n = static_cast<double>(x.size() - 1);
        const double mean = (x.back() - x.front()) / n;
        double sum = 0.0;
        for (std::size_t i = 1; i < x.size(); ++i) sum += std::pow(x[i] - x[i - 1] - mean, 2);
        rate[g] = mean / schedule.sample_interval_s - rate_deg_h;
        variance[g] = sum / (n - 1.0) / schedule.sample_interval_s;
    }
    Outcome outcome{0.0, 0.0, 0.0};
    const auto count = static_cast<double>(gyros);
    for (std::size_t i = 0; i < rate.size(); ++i) {
        outcome.bias_deg_h += rate[i] / count;
        outcome.arw_over_theory += variance[i] / count;
    }
    for (const double r : rate) outcome.spread_deg_h += std::pow(r - outcome.bias_deg_h, 2);
    outcome.spread_deg_h = std::sqrt(outcome.spread_deg_h / (count * (count - 1.0)));
    outcome.arw_over_theory = std::sqrt(outcome.arw_over_theory) * units::deg_rt_h_per_arcsec_rt_s /
                              gyro::angle_random_walk_deg_rt_h(paper_device());
    std::printf("%.1f rad: ARW %.4f +- %.4f of theory, bias %.4f +- %.4f deg/h\n", rms_rad, outcome.arw_over_theory,
                outcome.arw_over_theory / std::sqrt(2.0 * count * duration_s), outcome.bias_deg_h,
                outcome.spread_deg_h);
    return outcome;
}

TEST(Randomisation, TheoryOfThePapersDevice) {
    EXPECT_NEAR(gyro::angle_random_walk_deg_rt_h(paper_device()), 0.0022506, 5e-8);
    EXPECT_NEAR(gyro::turn_kick_rad(paper_device()), 0.152, 1e-4);
}

TEST(Randomisation, FullRandomisationReachesTheTheoreticalRandomWalkWithoutBias) {
    const Outcome outcome = injected(3.0, 1.0, 64, 100.0);
    EXPECT_NEAR(outcome.arw_over_theory, 0.995, 0.02);  // 6400 increments: 0.9 %
    EXPECT_NEAR(outcome.bias_deg_h, 0.0, 4.0 * outcome.spread_deg_h);
    EXPECT_LT(outcome.spread_deg_h, 0.003);
}

TEST(LongRandomisation, ThreeRadiansAndFourReachTheory) {
    // The kick of the exact map is kappa (1 - kappa^2/16): 0.07 % less random walk. 76 800 increments: 0.26 %.
    EXPECT_NEAR(injected(4.0, 1.0, 128, 600.0).arw_over_theory, 0.9993, 0.008);
    EXPECT_NEAR(injected(3.0, 1.0, 128, 600.0).arw_over_theory, 0.9993, 0.008);
}

TEST(Randomisation, LessNoiseLeavesCorrelationAndBias) {
    const Outcome weaker = injected(2.1, 1.0, 64, 100.0);
    EXPECT_GT(weaker.arw_over_theory, 1.03);
    EXPECT_LT(weaker.arw_over_theory, 1.10);
    EXPECT_NEAR(weaker.bias_deg_h, -0.04, 0.01);
    const Outcome half = injected(1.5, 1.0, 64, 100.0);
    EXPECT_GT(half.arw_over_theory, 1.57);
    EXPECT_LT(half.arw_over_theory, 1.78);
    EXPECT_NEAR(half.bias_deg_h, -0.44, 0.03);
}

TEST(Randomisation, LittleNoiseLeavesTheGyroLocked) {
    const Outcome outcome = injected(0.3, 1.0, 8, 100.0);
    EXPECT_NEAR(outcome.bias_deg_h, -1.0, 0.01);
}

TEST(Randomisation, IncrementsOverSinglePeriodsReadTooLow) {
    // Read in the middle of a kick, a period holds half a kick, a whole one and half a kick: variance 3/4 of two.
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = scenario::ReadoutModel::ideal;
    double single = 0.0;
    double many = 0.0;
    constexpr std::size_t block = 100;
    constexpr int blocks = 400;
    gyro::Setup setup = paper_device();
    setup.input_rate_deg_h = 15.0;
    const std::vector<scenario::Arm> arms{scenario::parse_arm("noise_injected")};
    ensemble::GyroBlock gyros(scenario, arms, 0, std::vector<gyro::Setup>(8, setup));
    std::vector<double> last(8);
    std::vector<double> last_block(8);
    for (int piece = 0; piece < blocks; ++piece) {
        gyros.advance(2 * block);
        for (std::size_t g = 0; g < last.size(); ++g) {
            for (std::size_t period = 0; period < block; ++period) {
                const double error = gyros.lockin_error_rad(0, 2 * period, g);
                const bool first = piece == 0 && period == 0;
                if (!first) single += std::pow(error - last[g], 2);
                if (!first && period == 0) many += std::pow(error - last_block[g], 2);
                if (period == 0) last_block[g] = error;
                last[g] = error;
            }
        }
    }
    EXPECT_NEAR(std::sqrt(single / many), std::sqrt(0.75), 0.03);
}

}  // namespace
}  // namespace randomisation_test
}  // namespace ringlock::test
