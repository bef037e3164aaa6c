// The compensator that learns its coupling, and the instrument's other properties against what they must leave.
#include "engine/compensate/adaptive.hpp"

#include <cmath>
#include <cstdio>
#include <vector>

#include "engine/ensemble/block.hpp"
#include "engine/ensemble/calibration.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace adaptive_test {
namespace {

using simd::lanes;

scenario::Scenario instrument() {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = scenario::ReadoutModel::instrument;
    scenario.readout.phase_from = scenario::PhaseFrom::detectors;  // readings as sampled
    scenario.ensemble.gyros = lanes;
    scenario.ensemble.seed = 701;
    return scenario;
}

/// Told a threshold that is wrong by a factor.
compensate::Adaptive make_adaptive(scenario::Scenario scenario, const std::vector<gyro::Setup>& setups, double factor) {
    scenario.calibration.threshold_error_relative = factor - 1.0;
    const std::vector<gyro::Device> devices(setups.begin(), setups.end());
    const auto calibration = ensemble::calibration_of(scenario, devices, true);
    return {calibration, ensemble::electronics_of(scenario), 1e-10};
}

struct Learnt {
    double rms = 0.0;   ///< distance of the learnt coupling from the true one over the true one, rms over the gyros
    double mean = 0.0;  ///< of its part in phase
};

Learnt learn(const scenario::Scenario& scenario, double factor, double phase_rad, int turns) {
    scenario::Scenario with_phase = scenario;
    with_phase.effects["detector_phase_offset"]["phase_rad"] = phase_rad;
    const std::vector<scenario::Arm> arms{scenario::parse_arm("noise_injected+compensated")};
    ensemble::GyroBlock block(with_phase, arms, 0, lanes);
    compensate::Adaptive adaptive = make_adaptive(scenario, block.setups(), factor);
    compensate::LaneErrors errors;
    for (int done = 0; done < turns; done += 128) {
        block.advance(128);
        adaptive.observe(block.readings(0), errors);
    }
    Learnt learnt;
    for (std::size_t g = 0; g < lanes; ++g) {
        const double b = gyro::Device(block.setups()[g]).coupling.b_rad_s;
        const auto coupling = adaptive.coupling(g);
        const double x = coupling.b_rad_s / b * std::cos(coupling.phase_rad - phase_rad) - 1.0;
        const double y = coupling.b_rad_s / b * std::sin(coupling.phase_rad - phase_rad);
        learnt.rms += (x * x + y * y) / lanes;
        learnt.mean += x / lanes;
    }
    learnt.rms = std::sqrt(learnt.rms);
    std::printf("told %.1f of the threshold and a phase off by %.1f rad, %d turns: off by %.2g rms, mean %.1g\n",
                factor, phase_rad, turns, learnt.rms, learnt.mean);
    return learnt;
}

TEST(Adaptive, LearnsThresholdAndCouplingPhase) {
    // A tenth of the coupling is seen at every turn; 1.5 stands for the forecast's share of the noise.
    for (const double factor : {0.7, 1.0, 1.3}) {
        EXPECT_LT(learn(instrument(), factor, 0.0, 16384).rms, 1.5 * 0.1 * std::sqrt(2.0 / 16384.0) * 1.5) << factor;
    }
    EXPECT_LT(learn(instrument(), 1.0, 0.5, 16384).rms, 1.5 * 0.1 * std::sqrt(2.0 / 16384.0) * 1.5);
    EXPECT_LT(learn(instrument(), 0.7, -2.5, 16384).rms, 1.5 * 0.1 * std::sqrt(2.0 / 16384.0) * 1.5);
}

/// Gyros whose coupling phase steps, as by a mode hop: first the readings of one block, then those of another.
void step_of_the_phase(double step_rad, int before, int after) {
    const std::vector<scenario::Arm> arms{scenario::parse_arm("noise_injected+compensated")};
    scenario::Scenario stepped = instrument();
    stepped.effects["detector_phase_offset"]["phase_rad"] = step_rad;
    ensemble::GyroBlock first(instrument(), arms, 0, lanes);
    ensemble::GyroBlock then(stepped, arms, 0, lanes);
    compensate::Adaptive adaptive = make_adaptive(instrument(), first.setups(), 1.0);
    compensate::LaneErrors errors;
    for (int done = 0; done < before + after; done += 128) {
        first.advance(128);
        then.advance(128);
        adaptive.observe((done < before ? first : then).readings(0), errors);
        if (done + 128 == before) {
            for (std::size_t g = 0; g < lanes; ++g) EXPECT_EQ(adaptive.restarts(g), 0) << g;
        }
    }
    double square = 0.0;
    for (std::size_t g = 0; g < lanes; ++g) {
        EXPECT_EQ(adaptive.restarts(g), 1) << g;
        square += std::pow(adaptive.coupling(g).phase_rad - step_rad, 2) / lanes;
    }
    std::printf("stepped by %.2f rad, %d turns later off by %.2g rms\n", step_rad, after, std::sqrt(square));
    // A tenth a turn, since the step was noticed: 16 gyros tell an rms to 18 %.
    EXPECT_LT(std::sqrt(square), 1.5 * 0.1 / std::sqrt(0.75 * after));
}

TEST(Adaptive, BeginsTheCouplingPhaseAnewWhereItSteps) { step_of_the_phase(-0.1, 81920, 8192); }

TEST(LongAdaptive, BeginsTheCouplingPhaseAnewWhereItSteps) {
    step_of_the_phase(0.02, 524288, 32768);
    step_of_the_phase(-2.0, 262144, 16384);
}

TEST(Adaptive, HowReadingsAreCutIntoPiecesDoesNotMatter) {
    const scenario::Scenario scenario = instrument();
    const std::vector<scenario::Arm> arms{scenario::parse_arm("noise_injected+compensated")};
    const auto run = [&](const std::vector<std::size_t>& pieces) {
        ensemble::GyroBlock block(scenario, arms, 0, lanes);
        compensate::Adaptive adaptive = make_adaptive(scenario, block.setups(), 0.9);
        compensate::LaneErrors errors;
        std::size_t done = 0;
        for (std::size_t i = 0; done < 3000; ++i) {
            const std::size_t turns = std::min(done == 0 ? 128 : pieces[i % pieces.size()], 3000 - done);
            block.advance(turns);
            adaptive.observe(block.readings(0), errors);
            done += turns;
        }
        std::vector<double> last;
        for (std::size_t g = 0; g < lanes; ++g) {
            last.push_back(errors.whole[g] + errors.fringes.back()[g]);
            last.push_back(adaptive.coupling(g).b_rad_s);
        }
        return last;
    };
    // The readings themselves are rounded against the whole fringes at the beginning of a piece.
    const std::vector<double> even = run({128});
    const std::vector<double> uneven = run({100, 1, 77, 300});
    for (std::size_t i = 0; i < even.size(); ++i) EXPECT_NEAR(uneven[i], even[i], 1e-11 * std::max(1.0, even[i]));
}

}  // namespace
}  // namespace adaptive_test
}  // namespace ringlock::test
