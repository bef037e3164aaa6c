// The detectors' ellipse, learnt from their own readings.
#include "engine/readout/ellipse_correction.hpp"

#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "engine/ensemble/block.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace ellipse_correction_test {
namespace {

using simd::lanes;

constexpr gyro::Ellipse bent{0.04, 0.05, -0.03, 0.06};

/// Readings of detectors with that ellipse at the phases given, [turn][gyro].
readout::LaneReadings readings_of(const gyro::Ellipse& ellipse, const std::vector<simd::Lanes>& phase_rad,
                                  double noise_rms, std::mt19937_64& engine) {
    std::normal_distribution<double> normal(0.0, noise_rms);
    readout::LaneReadings readings;
    readings.resize(phase_rad.size());
    for (std::size_t i = 0; i < phase_rad.size(); ++i) {
        for (std::size_t g = 0; g < lanes; ++g) {
            const double psi = phase_rad[i][g];
            const double s = (1.0 + ellipse.gain) * std::sin(psi) + ellipse.offset_sin + normal(engine);
            const double c = std::cos(psi + ellipse.orthogonality_rad) + ellipse.offset_cos + normal(engine);
            readings.sine[i][g] = s;
            readings.cosine[i][g] = c;
            readings.phase_fringes[i][g] =
                (psi + std::remainder(std::atan2(s, c) - psi, units::two_pi)) / units::two_pi;
        }
    }
    return readings;
}

std::vector<simd::Lanes> anywhere(std::size_t turns, std::mt19937_64& engine, double width_rad = units::two_pi) {
    std::uniform_real_distribution<double> uniform(0.0, width_rad);
    std::vector<simd::Lanes> phases(turns);
    for (simd::Lanes& row : phases) {
        for (std::size_t g = 0; g < lanes; ++g) row[g] = uniform(engine);
    }
    return phases;
}

TEST(EllipseCorrection, LearnsTheEllipse) {
    std::mt19937_64 engine(801);
    constexpr double noise = 0.005;
    constexpr std::size_t turns = 40000;
    readout::EllipseCorrection correction(lanes);
    readout::LaneAngles angles;
    double worst_rad = 0.0;
    for (std::size_t done = 0; done < turns; done += 1000) {
        const auto phases = anywhere(1000, engine);
        readout::LaneReadings readings = readings_of(bent, phases, done + 1000 < turns ? noise : 0.0, engine);
        correction.correct(readings, angles, false);
        if (done + 1000 < turns) continue;
        for (std::size_t i = 0; i < readings.turns; ++i) {
            for (std::size_t g = 0; g < lanes; ++g) {
                worst_rad = std::max(worst_rad, std::abs(units::two_pi * readings.phase_fringes[i][g] - phases[i][g]));
                EXPECT_NEAR(std::hypot(readings.sine[i][g], readings.cosine[i][g]), 1.0, 1e-3);
            }
        }
    }
    // A centre is known to sqrt(2/n) of the noise, gain and angle to twice that; 5 standard errors over 16 gyros. The
    // readings that are made up draw by 8/n + 1/1000 of the ellipse.
    const double error = 5.0 * noise * std::sqrt(2.0 / turns) + (8.0 / turns + 1e-3) * 0.06;
    for (std::size_t g = 0; g < lanes; ++g) {
        const gyro::Ellipse& found = correction.ellipse(g);
        EXPECT_NEAR(found.offset_sin, bent.offset_sin, error);
        EXPECT_NEAR(found.offset_cos, bent.offset_cos, error);
        EXPECT_NEAR(found.gain, bent.gain, 2.0 * error);
        EXPECT_NEAR(found.orthogonality_rad, bent.orthogonality_rad, 2.0 * error);
    }
    EXPECT_LT(worst_rad, 4.0 * error);
}

TEST(EllipseCorrection, PhasesThatDoNotMoveBendNothing) {
    // A locked gyro turns at two phases only: nothing tells an ellipse.
    std::mt19937_64 engine(802);
    readout::EllipseCorrection correction(lanes);
    readout::LaneAngles angles;
    for (int piece = 0; piece < 20; ++piece) {
        std::vector<simd::Lanes> phases(1000);
        for (std::size_t i = 0; i < phases.size(); ++i) {
            for (std::size_t g = 0; g < lanes; ++g) {
                phases[i][g] = (i % 2 == 0 ? 0.3 : 2.1) + 0.2 * static_cast<double>(g);
            }
        }
        readout::LaneReadings readings = readings_of({}, phases, 0.005, engine);
        correction.correct(readings, angles, false);
        for (std::size_t i = 0; i < readings.turns; ++i) {
            for (std::size_t g = 0; g < lanes; ++g) {
                ASSERT_NEAR(units::two_pi * readings.phase_fringes[i][g], phases[i][g], 0.05);
            }
        }
    }
}

/// Mean rate error of 16 gyros over 100 s after as long to settle [deg/h], and its standard error.
std::pair<double, double> mean_rate_error(scenario::ReadoutModel model, bool corrected) {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.effects["readout_ellipse"]["offset_sin"] = 0.05;
    scenario.readout.model = model;
    scenario.readout.ellipse_correction = corrected;
    scenario.ensemble.seed = 803;
    const std::vector<scenario::Arm> arms{scenario::parse_arm("noise_injected+compensated")};
    ensemble::GyroBlock block(scenario, arms, 0, lanes);
    constexpr int pieces = 195;  // of 128 turns: 100 s
    std::array<double, lanes> first{};
    std::array<double, lanes> last{};
    std::int64_t minima = 0;
    for (int piece = 0; piece < 2 * pieces; ++piece) {
        block.advance(128);
        for (std::size_t g = 0; g < lanes; ++g) last[g] = static_cast<double>(block.counts(0).back()[g]);
        if (piece + 1 == pieces) first = last;
        if (piece >= pieces) minima += 64;
    }
    double mean = 0.0;
    double square = 0.0;
    for (std::size_t g = 0; g < lanes; ++g) {
        const gyro::Setup& setup = block.setups()[g];
        const double time_s = static_cast<double>(minima) / setup.dither_frequency_hz;
        const double error =
            (last[g] - first[g]) / 4294967296.0 * setup.scale_factor_arcsec / time_s - setup.input_rate_deg_h;
        mean += error / lanes;
        square += error * error / lanes;
    }
    return {mean, std::sqrt((square - mean * mean) / (lanes - 1))};
}

TEST(EllipseCorrection, CuresTheBiasOfAnOffset) {
    const auto [left, left_error] = mean_rate_error(scenario::ReadoutModel::latched, false);
    const auto [latched, latched_error] = mean_rate_error(scenario::ReadoutModel::latched, true);
    const auto [instrument, instrument_error] = mean_rate_error(scenario::ReadoutModel::instrument, true);
    std::printf("offset 5 %%: %.4f +- %.4f deg/h; corrected %.5f +- %.5f, of the instrument %.5f +- %.5f\n", left,
                left_error, latched, latched_error, instrument, instrument_error);
    EXPECT_NEAR(left, -0.053, 4.0 * left_error + 0.001);
    EXPECT_NEAR(latched, 0.0, 4.0 * latched_error + 0.002 * 0.053);
    EXPECT_NEAR(instrument, 0.0, 4.0 * instrument_error + 0.002 * 0.053);
}

}  // namespace
}  // namespace ellipse_correction_test
}  // namespace ringlock::test
