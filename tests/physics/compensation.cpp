// What the compensators take away, and what they leave.
#include <cstdio>

#include "engine/compensate/first_order.hpp"
#include "engine/ensemble/trajectory.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace {

/// Standard deviations [rad] of the lock-in error gained over blocks of cycles, before and after compensation. The
/// error of the reading at the ends of a block, which does not add up, is left out.
struct Spread {
    double raw = 0.0;
    double compensated = 0.0;
};

template <class MakeCompensator>
Spread spread(const scenario::Scenario& scenario, int gyros, int blocks, int block, MakeCompensator make,
              double coupling_phase_rad = 0.0, double threshold_deg_h = 300.0) {
    Spread result;
    for (int g = 0; g < gyros; ++g) {
        gyro::Setup setup = paper_device();
        setup.input_rate_deg_h = 15.0;
        setup.initial_phase_rad = 0.4 * g;
        setup.coupling_phase_rad = coupling_phase_rad;
        setup.lockin_threshold_deg_h = threshold_deg_h;
        const gyro::Device device(setup);
        ensemble::Trajectory trajectory(scenario, setup, {7, static_cast<std::uint64_t>(g)},
                                        ensemble::Trajectory::Kind::noise_injected);
        auto compensator = make(compensate::Calibration{device.coupling.b_rad_s});
        std::vector<double> raw;
        std::vector<double> left;
        for (int turn = 0; turn <= 2 * block * blocks; ++turn) {
            const auto read = trajectory.read();
            compensator.observe(read.reading);
            if (turn % (2 * block) == 0) {
                raw.push_back(trajectory.lockin_error_rad());
                left.push_back(raw.back() - compensator.error_rad());
            }
            trajectory.advance();
        }
        const auto add = [&](double& sum, const std::vector<double>& x) {
            const double mean = (x.back() - x.front()) / blocks;
            for (int i = 0; i < blocks; ++i) {
                const double d = x[static_cast<std::size_t>(i) + 1] - x[static_cast<std::size_t>(i)] - mean;
                sum += d * d / ((blocks - 1) * gyros);
            }
        };
        add(result.raw, raw);
        add(result.compensated, left);
    }
    return {std::sqrt(result.raw), std::sqrt(result.compensated)};
}

scenario::Scenario base() {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = scenario::ReadoutModel::ideal;
    return scenario;
}

TEST(Compensation, CorrectedCoefficientsTakeTheErrorAwayAndPrintedOnesTurnItRound) {
    const auto scenario = base();
    const auto corrected = spread(scenario, 8, 60, 50, [](auto c) { return compensate::Corrected(c); });
    const auto published = spread(scenario, 8, 60, 50, [](auto c) { return compensate::Published(c); });
    EXPECT_GT(corrected.raw / corrected.compensated, 95.0);
    EXPECT_NEAR(published.compensated / published.raw, 1.0, 0.02);
    // Printed: error minus twice the error. The two residuals add up to what the corrected one leaves, twice.
    EXPECT_EQ(published.raw, corrected.raw);
}

TEST(Compensation, WithAnIdealReadoutTheCorrectionLeavesThirdOrderOnly) {
    // The kick of a whole turn, in the phase at its extremum, has no second order (docs/physics.md): the gain goes with
    // kappa^-2. A second order of the kick, (kappa^2/16) cos 2 psi_0 a turn, would hold it at 16/kappa = 105 and make
    // it go with 1/kappa.
    // At small thresholds the averaged acceleration takes over: it misses what the injected noise does to each swing.
    const auto make = [](auto c) { return compensate::Corrected(c); };
    const auto once = spread(base(), 8, 60, 500, make);
    const auto twice = spread(base(), 8, 60, 500, make, 0.0, 600.0);
    const double gain = once.raw / once.compensated;
    std::printf("gain %.0f, at twice the threshold %.0f\n", gain, twice.raw / twice.compensated);
    EXPECT_GT(gain, 1000.0);
    EXPECT_NEAR(gain / (twice.raw / twice.compensated), 4.0, 0.6);
}

TEST(Compensation, DetectorNoiseLeavesItsOwnShare) {
    // Noise of s rad in the turn's phase leaves s of the error (the derivative of the kick has the kick's rms).
    auto scenario = base();
    scenario.readout.model = scenario::ReadoutModel::instrument;
    for (const double noise : {0.005, 0.02}) {
        scenario.readout.detector_noise_relative = noise;
        const auto corrected = spread(scenario, 8, 60, 50, [](auto c) { return compensate::Corrected(c); });
        EXPECT_NEAR(corrected.compensated / corrected.raw, noise, 0.2 * noise);
    }
}

TEST(Compensation, AThresholdThatIsWrongLeavesItsError) {
    const auto scenario = base();
    for (const double wrong : {0.9, 1.05}) {
        const auto corrected = spread(scenario, 6, 60, 50, [wrong](compensate::Calibration c) {
            c.b_rad_s *= wrong;
            return compensate::Corrected(c);
        });
        EXPECT_NEAR(corrected.compensated / corrected.raw, std::abs(wrong - 1.0), 0.03 * std::abs(wrong - 1.0) + 1e-3);
    }
}

TEST(Compensation, ACouplingPhaseThatIsNotToldLeavesTwiceTheSineOfItsHalf) {
    const double phase = 10.0 * units::pi / 180.0;
    const auto corrected = spread(
        base(), 8, 400, 25, [](auto c) { return compensate::Corrected(c); }, phase);
    const double expected = 2.0 * std::sin(0.5 * phase);  // 0.174
    // Two independent sums of 3200 increments each.
    EXPECT_NEAR(corrected.compensated / corrected.raw, expected, 4.0 * expected / std::sqrt(3200.0));
}

}  // namespace
}  // namespace ringlock::test
