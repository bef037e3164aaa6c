// The path near a turn, and what the readout makes of it.
#include "engine/readout/turn_path.hpp"

#include <boost/numeric/odeint/integrate/integrate_adaptive.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>

#include "engine/core/error.hpp"
#include "engine/readout/readout.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace {

struct Scene {
    gyro::Device device;
    gyro::HalfCycle before;
    gyro::HalfCycle after;
    double phase;

    Scene(Uniform& uniform, int i, double rate_deg_h) : device(setup(uniform, rate_deg_h)) {
        const double sign = i % 2 == 0 ? 1.0 : -1.0;
        before = device.half_cycle(-sign, device.dither_amplitude_rad * uniform(0.97, 1.03));
        after = device.half_cycle(sign, device.dither_amplitude_rad * uniform(0.97, 1.03));
        phase = uniform(-3.1, 3.1);
    }
    static gyro::Setup setup(Uniform& uniform, double rate_deg_h) {
        gyro::Setup setup = paper_device();
        setup.input_rate_deg_h = uniform(-rate_deg_h, rate_deg_h);
        setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
        setup.coupling_phase_rad = uniform(-3.0, 3.0);
        return setup;
    }
    /// psi a time after (or before) the dither's turn by Boost.odeint, on the deviation from the plain phase.
    double phase_at(double time_s) const {
        if (time_s == 0.0) return phase;
        // Both half cycles turn here, so the plain phase is even in time but for the input rate.
        const gyro::HalfCycle& half = time_s > 0.0 ? after : before;
        const auto plain = [&](double t) {
            const double s = std::sin(0.5 * half.angular_frequency_rad_s() * t);
            return half.rate_rad_s * t + after.sign * half.amplitude_rad * 2.0 * s * s;
        };
        double deviation = 0.0;
        using Stepper = boost::numeric::odeint::runge_kutta_fehlberg78<double>;
        boost::numeric::odeint::integrate_adaptive(
            boost::numeric::odeint::make_controlled<Stepper>(1e-14, 1e-14),
            [&](const double& x, double& rate, double t) {
                rate = device.coupling.b_rad_s * std::sin(phase + plain(t) + x + device.coupling.phase_rad);
            },
            deviation, 0.0, time_s, 1e-8 * (time_s > 0.0 ? 1.0 : -1.0));
        return phase + plain(time_s) + deviation;
    }
};

TEST(TurnPath, FindsTheZeroRatePointAndThePulses) {
    Uniform uniform(31);
    for (const double rate : {0.0, 100.0, 5000.0, 50000.0, 190000.0}) {
        for (int i = 0; i < 40; ++i) {
            const Scene scene(uniform, i, rate);
            const readout::TurnPath path(scene.before, scene.after, scene.device.coupling, scene.phase);
            const double t0 = path.zero_rate_time_s();
            const double psi0 = path.zero_rate_phase_rad();
            EXPECT_NEAR(scene.phase_at(t0), psi0, 1e-10);
            // An extremum: the phase moves off to the same side a microsecond before and after.
            EXPECT_GT(scene.after.sign * (scene.phase_at(t0 + 1e-6) - psi0), 0.0);
            EXPECT_GT(scene.after.sign * (scene.phase_at(t0 - 1e-6) - psi0), 0.0);
            for (const int side : {-1, 1}) {
                const auto times = path.crossing_times_s(side, {0.8, 2.3});
                EXPECT_GT(side * (times[0] - t0), 0.0);
                EXPECT_GT(side * (times[1] - times[0]), 0.0);
                // The phase runs at 1e5 rad/s there: 1e-9 rad is 1e-14 s.
                EXPECT_NEAR(scene.after.sign * (scene.phase_at(times[0]) - psi0), 0.8, 2e-9);
                EXPECT_NEAR(scene.after.sign * (scene.phase_at(times[1]) - psi0), 2.3, 2e-9);
            }
        }
    }
}

TEST(TurnPath, PlainGainIsTheDrivesPhase) {
    Uniform uniform(32);
    for (int i = 0; i < 20; ++i) {
        Scene scene(uniform, i, 5000.0);
        scene.device.coupling.b_rad_s = 0.0;
        const readout::TurnPath path(scene.before, scene.after, scene.device.coupling, scene.phase);
        EXPECT_NEAR(path.zero_rate_phase_rad() - scene.phase, path.plain_gain_rad(), 1e-12);
    }
}

TEST(TurnPath, RefusesATurnWithoutReversal) {
    const gyro::Device device(paper_device());
    auto before = device.half_cycle(-1.0, device.dither_amplitude_rad);
    auto after = device.half_cycle(1.0, device.dither_amplitude_rad);
    before.rate_rad_s = after.rate_rad_s = 1e7;  // twice the dither's peak rate
    EXPECT_THROW(readout::TurnPath(before, after, device.coupling, 0.1), RunError);
}

readout::Electronics perfect_instrument() { return {false, true, 0.0, 0.0, {}}; }

