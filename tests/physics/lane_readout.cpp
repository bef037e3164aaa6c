// Where the readout of blocks finds the phase to turn, against the scalar path near a turn.
#include "engine/readout/lane_readout.hpp"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "engine/core/error.hpp"
#include "tests/physics/readout_support.hpp"

namespace ringlock::test {
namespace lane_readout_test {
namespace {

using simd::lanes;

constexpr readout::Electronics ideal{true, true, 0.0, 0.0};

struct Worst {
    double phase_rad = 0.0;
    double lockin_rad = 0.0;
    double accel_ratio = 0.0;
};

Worst worst_against_path(double rate_deg_h, Beyond beyond, double threshold_deg_h, std::uint64_t seed) {
    Uniform uniform(seed);
    Worst worst;
    for (int block = 0; block < 20; ++block) {
        std::vector<Turn> turns;
        for (std::size_t i = 0; i < lanes; ++i) {
            turns.push_back(random_turn(uniform, (i % 2 == 0 ? 1.0 : -1.0) * rate_deg_h, beyond));
            turns.back().setup.lockin_threshold_deg_h = threshold_deg_h;
        }
        const int direction = block % 2 == 0 ? 1 : -1;
        const Read got = read(turns, block, ideal);
        for (std::size_t i = 0; i < lanes; ++i) {
            const TurnPath path = turns[i].path(direction);
            const double moved = path.zero_rate_phase_rad() - turns[i].phase_rad;
            worst.phase_rad = std::max(worst.phase_rad, std::abs(got.phase_rad(i) - path.zero_rate_phase_rad()));
            worst.lockin_rad =
                std::max(worst.lockin_rad, std::abs(got.lockin_rad(i) - (moved - path.plain_gain_rad())));
            for (const int side : {-1, 1}) {
                worst.accel_ratio =
                    std::max(worst.accel_ratio, std::abs(got.accel(i, side) / path.acceleration_rad_s2(side) - 1.0));
            }
        }
    }
    std::printf("%8.0f deg/h, threshold %4.0f: phase %.2g, lock-in's share %.2g rad, acceleration %.2g\n", rate_deg_h,
                threshold_deg_h, worst.phase_rad, worst.lockin_rad, worst.accel_ratio);
    return worst;
}

/// The series' last terms are in proportion to b; their derivatives are those of sin x, or of sin 2 x with a second
/// harmonic of the coupling, ten times in what they leave. At the highest threshold two Newton steps leave more than
/// the series in the lock-in's share, which is not stationary at the zero-rate point.
double path_tolerance_rad(Beyond beyond, double threshold_deg_h) {
    const double strength = std::max(threshold_deg_h, 30.0) / 300.0;
    const double first = 1e-10 * std::max(strength, 0.1) * (strength > 1.0 ? 10.0 : 1.0);
    return beyond == Beyond::second_coupling ? 15.0 * first : first;
}

void expect_agreement(Beyond beyond) {
    for (const double threshold_deg_h : {30.0, 300.0, 2000.0}) {
        for (const double rate_deg_h : {0.0, 100.0, 5000.0, 50000.0}) {
            const Worst worst = worst_against_path(rate_deg_h, beyond, threshold_deg_h, 501);
            const double tolerance_rad = path_tolerance_rad(beyond, threshold_deg_h);
            EXPECT_LT(worst.phase_rad, tolerance_rad);
            EXPECT_LT(worst.lockin_rad, tolerance_rad);
            EXPECT_LT(worst.accel_ratio, 1e-9);
        }
    }
}

TEST(LaneReadout, FindsTheZeroRatePoint) { expect_agreement(Beyond::nothing); }

TEST(LaneReadout, FindsItWithADithersHarmonicAndUnlikeTurns) { expect_agreement(Beyond::harmonic_and_asymmetry); }

TEST(LaneReadout, FindsItWithASecondHarmonicOfTheCoupling) { expect_agreement(Beyond::second_coupling); }

TEST(LaneReadout, RefusesATurnWithoutReversal) {
    std::vector<Turn> turns(3);
    for (Turn& turn : turns) turn.setup = paper_device();
    EXPECT_NO_THROW(read(turns, 0, ideal));
    // Twice the dither's peak rate, in one lane only.
    turns[1].setup.input_rate_deg_h = -2.0 * 109.1 * 3600.0;
    for (const std::int64_t number : {0, 1}) EXPECT_THROW(read(turns, number, ideal), RunError);
}

}  // namespace
}  // namespace lane_readout_test
}  // namespace ringlock::test
