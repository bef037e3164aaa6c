// Noise of the drive of a resonator: against its equation of motion, and its statistics.
#include "engine/dither/drive_noise.hpp"

#include <array>
#include <boost/numeric/odeint.hpp>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "engine/dither/lane_dither.hpp"
#include "engine/propagate/lane_propagator.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/devices.hpp"

namespace ringlock::test {
namespace drive_noise_test {
namespace {

using gyro::DriveNoise;
using gyro::NoiseDistribution;
using gyro::NoiseForm;
using gyro::Resonator;

constexpr double frequency_hz = 400.0;

random::LaneIdentities identities(std::uint64_t seed) {
    random::LaneIdentities who;
    who.seed = seed;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = lane;
    return who;
}

std::vector<gyro::Device> devices_of(std::size_t which, double rate_deg_h = 0.0) {
    gyro::Setup setup = setup_of(named_devices[which]);
    setup.input_rate_deg_h = rate_deg_h;
    return std::vector<gyro::Device>(simd::lanes, gyro::Device(setup));
}

/// The equation of the resonator integrated with the same levels, by Boost.odeint: angle and time of each turn.
class Integrated {
   public:
    Integrated(const DriveNoise& noise, double amplitude_rad) : damping_(0.5 / noise.resonator_q), a_(amplitude_rad) {}

    /// State x, x'/w in the angle w t from a nominal turn on, under the levels of a half cycle; `to` a part of it.
    std::array<double, 2> go(std::array<double, 2> state, double from, double to, const std::vector<double>& levels,
                             double loop, double start_sign) const {
        namespace ode = boost::numeric::odeint;
        const double part = units::pi / static_cast<double>(levels.size());
        // Piece by piece, as the force is not smooth between levels.
        double at = from;
        const double direction = to > from ? 1.0 : -1.0;
        while (direction * (to - at) > 1e-15) {
            const double middle = at + direction * 1e-9;
            const double index = std::floor(middle / part);
            const double edge = direction > 0 ? (index + 1.0) * part : index * part;
            const double end = direction > 0 ? std::min(to, edge) : std::max(to, edge);
            const double force = a_ + loop + levels[static_cast<std::size_t>(index)];
            const auto rate = [&](const std::array<double, 2>& y, std::array<double, 2>& dy, double angle) {
                dy[0] = y[1];
                dy[1] = -y[0] - 2.0 * damping_ * y[1] + 2.0 * damping_ * force * start_sign * std::sin(angle);
            };
            ode::integrate_adaptive(
                ode::make_controlled<ode::runge_kutta_fehlberg78<std::array<double, 2>>>(1e-14 * a_, 1e-14), rate,
                state, at, end, 0.1 * (end - at));
            at = end;
        }
        return state;
    }

