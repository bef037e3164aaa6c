// The path near a turn, and what the readout makes of it.
#include "tests/support/turn_path.hpp"

#include <boost/numeric/odeint/integrate/integrate_adaptive.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>

#include "engine/core/error.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace turn_path_test {
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
            const TurnPath path(scene.before, scene.after, scene.device.coupling, scene.phase);
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
        const TurnPath path(scene.before, scene.after, scene.device.coupling, scene.phase);
        EXPECT_NEAR(path.zero_rate_phase_rad() - scene.phase, path.plain_gain_rad(), 1e-12);
    }
}

TEST(TurnPath, RefusesATurnWithoutReversal) {
    const gyro::Device device(paper_device());
    auto before = device.half_cycle(-1.0, device.dither_amplitude_rad);
    auto after = device.half_cycle(1.0, device.dither_amplitude_rad);
    before.rate_rad_s = after.rate_rad_s = 1e7;  // twice the dither's peak rate
    EXPECT_THROW(TurnPath(before, after, device.coupling, 0.1), RunError);
}

}  // namespace
}  // namespace turn_path_test
}  // namespace ringlock::test
