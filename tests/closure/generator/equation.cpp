// The generator's integration against closed forms of the equation of motion (docs/physics.md).
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "engine/core/error.hpp"
#include "tests/closure/generator/fringes.hpp"
#include "tests/closure/generator/generator.hpp"

namespace generator_equation_test {
namespace {

using namespace ringlock::test::closure;

constexpr double pi = std::numbers::pi;

/// The paper's device, in phase units.
constexpr double w = 783.4;
constexpr double phase_per_arcsec = 2.0 * pi / 0.5;
const double swing_rad = phase_per_arcsec * 109.1 * 3600.0 / w;
const double acceleration = swing_rad * w * w;

Lanes same(double x) {
    Lanes values;
    values.fill(x);
    return values;
}
Lanes around() {
    Lanes values;
    for (std::size_t i = 0; i < lanes; ++i) values[i] = 2.0 * pi * static_cast<double>(i) / lanes;
    return values;
}
LaneHalf paper_half(double threshold_deg_h, double rate_deg_h = 0.0) {
    return {same(swing_rad), same(pi / w), same(phase_per_arcsec * rate_deg_h),
            same(phase_per_arcsec * threshold_deg_h)};
}
LaneDevice plain_device() { return {}; }

TEST(ClosureEquation, WithoutDitherTurnsWithAdlersPeriod) {
    // One fringe takes 2 pi/sqrt(R^2 - b^2), whatever the phase it begins at.
    const double rate = 2.0e3;
    const double b = 1.2e3;
    const double fringes = 40.0;
    const LaneHalf half{same(0.0), same(fringes * 2.0 * pi / std::sqrt(rate * rate - b * b)), same(rate), same(b)};
    Lanes delta;
    // Steps of the same phase advance throughout: 1e-10 rad asks for short ones where b is 0.6 of the rate
    integrate_half(plain_device(), half, 1.0, around(), {0.5, 0.6}, delta);
    for (std::size_t i = 0; i < lanes; ++i) {
        EXPECT_NEAR(delta[i] + rate * half.duration_s[i], fringes * 2.0 * pi, 1e-9) << i;
    }
}

TEST(ClosureEquation, WithoutDitherStandsStillInsideTheLockBand) {
    const double rate = 1.0e3;
    const double b = 1.25e3;
    const LaneHalf half{same(0.0), same(0.1), same(rate), same(b)};  // 75 times the 1/sqrt(b^2 - R^2) it takes
    Lanes delta;
    integrate_half(plain_device(), half, 1.0, around(), {0.5, 0.6}, delta);
    for (std::size_t i = 0; i < lanes; ++i) {
        const double psi = around()[i] + rate * 0.1 + delta[i];
        EXPECT_NEAR(std::sin(psi), -rate / b, 1e-9) << i;
        EXPECT_LT(std::cos(psi), 0.0) << "where a disturbance dies out";
    }
}

/// Kicks of a half cycle from a minimum to a maximum, n-th harmonic of ratio 1 and phase f, to first order: half a
/// whole turn's at either end, kappa/sqrt(n) sin(n psi + f +- pi/4).
double first_order(double b, double n, double f, double psi_0) {
    const double kappa = b * std::sqrt(2.0 * pi / (n * acceleration));
    return 0.5 * kappa *
           (std::sin(n * psi_0 + f + 0.25 * pi) + std::sin(n * (psi_0 + 2.0 * swing_rad) + f - 0.25 * pi));
}

TEST(ClosureEquation, ATurnKicksByFirstOrdersFormula) {
    Lanes delta;
    const LaneHalf half = paper_half(1.0);
    integrate_half(plain_device(), half, 1.0, around(), {}, delta);
    const double kappa = half.b_rad_s[0] * std::sqrt(2.0 * pi / acceleration);
    for (std::size_t i = 0; i < lanes; ++i) {
        // Left out: second order, kappa^2, and the sinusoid's departure from its parabola, some 1/(8 swing).
        EXPECT_NEAR(delta[i], first_order(half.b_rad_s[0], 1.0, 0.0, around()[i]), 3.0 * kappa * kappa + 1e-4 * kappa);
    }
}

TEST(ClosureEquation, HarmonicsOfTheCouplingKickByTheirOwn) {
    const LaneHalf half = paper_half(1.0);
    const double kappa = half.b_rad_s[0] * std::sqrt(2.0 * pi / acceleration);
    Lanes without, with;
    integrate_half(plain_device(), half, 1.0, around(), {}, without);
    LaneDevice second;
    second.extras = true;
    second.second_ratio = same(0.3);
    second.second_phase_rad = same(0.7);
    integrate_half(second, half, 1.0, around(), {}, with);
    for (std::size_t i = 0; i < lanes; ++i) {
        EXPECT_NEAR(with[i] - without[i], 0.3 * first_order(half.b_rad_s[0], 2.0, 0.7, around()[i]),
                    3.0 * kappa * kappa + 1e-4 * kappa);
    }
    LaneDevice third;
    third.extras = true;
    third.third_ratio = same(0.2);
    third.third_phase_rad = same(-1.1);
    integrate_half(third, half, 1.0, around(), {}, with);
    for (std::size_t i = 0; i < lanes; ++i) {
        EXPECT_NEAR(with[i] - without[i], 0.2 * first_order(half.b_rad_s[0], 3.0, -1.1, around()[i]),
                    3.0 * kappa * kappa + 1e-4 * kappa);
    }
}

TEST(ClosureEquation, TurnAsymmetryIsStrongerAtMinimaThanAtMaxima) {
    const LaneHalf half = paper_half(1.0);
    const double b = half.b_rad_s[0];
    const double kappa = b * std::sqrt(2.0 * pi / acceleration);
    LaneDevice device;
    device.extras = true;
    device.turn_asymmetry = same(0.4);
    Lanes delta;
    for (const double s : {1.0, -1.0}) {
        integrate_half(device, half, s, around(), {}, delta);
        for (std::size_t i = 0; i < lanes; ++i) {
            const double at_start = std::sin(around()[i] + s * 0.25 * pi);
            const double at_end = std::sin(around()[i] + 2.0 * s * swing_rad - s * 0.25 * pi);
            EXPECT_NEAR(delta[i], 0.5 * kappa * ((1.0 + s * 0.4) * at_start + (1.0 - s * 0.4) * at_end),
                        3.0 * kappa * kappa + 1e-4 * kappa);
        }
    }
}

TEST(ClosureEquation, IsOfTenthOrder) {
    const LaneHalf half = paper_half(300.0, 1000.0);
    LaneDevice harmonics;
    harmonics.extras = true;
    harmonics.second_ratio = same(0.05);
    harmonics.third_ratio = same(0.03);
    harmonics.turn_asymmetry = same(0.1);
    harmonics.dither_ratio = same(0.01);
    harmonics.dither_third_ratio = same(0.02);
    for (const LaneDevice& device : {plain_device(), harmonics}) {
        Lanes exact, coarse, fine, usual;
        integrate_half(device, half, 1.0, around(), {0.5, 0.15}, exact);
        integrate_half(device, half, 1.0, around(), {5.0, 1.5}, coarse);
        integrate_half(device, half, 1.0, around(), {2.5, 0.75}, fine);
        integrate_half(device, half, 1.0, around(), {}, usual);
        double worst_coarse = 0.0, worst_fine = 0.0;
        for (std::size_t i = 0; i < lanes; ++i) {
            worst_coarse = std::max(worst_coarse, std::abs(coarse[i] - exact[i]));
            worst_fine = std::max(worst_fine, std::abs(fine[i] - exact[i]));
            EXPECT_NEAR(usual[i], exact[i], 1e-8) << "a tenth of what is promised of a half cycle";
        }
        // 2^10 for half the steps; the coarse ones are not yet where the first term of the error alone counts
        EXPECT_GT(worst_coarse / worst_fine, 256.0);
    }
}

TEST(ClosureEquation, TurnsBackToWhereItCameFrom) {
    // The equation run backwards: -psi(T - t) obeys it with the opposite rate, from the end's phase.
    Lanes forth, back, start;
    integrate_half(plain_device(), paper_half(300.0, 500.0), 1.0, around(), {}, forth);
    for (std::size_t i = 0; i < lanes; ++i) {
        const double end = around()[i] + 2.0 * swing_rad + phase_per_arcsec * 500.0 * pi / w + forth[i];
        start[i] = std::remainder(-end - pi, 2.0 * pi) + pi;
    }
    // -psi' (T - t): phase chi = -psi has chi' = psi'(T - t) = g + b sin psi = g - b sin chi
    LaneHalf half = paper_half(300.0, 500.0);
    half.b_rad_s = same(-half.b_rad_s[0]);
    integrate_half(plain_device(), half, 1.0, start, {}, back);
    for (std::size_t i = 0; i < lanes; ++i) EXPECT_NEAR(back[i], forth[i], 1e-8);
}

TEST(ClosureEquation, FindsTheExtremumWithoutLockInWhereTheSineSaysSo) {
    const double rate =
        20000.0;  // deg/h: the zero-rate point is 65 us and some eight radians away from the dither's turn
    const LaneHalf half = paper_half(0.0, rate);
    const double asin = std::asin(phase_per_arcsec * rate / (swing_rad * w));
    const Lanes start = same(1.0);
    LaneExtremum at;
    for (const double s : {1.0, -1.0}) {
        find_extremum(plain_device(), half, half, s, start, {}, at);
        const double u = -s * asin / w;
        const double phase = phase_per_arcsec * rate * u + s * swing_rad * (1.0 - std::cos(w * u));
        EXPECT_NEAR(at.time_s[0], u, 1e-15);
        EXPECT_NEAR(at.phase_rad[0], phase, 1e-10);
        // Quarter fringes beyond it, on both sides
        for (std::size_t side = 0; side < 2; ++side) {
            for (std::size_t pulse = 0; pulse < 2; ++pulse) {
                const double t = at.pulse_s[side][pulse][0];
                EXPECT_EQ(t > u, side == 1);
                const double there = 1.0 + phase_per_arcsec * rate * t + s * swing_rad * (1.0 - std::cos(w * t));
                EXPECT_NEAR(std::remainder(there, 0.5 * pi), 0.0, 1e-9);
                EXPECT_NEAR(s * (there - 1.0 - phase), at.pulse_distance_rad[pulse][0], 1e-9);
            }
        }
        EXPECT_LT(at.pulse_distance_rad[0][0], 0.5 * pi);
        EXPECT_NEAR(at.pulse_distance_rad[1][0] - at.pulse_distance_rad[0][0], 0.5 * pi, 1e-12);
    }
}

TEST(ClosureEquation, AtTheExtremumThePhaseRateVanishes) {
    // Where psi' = 0 a small displacement on either side does not change the phase to first order: compare with the
    // parabola of psi'' = g' there. Strong coupling and an input rate move the extremum by microseconds.
    const LaneHalf half = paper_half(300.0, 2000.0);
    LaneExtremum at;
    for (const double s : {1.0, -1.0}) {
        find_extremum(plain_device(), half, half, s, around(), {}, at);
        for (std::size_t i = 0; i < lanes; ++i) {
            const double u = at.time_s[i];
            const double psi = around()[i] + at.phase_rad[i];
            const double g = half.rate_rad_s[i] + s * swing_rad * w * std::sin(w * u);
            EXPECT_NEAR(g + half.b_rad_s[i] * std::sin(psi), 0.0, 1e-9 * acceleration / std::sqrt(acceleration));
        }
    }
}

TEST(ClosureEquation, RefusesADriveThatDoesNotReverse) {
    const LaneHalf half = paper_half(300.0, 500000.0);
    LaneExtremum at;
    EXPECT_THROW(find_extremum(plain_device(), half, half, 1.0, same(0.0), {}, at), ringlock::RunError);
}

TEST(LongClosureEquation, LocksWithinBesselsHalfWidth) {
    // To first order in Omega_L the mean phase obeys Adler's equation with half-width Omega_L |J_0(M)|. J_0 by its
    // asymptotic form, good to 1/(8 M) here. Second order moves M by 0.001 rad at this threshold.
    const double threshold = 100.0;
    const double bessel = std::sqrt(2.0 / (pi * swing_rad)) * std::cos(swing_rad - 0.25 * pi);
    const double half_width = threshold * std::abs(bessel);
    const std::vector<double> relative = {0.2, 0.6, 0.9, 0.97, 1.04, 1.2, 1.6, 2.5};
    std::vector<Truth> truths(relative.size());
    for (std::size_t i = 0; i < relative.size(); ++i) {
        truths[i].lockin_threshold_deg_h = threshold;
        truths[i].input_rate_deg_h = relative[i] * half_width;
        truths[i].dither_frequency_hz = w / (2.0 * pi);
        truths[i].turns = 1201;
    }
    const std::vector<Generated> records = generate_with_trajectory(truths);
    for (std::size_t i = 0; i < relative.size(); ++i) {
        const Trajectory& path = records[i].trajectory;
        const std::size_t first = 800;  // slow beats of Adler's equation near the band's edge have begun
        const std::size_t last = 1200;
        const auto phase = [&](std::size_t row) { return path.plain_rad[row] + path.lockin_rad[row]; };
        const double turned = phase(last) - phase(first);
        if (relative[i] < 1.0) {
            EXPECT_NEAR(turned, 0.0, 0.02) << relative[i];
        } else {
            // Within a fringe of the mean: sqrt(rate^2 - half_width^2)
            const double mean = phase_per_arcsec * half_width * std::sqrt(relative[i] * relative[i] - 1.0);
            const double whole = phase(last) - phase(0);
            EXPECT_NEAR(whole, mean * (path.dither_turn_s[last] - path.dither_turn_s[0]), 2.0 * pi) << relative[i];
            EXPECT_GT(turned, 1.0) << relative[i];
        }
    }
}

TEST(LongClosureEquation, RandomisedTurnsWalkByTheFormula) {
    // ARW = Omega_L sqrt(K/(2 pi Omega_D)). Over n turns read at turns of the same kind n - 1/2 kicks' variances add
    // up.
    constexpr std::size_t n = 10;
    std::vector<Truth> truths(16);
    for (std::size_t i = 0; i < truths.size(); ++i) {
        truths[i].injected_noise_rad = 4.0;
        truths[i].input_rate_deg_h = 15.0;
        truths[i].initial_phase_rad = 0.4 * static_cast<double>(i);
        truths[i].seed = 100 + i;
        truths[i].turns = 1501;
    }
    double sum = 0.0;
    double squares = 0.0;
    std::size_t count = 0;
    for (const Generated& one : generate_with_trajectory(truths)) {
        const std::vector<double>& lockin = one.trajectory.lockin_rad;
        for (std::size_t i = 0; i + n < lockin.size(); i += n) {
            const double change = lockin[i + n] - lockin[i];
            sum += change;
            squares += change * change;
            ++count;
        }
    }
    const auto increments = static_cast<double>(count);
    const double variance = (squares - sum * sum / increments) / (increments - 1.0);
    const double per_second = variance / (static_cast<double>(n) - 0.5) * w / pi;
    const double arw_arcsec_rt_s = std::sqrt(per_second) / phase_per_arcsec;
    const double theory = 300.0 * std::sqrt(0.5 / (2.0 * pi * 109.1 * 3600.0));
    // Three standard errors of a deviation from `count` normal increments
    EXPECT_NEAR(arw_arcsec_rt_s / theory, 1.0, 3.0 / std::sqrt(2.0 * increments));
    // And no rate is left: three standard errors
    EXPECT_NEAR(sum / increments, 0.0, 3.0 * std::sqrt(variance / increments));
}

}  // namespace
}  // namespace generator_equation_test
