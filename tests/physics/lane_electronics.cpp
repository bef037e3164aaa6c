// What the readout of blocks makes of noise, ellipses, counters and clocks, against what its electronics are said to
// do.
#include <algorithm>
#include <bit>
#include <cstdio>
#include <vector>

#include "engine/ensemble/block.hpp"
#include "engine/propagate/rotation.hpp"
#include "engine/readout/lane_readout.hpp"
#include "tests/physics/readout_support.hpp"

namespace ringlock::test {
namespace lane_electronics_test {
namespace {

using simd::lanes;

TEST(LaneReadout, CountAndNoisyQuadratureAreJoinedSafelyAtQuarterBoundaries) {
    // Close to a boundary noise puts the quadrature into the neighbouring quarter; the phase must not jump.
    constexpr double rms = 0.01;
    readout::Electronics electronics = perfect_instrument;
    electronics.detector_noise_relative = rms;
    for (const int number : {0, 1}) {
        for (const int count : {-9, -5, -4, -2, -1, 0, 1, 2, 3, 4, 7, 1003}) {
            for (const double within : {1e-9, 1e-4, 0.7, 1.5707, quarter_rad - 1e-9}) {
                const std::vector<double> noises{-0.5, -0.02, -1e-6, 0.0, 1e-6, 0.02, 0.5};
                const double psi = quarter_rad * count + within;
                std::vector<Turn> turns(noises.size());
                std::vector<simd::Lanes> deviates(2);
                for (std::size_t i = 0; i < noises.size(); ++i) {
                    turns[i].setup = paper_device();
                    turns[i].setup.lockin_threshold_deg_h = 0.0;
                    turns[i].phase_rad = psi;
                    deviates[0][i] = (std::sin(psi + noises[i]) - std::sin(psi)) / rms;
                    deviates[1][i] = (std::cos(psi + noises[i]) - std::cos(psi)) / rms;
                }
                const Read got = read(turns, number, electronics, {deviates});
                for (std::size_t i = 0; i < noises.size(); ++i) {
                    EXPECT_NEAR(got.phase_rad(i), psi + noises[i], 1e-12 * (1.0 + std::abs(psi)))
                        << count << " " << within << " " << noises[i];
                }
            }
        }
    }
}

// ---- Whole runs.

scenario::Scenario quiet() {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.ensemble.seed = 508;
    scenario.readout.detector_noise_relative = 0.0;
    scenario.readout.clock_hz = 0.0;
    scenario.noise_injection.turn_phase_rms_rad = 3.0;
    return scenario;
}

/// Rows of one arm of a run, kept whole: [turn][gyro].
struct Record {
    std::vector<simd::Lanes> sine, cosine, phase_fringes, phase_whole, angle_fringes, before, after;
    std::vector<simd::Lanes> lockin_rad;
    std::vector<gyro::Setup> setups;
};

Record go(const scenario::Scenario& scenario, const std::string& arm, std::size_t turns, std::int64_t first = 0,
          std::size_t gyros = lanes, const std::vector<std::size_t>& pieces = {128},
          const std::vector<gyro::Setup>& setups = {}) {
    const std::vector<scenario::Arm> arms{scenario::parse_arm(arm)};
    auto block = setups.empty() ? ensemble::GyroBlock(scenario, arms, first, gyros)
                                : ensemble::GyroBlock(scenario, arms, first, setups);
    Record run;
    run.setups = block.setups();
    std::size_t done = 0;
    for (std::size_t piece = 0; done < turns; ++piece) {
        const std::size_t count = std::min(pieces[piece % pieces.size()], turns - done);
        block.advance(count);
        const auto& r = block.readings(0);
        const auto& a = block.angles(0);
        const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
        append(run.sine, r.sine);
        append(run.cosine, r.cosine);
        append(run.phase_fringes, r.phase_fringes);
        append(run.phase_whole, r.phase_whole);
        append(run.angle_fringes, a.angle_fringes);
        append(run.before, r.accel_before_rad_s2);
        append(run.after, r.accel_after_rad_s2);
        for (std::size_t i = 0; i < count; ++i) {
            run.lockin_rad.emplace_back();
            for (std::size_t g = 0; g < gyros; ++g) run.lockin_rad.back()[g] = block.lockin_error_rad(0, i, g);
        }
        done += count;
    }
    return run;
}

TEST(LaneElectronics, NoiseHasItsSizeAndIsIndependent) {
    auto scenario = quiet();
    constexpr std::size_t turns = 4096;
    const Record clean = go(scenario, "noise_injected+compensated", turns);
    scenario.readout.detector_noise_relative = 0.01;
    const Record noisy = go(scenario, "noise_injected+compensated", turns);
    double ss = 0.0, cc = 0.0, sc = 0.0, s_next = 0.0, c_next = 0.0, s_gyro = 0.0, mean = 0.0;
    const auto sine = [&](std::size_t i, std::size_t g) { return (noisy.sine[i][g] - clean.sine[i][g]) / 0.01; };
    const auto cosine = [&](std::size_t i, std::size_t g) { return (noisy.cosine[i][g] - clean.cosine[i][g]) / 0.01; };
    const double n = static_cast<double>(turns) * lanes;
    for (std::size_t i = 0; i < turns; ++i) {
        for (std::size_t g = 0; g < lanes; ++g) {
            ss += sine(i, g) * sine(i, g) / n;
            cc += cosine(i, g) * cosine(i, g) / n;
            sc += sine(i, g) * cosine(i, g) / n;
            mean += (sine(i, g) + cosine(i, g)) / n;
            s_gyro += sine(i, g) * sine(i, (g + 1) % lanes) / n;
            if (i > 0) s_next += sine(i, g) * sine(i - 1, g) / n;
            if (i > 0) c_next += cosine(i, g) * sine(i - 1, g) / n;
        }
    }
    // Four standard errors each.
    EXPECT_NEAR(std::sqrt(ss), 1.0, 4.0 / std::sqrt(2.0 * n));
    EXPECT_NEAR(std::sqrt(cc), 1.0, 4.0 / std::sqrt(2.0 * n));
    EXPECT_NEAR(mean, 0.0, 4.0 * std::sqrt(2.0 / n));
    for (const double correlation : {sc, s_gyro, s_next, c_next}) EXPECT_NEAR(correlation, 0.0, 4.0 / std::sqrt(n));
}

TEST(LaneElectronics, ReadAnEllipse) {
    auto scenario = quiet();
    scenario.ensemble.initial_phase_spread_rad = 6.0;
    std::vector<gyro::Setup> setups;
    Uniform uniform(509);
    for (std::size_t g = 0; g < lanes; ++g) {
        setups.push_back(paper_device());
        setups.back().coupling_phase_rad = uniform(-3.0, 3.0);
        setups.back().ellipse = {uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.2, 0.2)};
    }
    const Record read = go(scenario, "noise_injected+compensated", 300, 0, lanes, {128}, setups);
    scenario.readout.model = scenario::ReadoutModel::ideal;
    const Record truth = go(scenario, "noise_injected+compensated", 300, 0, lanes, {128}, setups);
    for (std::size_t i = 0; i < truth.sine.size(); ++i) {
        for (std::size_t g = 0; g < lanes; ++g) {
            const gyro::Ellipse& e = setups[g].ellipse;
            const double psi = units::two_pi * truth.phase_fringes[i][g];
            // Rounding of a few fringes times 2 pi.
            EXPECT_NEAR(truth.sine[i][g], std::sin(psi), 1e-13);
            EXPECT_NEAR(truth.cosine[i][g], std::cos(psi), 1e-13);
            EXPECT_NEAR(read.sine[i][g], (1.0 + e.gain) * std::sin(psi) + e.offset_sin, 2e-13);
            EXPECT_NEAR(read.cosine[i][g], std::cos(psi + e.orthogonality_rad) + e.offset_cos, 2e-13);
            // The phase read is the quadrature's.
            const double error = units::two_pi * (read.phase_fringes[i][g] - truth.phase_fringes[i][g]);
            const double quadrature = std::atan2(read.sine[i][g], read.cosine[i][g]);
            EXPECT_NEAR(std::remainder(psi + error - quadrature, units::two_pi), 0.0, 2e-13);
            EXPECT_LT(std::abs(error), 0.5);
        }
    }
}

TEST(LaneElectronics, QuarterFringeCounterHasTheQuantisationOfItsStep) {
    // Q = (K/4)/sqrt(12) where phases are uniform, as injected noise of 3 rad makes them.
    auto scenario = quiet();
    const Record fine = go(scenario, "noise_injected", 4000);
    scenario.readout.angle_output = scenario::AngleOutput::quarter_fringe;
    const Record coarse = go(scenario, "noise_injected", 4000);
    double sum = 0.0;
    double n = 0.0;
    for (std::size_t i = 0; i < 4000; i += 2) {
        for (std::size_t g = 0; g < lanes; ++g) {
            const double error = coarse.angle_fringes[i][g] - fine.angle_fringes[i][g];
            EXPECT_LE(std::abs(error), 0.125 + 1e-12);
            // The middle of a quarter fringe of the phase.
            const double quarters = 4.0 * (fine.phase_fringes[i][g] + error) - 0.5;
            EXPECT_NEAR(quarters, std::nearbyint(quarters), 1e-12);
            sum += error * error;
            n += 1.0;
        }
    }
    const double q_arcsec = std::sqrt(sum / n) * 0.5;
    // The square of a uniform deviate has a relative standard deviation of sqrt(4/5), its root half of that: 4 standard
    // errors of independent turns.
    EXPECT_NEAR(q_arcsec / (0.125 / std::sqrt(12.0)), 1.0, 4.0 * 0.5 * std::sqrt(0.8 / n));
}

TEST(LongLaneElectronics, TheUnwrappedPhaseIsTrueOverALongRun) {
    // Plain bookkeeping of one gyro: phases at the dither's turns from half cycles solved one by one, those at the
    // zero-rate points from the path.
    constexpr std::int64_t turns = 20001;
    for (const double rate_deg_h : {-20.0, 3000.0}) {
        auto scenario = quiet();
        scenario.readout.detector_noise_relative = 0.01;
        gyro::Setup setup = paper_device();
        setup.input_rate_deg_h = rate_deg_h;
        setup.initial_phase_rad = 1.1;
        setup.dither_asymmetry_ratio = 0.003;
        const Record run = go(scenario, "noise_injected+compensated", turns, 3, 1, {128}, {setup});
        const gyro::Device device(setup);
        const random::Identity who{scenario.ensemble.seed, 3};
        const auto deviate = [&](std::int64_t turn) {
            return 3.0 * random::normal(who, random::Purpose::noise_injection, static_cast<std::uint64_t>(turn));
        };
        // Table errors of 1e-10 rad a turn; the map keeps no memory of old ones under injected noise.
        Phase lockin;
        double worst_phase = 0.0;
        double squares = 0.0;
        double noise = deviate(0);
        gyro::HalfCycle before = device.half_cycle(-1.0, device.dither_amplitude_rad - 0.5 * noise);
        Phase plain(device.initial_phase_rad + noise);
        for (std::int64_t turn = 0; turn < turns; ++turn) {
            const auto i = static_cast<std::size_t>(turn);
            const double sign = turn % 2 == 0 ? 1.0 : -1.0;
            const double next = deviate(turn + 1);
            const gyro::HalfCycle after =
                device.half_cycle(sign, device.dither_amplitude_rad + 0.5 * sign * (next - noise));
            Phase psi = plain;
            psi.fringes += lockin.fringes;
            psi.add(lockin.remainder_rad);
            const TurnPath path(before, after, device.coupling, psi.remainder_rad);
            const double whole = run.phase_whole[i][0] - static_cast<double>(psi.fringes);
            const double error = units::two_pi * (whole + run.phase_fringes[i][0]) - path.zero_rate_phase_rad();
            worst_phase = std::max(worst_phase, std::abs(error));
            squares += error * error;
            lockin.add(propagate::exact_half_cycle(after, device.coupling).gain_rad(psi.remainder_rad));
            plain.add(after.plain_phase_total_rad());
            noise = next;
            before = after;
        }
        std::printf("%.0f deg/h: rotation %.0f, lock-in %.2f fringes; worst of %d phases off by %.3g rad\n", rate_deg_h,
                    rate_deg_h / 0.5 * turns * 0.5 * device.period_s(), lockin.value_rad() / units::two_pi,
                    static_cast<int>(turns), worst_phase);
        // Two detectors of the same noise: the phase has it, too. One in 2e4 deviates is beyond 4; none beyond 6.
        EXPECT_LT(worst_phase, 6.0 * 0.01);
        EXPECT_NEAR(std::sqrt(squares / turns), 0.01, 4.0 * 0.01 / std::sqrt(2.0 * turns));
    }
}

TEST(LaneElectronics, IdealOnesReproduceThePhase) {
    auto scenario = quiet();
    const Record instrument = go(scenario, "noise_injected+compensated", 1000);
    scenario.readout.model = scenario::ReadoutModel::ideal;
    scenario.readout.detector_noise_relative = 0.3;  // not for them
    const Record run = go(scenario, "noise_injected+compensated", 1000);
    for (std::size_t i = 0; i < run.sine.size(); ++i) {
        for (std::size_t g = 0; g < lanes; ++g) {
            const double psi = units::two_pi * run.phase_fringes[i][g];
            EXPECT_NEAR(std::remainder(psi - std::atan2(run.sine[i][g], run.cosine[i][g]), units::two_pi), 0.0, 1e-13);
            // So does an instrument without noise and ellipse.
            EXPECT_NEAR(instrument.phase_fringes[i][g], run.phase_fringes[i][g], 1e-14);
        }
    }
}

std::uint64_t bits(double x) { return std::bit_cast<std::uint64_t>(x); }

TEST(LaneElectronics, ATurnsReadingDoesNotDependOnWhichOthersAreRead) {
    auto scenario = quiet();
    scenario.readout.detector_noise_relative = 0.01;
    const Record all = go(scenario, "noise_injected+compensated", 600);
    const Record minima = go(scenario, "noise_injected", 600);
    for (std::size_t i = 0; i < 600; i += 2) {
        for (std::size_t g = 0; g < lanes; ++g) {
            ASSERT_EQ(bits(minima.sine[i][g]), bits(all.sine[i][g])) << i;
            ASSERT_EQ(bits(minima.cosine[i][g]), bits(all.cosine[i][g])) << i;
            ASSERT_EQ(bits(minima.phase_fringes[i][g]), bits(all.phase_fringes[i][g])) << i;
            ASSERT_EQ(bits(minima.angle_fringes[i][g]), bits(all.angle_fringes[i][g])) << i;
        }
    }
}

TEST(LaneElectronics, LanesAndPiecesDoNotMatter) {
    auto scenario = quiet();
    scenario.readout.detector_noise_relative = 0.01;
    scenario.readout.clock_hz = 1e8;
    const Record whole = go(scenario, "noise_injected+compensated", 600);
    const Record alone = go(scenario, "noise_injected+compensated", 600, 5, 1);
    const Record pieces = go(scenario, "noise_injected+compensated", 600, 0, lanes, {2, 100, 6, 34});
    for (std::size_t i = 0; i < 600; ++i) {
        ASSERT_EQ(bits(alone.sine[i][0]), bits(whole.sine[i][5])) << i;
        ASSERT_EQ(bits(alone.phase_fringes[i][0]), bits(whole.phase_fringes[i][5])) << i;
        ASSERT_EQ(bits(alone.before[i][0]), bits(whole.before[i][5])) << i;
        ASSERT_EQ(bits(alone.after[i][0]), bits(whole.after[i][5])) << i;
        for (std::size_t g = 0; g < lanes; ++g) {
            ASSERT_EQ(bits(pieces.sine[i][g]), bits(whole.sine[i][g])) << i;
            // Whole fringes are put apart at the beginning of a piece: rounded there.
            const double phase = (pieces.phase_whole[i][g] - whole.phase_whole[i][g]) + pieces.phase_fringes[i][g];
            ASSERT_NEAR(phase, whole.phase_fringes[i][g], 1e-14) << i;
        }
    }
}

}  // namespace
}  // namespace lane_electronics_test
}  // namespace ringlock::test
