// What the compensators take away, and what they leave.
#include <cstdio>
#include <memory>
#include <vector>

#include "engine/compensate/exact.hpp"
#include "engine/compensate/first_order.hpp"
#include "engine/dither/lane_dither.hpp"
#include "engine/ensemble/block.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/drive.hpp"

namespace ringlock::test {
namespace compensation_test {
namespace {

/// Standard deviations [rad] of the lock-in error gained over blocks of cycles, before and after compensation. The
/// error of the reading at the ends of a block, which does not add up, is left out.
struct Spread {
    double raw = 0.0;
    double compensated = 0.0;
};

using Make = std::function<std::unique_ptr<compensate::LaneCompensator>(const compensate::Calibration&)>;

compensate::Calibration calibration_of(const std::vector<gyro::Setup>& setups, double noise_rms_rad) {
    compensate::Calibration calibration;
    calibration.lanes = setups.size();
    calibration.amplitude_margin_rad = Drive::amplitude_margin_rad(noise_rms_rad);
    for (std::size_t g = 0; g < setups.size(); ++g) {
        const gyro::Device device(setups[g]);
        calibration.b_rad_s[g] = device.coupling.b_rad_s;
        calibration.dither_amplitude_rad[g] = device.dither_amplitude_rad;
        calibration.positive_duration_s[g] = device.positive_duration_s;
        calibration.negative_duration_s[g] = device.negative_duration_s;
    }
    return calibration;
}

Spread spread(const scenario::Scenario& scenario, std::size_t gyros, int blocks, int block, const Make& make,
              double coupling_phase_rad = 0.0, double threshold_deg_h = 300.0) {
    std::vector<gyro::Setup> setups;
    for (std::size_t g = 0; g < gyros; ++g) {
        gyro::Setup setup = paper_device();
        setup.input_rate_deg_h = 15.0;
        setup.initial_phase_rad = 0.4 * static_cast<double>(g);
        setup.coupling_phase_rad = coupling_phase_rad;
        setup.lockin_threshold_deg_h = threshold_deg_h;
        setups.push_back(setup);
    }
    // An arm with a compensator is read at every turn; the one under test is beside it.
    const std::vector<scenario::Arm> arms{scenario::parse_arm("noise_injected+compensated")};
    ensemble::GyroBlock gyro_block(scenario, arms, 0, setups);
    const auto compensator = make(calibration_of(setups, scenario.noise_injection.turn_phase_rms_rad));
    compensate::LaneErrors found;
    std::vector<std::vector<double>> raw(gyros);
    std::vector<std::vector<double>> left(gyros);
    const std::int64_t turns = 2LL * block * blocks + 1;
    constexpr std::int64_t piece = 100;
    for (std::int64_t first = 0; first < turns; first += piece) {
        const auto count = static_cast<std::size_t>(std::min(piece, turns - first));
        gyro_block.advance(count);
        compensator->observe(gyro_block.readings(0), found);
        for (std::size_t i = 0; i < count; ++i) {
            if ((first + static_cast<std::int64_t>(i)) % (2 * block) != 0) continue;
            for (std::size_t g = 0; g < gyros; ++g) {
                raw[g].push_back(gyro_block.lockin_error_rad(0, i, g));
                left[g].push_back(raw[g].back() - units::two_pi * (found.whole[g] + found.fringes[i][g]));
            }
        }
    }
    Spread result;
    const auto add = [&](double& sum, const std::vector<double>& x) {
        const double mean = (x.back() - x.front()) / blocks;
        for (int i = 0; i < blocks; ++i) {
            const double d = x[static_cast<std::size_t>(i) + 1] - x[static_cast<std::size_t>(i)] - mean;
            sum += d * d / ((blocks - 1) * static_cast<double>(gyros));
        }
    };
    for (std::size_t g = 0; g < gyros; ++g) {
        add(result.raw, raw[g]);
        add(result.compensated, left[g]);
    }
    return {std::sqrt(result.raw), std::sqrt(result.compensated)};
}

std::unique_ptr<compensate::LaneCompensator> corrected_of(const compensate::Calibration& calibration) {
    return std::make_unique<compensate::FirstOrder>(calibration, compensate::FirstOrder::corrected);
}

std::unique_ptr<compensate::LaneCompensator> published_of(const compensate::Calibration& calibration) {
    return std::make_unique<compensate::FirstOrder>(calibration, compensate::FirstOrder::published);
}

scenario::Scenario base() {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = scenario::ReadoutModel::ideal;
    return scenario;
}

TEST(Compensation, CorrectedCoefficientsTakeTheErrorAwayAndPrintedOnesTurnItRound) {
    const auto scenario = base();
    const auto corrected = spread(scenario, 8, 60, 50, corrected_of);
    const auto published = spread(scenario, 8, 60, 50, published_of);
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
    const auto make = corrected_of;
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
    scenario.readout.model = scenario::ReadoutModel::latched;
    for (const double noise : {0.005, 0.02}) {
        scenario.readout.detector_noise_relative = noise;
        const auto corrected = spread(scenario, 8, 60, 50, corrected_of);
        EXPECT_NEAR(corrected.compensated / corrected.raw, noise, 0.2 * noise);
    }
}

TEST(Compensation, AThresholdThatIsWrongLeavesItsError) {
    const auto scenario = base();
    for (const double wrong : {0.9, 1.05}) {
        const auto corrected = spread(scenario, 6, 60, 50, [wrong](compensate::Calibration c) {
            for (double& b : c.b_rad_s) b *= wrong;
            return corrected_of(c);
        });
        EXPECT_NEAR(corrected.compensated / corrected.raw, std::abs(wrong - 1.0), 0.03 * std::abs(wrong - 1.0) + 1e-3);
    }
}

TEST(Compensation, ACouplingPhaseThatIsNotToldLeavesTwiceTheSineOfItsHalf) {
    const double phase = 10.0 * units::pi / 180.0;
    const auto corrected = spread(base(), 8, 400, 25, corrected_of, phase);
    const double expected = 2.0 * std::sin(0.5 * phase);  // 0.174
    // Two independent sums of 3200 increments each.
    EXPECT_NEAR(corrected.compensated / corrected.raw, expected, 4.0 * expected / std::sqrt(3200.0));
}

TEST(Compensation, TheInvertedTurnMapLeavesNothing) {
    // What is left is the phase at the turns that lie after the dither's: the half cycle under way is taken to have the
    // mean amplitude, which injected noise changes by 5e-4; some 1e-8 rad a turn, of a kick's 0.1, and 1e-6 rad at the
    // ends of a block, which do not add up: long blocks.
    const auto exact_of = [](const compensate::Calibration& calibration) {
        return std::make_unique<compensate::Exact>(calibration, 1e-10);
    };
    const auto exact = spread(base(), 8, 40, 2000, exact_of);
    std::printf("gain %.3g\n", exact.raw / exact.compensated);
    EXPECT_GT(exact.raw / exact.compensated, 1e6);
}

}  // namespace
}  // namespace compensation_test
}  // namespace ringlock::test