TEST(Readout, ReadsThePhaseAndCountsQuarterFringes) {
    Uniform uniform(33);
    for (int i = 0; i < 200; ++i) {
        const Scene scene(uniform, i, 100.0);
        const readout::TurnPath path(scene.before, scene.after, scene.device.coupling, scene.phase);
        Phase phase(scene.phase);
        phase.fringes = -1000 + 17 * i;
        readout::Readout instrument(perfect_instrument(), {1, 1});
        const auto read = instrument.read(path, phase, i, 1.0, i % 2 == 0 ? 1 : -1);
        Phase truth;
        truth.fringes = phase.fringes;
        truth.add(path.zero_rate_phase_rad());
        EXPECT_EQ(read.reading.quarter_count,
                  4 * truth.fringes + static_cast<std::int64_t>(std::floor(truth.remainder_rad / (0.5 * units::pi))));
        const Phase joined = readout::joined_phase(read.reading);
        EXPECT_NEAR(static_cast<double>(joined.fringes - truth.fringes) * units::two_pi + joined.remainder_rad,
                    truth.remainder_rad, 1e-12);
        EXPECT_NEAR(read.phase_error_rad, 0.0, 1e-12);
        // Two pulses give the acceleration but for the lock-in's bending of the path, some per cent.
        EXPECT_NEAR(read.reading.accel_before_rad_s2 / scene.before.end_acceleration_rad_s2(), 1.0, 0.1);
        EXPECT_NEAR(read.reading.accel_after_rad_s2 / scene.after.end_acceleration_rad_s2(), 1.0, 0.1);
    }
}

TEST(Readout, CountAndNoisyQuadratureAreJoinedSafelyAtQuarterBoundaries) {
    // Close to a boundary noise puts the quadrature into the neighbouring quarter; the phase must not jump.
    readout::Reading reading;
    for (const std::int64_t count : {-9, -5, -4, -1, 0, 3, 4, 7, 100003}) {
        for (const double within : {1e-4, 0.7, 1.5707}) {
            for (const double noise : {-0.02, 0.0, 0.02}) {
                const double psi = 0.5 * units::pi * static_cast<double>(count) + within;
                reading.quarter_count = count;
                reading.sin = std::sin(psi + noise);
                reading.cos = std::cos(psi + noise);
                EXPECT_NEAR(readout::joined_phase(reading).value_rad(), psi + noise, 1e-9) << count << " " << within;
            }
        }
    }
}

TEST(Readout, NoiseClockAndEllipseAreWhatTheElectronicsSay) {
    Uniform uniform(34);
    readout::Electronics electronics = perfect_instrument();
    electronics.detector_noise_relative = 0.01;
    electronics.clock_hz = 1e6;
    electronics.ellipse = {0.05, 0.02, -0.03, 0.1};
    readout::Readout instrument(electronics, {1, 1});
    double sum_sin = 0.0;
    double sum_cos = 0.0;
    const int n = 4000;
    for (int i = 0; i < n; ++i) {
        const Scene scene(uniform, i, 100.0);
        const readout::TurnPath path(scene.before, scene.after, scene.device.coupling, scene.phase);
        const auto read = instrument.read(path, Phase(scene.phase), i, 0.1234567, i % 2 == 0 ? 1 : -1);
        const double psi = path.zero_rate_phase_rad();
        sum_sin += std::pow(read.reading.sin - (1.05 * std::sin(psi) + 0.02), 2);
        sum_cos += std::pow(read.reading.cos - (std::cos(psi + 0.1) - 0.03), 2);
        EXPECT_NEAR(read.reading.time_s * 1e6, std::round(read.reading.time_s * 1e6), 1e-6);
    }
    EXPECT_NEAR(std::sqrt(sum_sin / n), 0.01, 4 * 0.01 / std::sqrt(2.0 * n));
    EXPECT_NEAR(std::sqrt(sum_cos / n), 0.01, 4 * 0.01 / std::sqrt(2.0 * n));
}

TEST(Readout, NoiseOfATurnDoesNotDependOnWhichTurnsAreRead) {
    Uniform uniform(35);
    const Scene scene(uniform, 0, 100.0);
    const readout::TurnPath path(scene.before, scene.after, scene.device.coupling, scene.phase);
    readout::Electronics electronics = perfect_instrument();
    electronics.detector_noise_relative = 0.01;
    readout::Readout all(electronics, {9, 2});
    readout::Readout some(electronics, {9, 2});
    for (int turn = 0; turn < 100; ++turn) {
        const double every = all.read(path, Phase(scene.phase), turn, 0.0, 1).reading.sin;
        if (turn % 10 == 0) {
            EXPECT_EQ(some.read(path, Phase(scene.phase), turn, 0.0, 1).reading.sin, every);
        }
    }
}

TEST(Readout, QuarterFringeCounterHasTheQuantisationOfItsStep) {
    // Q = (K/4)/sqrt(12) when read at uncorrelated instants.
    Uniform uniform(36);
    readout::Electronics electronics = perfect_instrument();
    electronics.interpolate = false;
    readout::Readout counter(electronics, {1, 1});
    double sum = 0.0;
    const int n = 4000;
    for (int i = 0; i < n; ++i) {
        const Scene scene(uniform, 2 * i, 100.0);
        const readout::TurnPath path(scene.before, scene.after, scene.device.coupling, scene.phase);
        const double error = counter.read(path, Phase(scene.phase), i, 0.0, 1).phase_error_rad;
        EXPECT_LE(std::abs(error), 0.25 * units::pi + 1e-9);
        sum += error * error;
    }
    const double q_arcsec = std::sqrt(sum / n) * 0.5 / units::two_pi;
    EXPECT_NEAR(q_arcsec, 0.125 / std::sqrt(12.0), 0.03 * 0.125 / std::sqrt(12.0));
}

}  // namespace
}  // namespace ringlock::test