   private:
    double damping_;
    double a_;
};

/// Largest difference of a turn's amplitude from the equation's, over the amplitude, and of its time.
std::pair<double, double> error_of(const DriveNoise& noise, double rms_rad, int half_cycles) {
    const auto devices = devices_of(0);
    const double a = devices[0].dither_amplitude_rad;
    dither::DriveNoiseLanes lanes(noise, devices, rms_rad, identities(911));
    const Integrated equation(noise, a);
    const double w = units::two_pi * noise.frequency_hz;
    double worst = 0.0;
    double worst_time = 0.0;
    const std::size_t lane = 3;
    // From the turn 0 that the lanes are at: its velocity is zero, and it lies in one of two half cycles.
    double loop = 0.0;
    double late = w * lanes.late_s()[lane];
    std::array<double, 2> state{-(a + lanes.deviation_rad()[lane]), 0.0};
    if (late < 0.0) {
        state = equation.go(state, units::pi + late, units::pi, lanes.levels_rad(lane, -1), loop, -1.0);
    } else {
        state = equation.go(state, late, 0.0, lanes.levels_rad(lane, 0), loop, 1.0);
    }
    std::vector<simd::Lanes> deviation;
    std::vector<simd::Lanes> lateness;
    for (int turn = 0; turn < half_cycles; ++turn) {
        const double sign = turn % 2 == 0 ? 1.0 : -1.0;
        lanes.next(1, deviation, lateness);
        late = w * lateness[0][lane];
        const std::array<double, 2> nominal =
            equation.go(state, 0.0, units::pi, lanes.levels_rad(lane, turn), loop, sign);
        // The claim is that the velocity vanishes at that time and the angle there is this.
        const std::array<double, 2> there =
            late > 0.0 ? equation.go(nominal, 0.0, late, lanes.levels_rad(lane, turn + 1), loop, -sign)
                       : equation.go(nominal, units::pi, units::pi + late, lanes.levels_rad(lane, turn), loop, sign);
        worst = std::max(worst, std::abs(sign * there[0] - (a + deviation[0][lane])) / a);
        worst_time = std::max(worst_time, std::abs(there[1]) / a);
        state = nominal;
    }
    return {worst, worst_time};
}

/// Rms error of a turn by the path that half cycles are given between their turns, over the kick: against the motion of
/// the resonator itself. What a turn adds is that of the half cycles on either side.
double path_error(const DriveNoise& noise, std::size_t which, double rms_rad, int half_cycles) {
    namespace ode = boost::numeric::odeint;
    const gyro::Setup setup = setup_of(named_devices[which]);
    DriveNoise at = noise;
    at.frequency_hz = setup.dither_frequency_hz;
    const std::vector<gyro::Device> devices(simd::lanes, gyro::Device(setup));
    const gyro::Device& device = devices[0];
    const double a = device.dither_amplitude_rad;
    const double w = units::two_pi * at.frequency_hz;
    const double b = device.coupling.b_rad_s / w;
    dither::DriveNoiseLanes lanes(at, devices, rms_rad, identities(917));
    const double damping = 0.5 / at.resonator_q;
    Uniform uniform(918);
    std::vector<simd::Lanes> deviation;
    std::vector<simd::Lanes> late;
    double before = lanes.deviation_rad()[0];
    double late_before = w * lanes.late_s()[0];
    double squares = 0.0;
    for (int turn = 0; turn < half_cycles; ++turn) {
        lanes.next(1, deviation, late);
        const double sign = turn % 2 == 0 ? 1.0 : -1.0;
        const double begin = late_before;
        const double end = units::pi + w * late[0][0];
        const double start_rad = uniform(-3.0, 3.0);
        // x, x'/w and the phase that the lock-in adds, by the angle from the nominal turn.
        using Motion = std::array<double, 3>;
        Motion y{-sign * (a + before), 0.0, 0.0};
        const double x0 = y[0];
        double at_angle = begin;
        while (end - at_angle > 1e-14) {
            const auto levels = lanes.levels_rad(0, at_angle < 0.0 ? turn - 1 : at_angle < units::pi ? turn : turn + 1);
            const double part = units::pi / static_cast<double>(levels.size());
            const double index = std::floor((at_angle + 1e-12) / part);
            const double to = std::min(end, (index + 1.0) * part);
            const auto count = static_cast<double>(levels.size());
            const double level = levels[static_cast<std::size_t>(index - count * std::floor(index / count))];
            const auto rate = [&](const Motion& m, Motion& d, double angle) {
                d[0] = m[1];
                d[1] = -m[0] - 2.0 * damping * m[1] + 2.0 * damping * (a + level) * sign * std::sin(angle);
                d[2] = b * std::sin(start_rad + (m[0] - x0) + m[2]);
            };
            ode::integrate_adaptive(ode::make_controlled<ode::runge_kutta_fehlberg78<Motion>>(1e-12, 1e-12), rate, y,
                                    at_angle, to, 1e-4);
            at_angle = to;
        }
        gyro::HalfCycle half = device.half_cycle(sign, a + 0.5 * (before + deviation[0][0]));
        if (noise.form == NoiseForm::held) half.amplitude_change_rad = deviation[0][0] - before;
        const double modelled = DirectIntegrator(device.coupling, 1e-11).lockin_gain_rad(start_rad, half);
        squares += std::pow(y[2] - modelled, 2);
        before = deviation[0][0];
        late_before = w * late[0][0];
    }
    return std::sqrt(squares / half_cycles) / gyro::turn_kick_rad(setup);
}

TEST(DriveNoise, PathsBetweenTurnsAreNearlyThoseOfTheResonator) {
    const DriveNoise held{.frequency_hz = frequency_hz, .resonator_q = 50.0};
    DriveNoise white = held;
    white.form = NoiseForm::white;
    for (const std::size_t which : {0U, 1U}) {
        const double of_held = path_error(held, which, 3.0, 200);
        const double of_white = path_error(white, which, 3.0, 200);
        std::printf("%s, Q 50, 3 rad: rms error of a half cycle over the kick, held %.2g, white %.2g\n",
                    named_devices[which].name, of_held, of_white);
        EXPECT_LT(of_held, 1e-4) << named_devices[which].name;
        EXPECT_LT(of_white, 0.01) << named_devices[which].name;
        EXPECT_LT(of_held, of_white) << named_devices[which].name;
    }
}

TEST(DriveNoise, TurnsAreThoseOfTheResonatorsEquation) {
    for (const auto& [q, form, hold, rms_rad] :
         {std::tuple{50.0, NoiseForm::held, 1, 3.0}, std::tuple{300.0, NoiseForm::held, 4, 5.0},
          std::tuple{50.0, NoiseForm::white, 1, 3.0}, std::tuple{300.0, NoiseForm::white, 1, 5.0}}) {
        const DriveNoise noise{.frequency_hz = frequency_hz, .resonator_q = q, .form = form, .hold_half_cycles = hold};
        const auto [angle, velocity] = error_of(noise, rms_rad, 2000);
        std::printf("Q %g, %s, hold %d: angle %.2g of the amplitude, velocity %.2g of the peak's\n", q,
                    form == NoiseForm::held ? "held" : "white", hold, angle, velocity);
        EXPECT_LT(angle, 1e-9);
        EXPECT_LT(velocity, 1e-9);
    }
}

/// Rms of the amplitude at the turns and of its change over a half cycle and a cycle.
struct Seen {
    double rms, half_cycle, cycle;
};
Seen seen(const DriveNoise& noise, double rms_rad, std::size_t turns) {
    const auto devices = devices_of(1);
    dither::DriveNoiseLanes lanes(noise, devices, rms_rad, identities(912));
    std::vector<simd::Lanes> deviation;
    std::vector<simd::Lanes> late;
    lanes.next(turns, deviation, late);
    double sum = 0.0;
    double squares = 0.0;
    double by_half = 0.0;
    double by_cycle = 0.0;
    for (std::size_t i = 2; i < turns; ++i) {
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            sum += deviation[i][lane];
            squares += deviation[i][lane] * deviation[i][lane];
            by_half += std::pow(deviation[i][lane] - deviation[i - 1][lane], 2);
            by_cycle += std::pow(deviation[i][lane] - deviation[i - 2][lane], 2);
        }
    }
    const double count = static_cast<double>((turns - 2) * simd::lanes);
    return {std::sqrt(squares / count - std::pow(sum / count, 2)), std::sqrt(by_half / count),
            std::sqrt(by_cycle / count)};
}

TEST(DriveNoise, HasTheStrengthThatIsAskedForWhateverItsForm) {
    constexpr double rms_rad = 3.0;
    const DriveNoise plain{.frequency_hz = frequency_hz, .resonator_q = 50.0};
    std::vector<DriveNoise> all(9, plain);
    all[1].hold_half_cycles = 7;
    all[2].form = NoiseForm::white;
    all[3].distribution = NoiseDistribution::uniform;
    all[4].distribution = NoiseDistribution::binary;
    all[5].amplitude_loop_hz = 2.0;
    all[6].form = NoiseForm::sinusoidal;
    all[6].modulation_hz = 3.3;
    all[7] = all[6];
    all[7].amplitude_loop_hz = 2.0;
    all[8] = all[2];
    all[8].amplitude_loop_hz = 4.0;
    for (const DriveNoise& noise : all) {
        const Resonator resonator(noise);
        const Seen s = seen(noise, rms_rad, 40'000);
        // Correlated over Q/pi half cycles: some 6000 independent ones in each of sixteen gyros.
        EXPECT_NEAR(s.rms / rms_rad, 1.0, 0.015) << (&noise - all.data());
        EXPECT_NEAR(s.half_cycle / (rms_rad * resonator.change_per_half_cycle()), 1.0, 0.015) << (&noise - all.data());
        EXPECT_NEAR(s.cycle / (rms_rad * resonator.change_per_cycle()), 1.0, 0.015) << (&noise - all.data());
    }
}

TEST(DriveNoise, ALoopEatsSlowNoise) {
    DriveNoise noise{.frequency_hz = frequency_hz, .resonator_q = 300.0, .hold_half_cycles = 100};
    const double without = Resonator(noise).rms();
    noise.amplitude_loop_hz = 8.0;
    EXPECT_LT(Resonator(noise).rms(), 0.8 * without);
    noise.amplitude_loop_hz = 400.0;
    EXPECT_GE(Resonator(noise).decay(), 1.0);
}

TEST(DriveNoise, DependsOnSeedGyroAndTurnAlone) {
    const DriveNoise noise{.frequency_hz = frequency_hz, .hold_half_cycles = 3};
    const auto devices = devices_of(2, 500.0);
    const auto rows_of = [&](std::size_t gyros, std::size_t piece) {
        dither::LaneDither dither({devices.data(), gyros}, noise, 3.0, identities(913));
        std::vector<double> rows;
        gyro::LaneDrive drive;
        for (std::size_t done = 0; done < 60; done += piece) {
            dither.next(piece, {}, {}, drive);
            for (std::size_t i = 0; i < piece; ++i) {
                rows.insert(rows.end(), {drive.plain_fringes[i][1], drive.amplitude_rad[i][1],
                                         drive.amplitude_change_rad[i][1], drive.rotation_fringes[i][1]});
            }
        }
        return rows;
    };
    const std::vector<double> whole = rows_of(simd::lanes, 60);
    EXPECT_EQ(rows_of(2, 60), whole);
    EXPECT_EQ(rows_of(simd::lanes, 7 * 4).size(), 4 * 84U);
    EXPECT_EQ(rows_of(simd::lanes, 20), whole);
    EXPECT_EQ(rows_of(3, 1), whole);
}

/// Rows of the drive follow from each other: the plain phase goes on by the swing and the input's rotation, amplitudes
/// are means of those at the turns, changes their differences.
TEST(DriveNoise, RowsOfTheDriveBelongTogether) {
    const DriveNoise noise{.frequency_hz = frequency_hz, .resonator_q = 50.0};
    const auto devices = devices_of(0, 3000.0);
    const gyro::Device& device = devices[0];
    dither::LaneDither dither(devices, noise, 3.0, identities(914));
    gyro::LaneDrive drive;
    dither.next(50, {}, {}, drive);
    for (std::size_t i = 0; i + 1 < 50; ++i) {
        for (const std::size_t lane : {0U, 15U}) {
            const double swing = 2.0 * drive.amplitude_rad[i + 1][lane] * drive.direction(i);
            const double turned = device.input_rate_rad_s * 0.5 / frequency_hz;
            const double gone = drive.plain_fringes[i + 1][lane] - drive.plain_fringes[i][lane];
            EXPECT_NEAR(std::remainder(gone - (swing + turned) / units::two_pi, 1.0), 0.0, 1e-12) << i;
            const double at_end = drive.amplitude_rad[i][lane] + 0.5 * drive.amplitude_change_rad[i][lane];
            const double at_begin = drive.amplitude_rad[i + 1][lane] - 0.5 * drive.amplitude_change_rad[i + 1][lane];
            // The swing takes up what the input turns while turns are late.
            EXPECT_NEAR(at_end, at_begin, 1e-4);
        }
    }
}

/// The turn map with amplitudes that change over half cycles, against the equation.
TEST(DriveNoise, TurnsOfGrowingAmplitudesAreThoseOfTheEquation) {
    for (const std::size_t which : {0U, 1U, 8U}) {
        std::vector<gyro::Device> devices;
        Uniform uniform(915);
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            gyro::Setup setup = setup_of(named_devices[which]);
            setup.input_rate_deg_h = uniform(-1e4, 1e4);
            setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
            setup.coupling_phase_rad = uniform(-3.0, 3.0);
            setup.initial_phase_rad = uniform(-3.0, 3.0);
            if (lane % 2 == 1) setup.dither_harmonic_ratio = uniform(-0.05, 0.05);
            if (lane % 4 == 2) setup.lockin_turn_asymmetry = 0.3;
            devices.emplace_back(setup);
        }
        DriveNoise noise{.frequency_hz = setup_of(named_devices[which]).dither_frequency_hz, .resonator_q = 50.0};
        constexpr double rms_rad = 3.0;
        const Resonator resonator(noise);
        dither::LaneDither dither(devices, noise, rms_rad, identities(916));
        const propagate::AmplitudeRoom room{8.0 * rms_rad, 8.0 * rms_rad * resonator.change_per_half_cycle()};
        const auto map = propagate::make_turn_map(devices, room, 1e-10);
        propagate::DirectPropagator direct(devices, 1e-12);
        gyro::LaneDrive drive;
        gyro::LaneTurns by_map;
        gyro::LaneTurns by_equation;
        dither.next(40, {}, {}, drive);
        map->step(drive, by_map);
        direct.step(drive, by_equation);
        double worst = 0.0;
        for (std::size_t i = 0; i < 40; ++i) {
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                const double off = by_map.lockin_fringes[i][lane] + by_map.lockin_whole[lane] -
                                   by_equation.lockin_fringes[i][lane] - by_equation.lockin_whole[lane];
                worst = std::max(worst, units::two_pi * std::abs(off) / static_cast<double>(i + 1));
            }
        }
        double told = 0.0;
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) told = std::max(told, map->table_error_rad(lane));
        std::printf("%s: %.2g rad a turn; tables say %.2g\n", named_devices[which].name, worst, told);
        EXPECT_LT(worst, 1e-9) << named_devices[which].name;
    }
}

}  // namespace
}  // namespace drive_noise_test
}  // namespace ringlock::test
