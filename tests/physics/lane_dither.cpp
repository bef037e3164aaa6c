// The drive of a block of gyros against its definitions.
#include "engine/dither/lane_dither.hpp"

#include <bit>
#include <cstdio>
#include <vector>

#include "tests/physics/support.hpp"
#include "tests/support/drive.hpp"

namespace ringlock::test {
namespace lane_dither_test {
namespace {

using simd::lanes;

constexpr random::Purpose noise = random::Purpose::noise_injection;
constexpr std::uint64_t seed = 431;

std::vector<gyro::Device> devices(std::size_t gyros) {
    Uniform uniform(430);
    std::vector<gyro::Device> all;
    for (std::size_t i = 0; i < gyros; ++i) {
        gyro::Setup setup = paper_device();
        setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
        setup.dither_peak_rate_deg_s *= uniform(0.9, 1.1);
        setup.input_rate_deg_h = uniform(-50000.0, 50000.0);
        setup.initial_phase_rad = uniform(-3.0, 3.0);
        all.emplace_back(setup);
    }
    return all;
}

random::LaneIdentities identities() {
    random::LaneIdentities who;
    who.seed = seed;
    for (std::size_t lane = 0; lane < lanes; ++lane) who.gyro[lane] = 100 + 3 * lane;
    return who;
}

/// Rows of one piece after the other.
struct Rows {
    std::vector<simd::Lanes> plain, amplitude, rate, b, rotation, whole;
};

Rows go(const std::vector<gyro::Device>& all, double rms_rad, std::size_t turns, const std::vector<std::size_t>& pieces,
        const std::vector<simd::Lanes>& angle = {}, const std::vector<simd::Lanes>& factor = {},
        const dither::Wander& wander = {}) {
    dither::LaneDither dither(all, rms_rad, identities(), wander);
    gyro::LaneDrive drive;
    Rows rows;
    std::size_t done = 0;
    const auto part = [&](const std::vector<simd::Lanes>& of, std::size_t count) {
        return of.empty() ? std::span<const simd::Lanes>() : std::span(of).subspan(done, count);
    };
    for (std::size_t piece = 0; done < turns; ++piece) {
        const std::size_t count = std::min(pieces[piece % pieces.size()], turns - done);
        dither.next(count, part(angle, count), part(factor, count), drive);
        EXPECT_EQ(drive.first_turn, static_cast<std::int64_t>(done));
        EXPECT_EQ(drive.turns, count);
        for (std::size_t lane = 0; done > 0 && lane < all.size(); ++lane) {
            // The half cycle that ends a piece is the one that begins the next.
            EXPECT_EQ(drive.amplitude_rad[0][lane], rows.amplitude.back()[lane]);
            EXPECT_EQ(drive.rate_rad_s[0][lane], rows.rate.back()[lane]);
            EXPECT_EQ(drive.b_rad_s[0][lane], rows.b.back()[lane]);
        }
        for (std::size_t i = 0; i < count; ++i) {
            rows.plain.push_back(drive.plain_fringes[i]);
            rows.amplitude.push_back(drive.amplitude_rad[i + 1]);
            rows.rate.push_back(drive.rate_rad_s[i + 1]);
            rows.b.push_back(drive.b_rad_s[i + 1]);
            rows.rotation.push_back(drive.rotation_fringes[i]);
            rows.whole.push_back(drive.rotation_whole[i]);
        }
        done += count;
    }
    return rows;
}

std::size_t differing(const std::vector<simd::Lanes>& a, const std::vector<simd::Lanes>& b, std::size_t gyros) {
    std::size_t count = a.size() == b.size() ? 0 : 1;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
        for (std::size_t lane = 0; lane < gyros; ++lane) {
            count += std::bit_cast<std::uint64_t>(a[i][lane]) == std::bit_cast<std::uint64_t>(b[i][lane]) ? 0 : 1;
        }
    }
    return count;
}

/// What is left of a difference of phases after whole fringes [rad].
double apart_rad(double fringes, const Phase& phase) {
    return std::remainder(units::two_pi * fringes - phase.remainder_rad, units::two_pi);
}

TEST(LaneDither, WithoutNoiseIsTheDriveOfOneGyro) {
    const auto all = devices(5);
    const std::size_t turns = 1000;
    const Rows rows = go(all, 0.0, turns, {100});
    for (std::size_t lane = 0; lane < all.size(); ++lane) {
        Drive drive(all[lane], 0.0, {seed, 0});
        Phase rotation;
        for (std::size_t i = 0; i < turns; ++i, drive.advance()) {
            const gyro::HalfCycle half = drive.after();
            ASSERT_EQ(rows.amplitude[i][lane], half.amplitude_rad);
            ASSERT_EQ(rows.rate[i][lane], half.rate_rad_s);
            ASSERT_EQ(rows.b[i][lane], all[lane].coupling.b_rad_s);
            // A half cycle's rotation of up to 400 fringes is known to 5e-13 rad, always the same way.
            ASSERT_NEAR((rows.whole[i][lane] - static_cast<double>(rotation.fringes)) * units::two_pi +
                            (rows.rotation[i][lane] * units::two_pi - rotation.remainder_rad),
                        0.0, 5e-13 * static_cast<double>(i + 1));
            Phase plain = rotation;
            plain.add(all[lane].initial_phase_rad);
            plain.add(drive.turn_phase_rad());
            // The swing of 2000 fringes is known to 2e-12 rad.
            ASSERT_NEAR(apart_rad(rows.plain[i][lane], plain), 0.0, 5e-13 * static_cast<double>(i + 10));
            rotation.add(all[lane].input_rate_rad_s * half.duration_s);
        }
    }
}

TEST(LaneDither, SwingsBetweenNoisyTurns) {
    const auto all = devices(lanes);
    const std::size_t turns = 2000;
    const double rms_rad = 4.0;
    const Rows rows = go(all, rms_rad, turns, {64});
    const Rows quiet = go(all, 0.0, turns, {64});
    const auto who = identities();
    const double margin = Drive::amplitude_margin_rad(rms_rad);
    double sum = 0.0;
    for (std::size_t lane = 0; lane < all.size(); ++lane) {
        const auto turn_noise_rad = [&](std::size_t turn) {
            return rms_rad * random::normal({seed, who.gyro[lane]}, noise, turn);
        };
        Phase path(all[lane].initial_phase_rad + turn_noise_rad(0));
        for (std::size_t i = 0; i < turns; ++i) {
            const double sign = i % 2 == 0 ? 1.0 : -1.0;
            const double n = turn_noise_rad(i);
            const double next = turn_noise_rad(i + 1);
            const double a = all[lane].dither_amplitude_rad;
            // Rounding of a sum of 6300 rad: 1e-12.
            ASSERT_NEAR(rows.amplitude[i][lane], a + 0.5 * sign * (next - n), 2e-12);
            ASSERT_LT(std::abs(rows.amplitude[i][lane] - a), margin);
            ASSERT_NEAR(std::remainder(rows.plain[i][lane] - quiet.plain[i][lane] - n / units::two_pi, 1.0), 0.0,
                        1e-14);
            // Half cycles join: from turn to turn the phase goes what the half cycle says.
            ASSERT_NEAR(apart_rad(rows.plain[i][lane], path), 0.0, 1e-12 * static_cast<double>(i + 10));
            gyro::HalfCycle half = all[lane].half_cycle(sign, rows.amplitude[i][lane]);
            path.add(half.plain_phase_total_rad());
            sum += std::pow(rows.amplitude[i][lane] - a, 2);
        }
    }
    // rms/sqrt(2); differences of neighbours share a deviate, which adds 1/4 twice to a variance of 2/n of the squares.
    const auto n = static_cast<double>(all.size() * turns);
    EXPECT_NEAR(sum / n / (0.5 * rms_rad * rms_rad), 1.0, 4.0 * std::sqrt(3.0 / n));
    // Before turn 0 the drive is free of noise: that half cycle ends at the first turn's.
    dither::LaneDither dither(all, rms_rad, who);
    gyro::LaneDrive drive;
    dither.next(1, {}, {}, drive);
    for (std::size_t lane = 0; lane < all.size(); ++lane) {
        const double first = rms_rad * random::normal({seed, who.gyro[lane]}, noise, 0);
        EXPECT_NEAR(drive.amplitude_rad[0][lane], all[lane].dither_amplitude_rad - 0.5 * first, 2e-12);
    }
}

struct Varying {
    std::vector<simd::Lanes> angle, factor;
};

Varying varying(std::size_t turns) {
    Uniform uniform(432);
    Varying all{std::vector<simd::Lanes>(turns), std::vector<simd::Lanes>(turns)};
    for (std::size_t i = 0; i < turns; ++i) {
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            all.angle[i][lane] = uniform(-20.0, 20.0);  // up to 40 fringes: 5000 deg/h
            all.factor[i][lane] = uniform(0.5, 1.5);
        }
    }
    return all;
}

TEST(LaneDither, VaryingRatesEnterTheirHalfCycleAndTheRotation) {
    const auto all = devices(lanes);
    const std::size_t turns = 2000;
    const Varying extra = varying(turns);
    const Rows rows = go(all, 4.0, turns, {128}, extra.angle, extra.factor);
    const auto who = identities();
    for (std::size_t lane = 0; lane < all.size(); ++lane) {
        const gyro::Device& device = all[lane];
        Phase rotation;
        for (std::size_t i = 0; i < turns; ++i) {
            const double duration_s = i % 2 == 0 ? device.positive_duration_s : device.negative_duration_s;
            const double turned_rad =
                device.input_rate_rad_s * duration_s + device.phase_per_arcsec * extra.angle[i][lane];
            const double rate_rad_s = turned_rad / duration_s;
            ASSERT_NEAR(rows.rate[i][lane], rate_rad_s, 1e-15 * (std::abs(rate_rad_s) + 1e6));
            ASSERT_EQ(rows.b[i][lane], extra.factor[i][lane] * device.coupling.b_rad_s);
            // Each half cycle adds up to 450 fringes, known to 5e-13 rad.
            ASSERT_NEAR((rows.whole[i][lane] - static_cast<double>(rotation.fringes)) * units::two_pi +
                            (rows.rotation[i][lane] * units::two_pi - rotation.remainder_rad),
                        0.0, 5e-13 * static_cast<double>(i + 1));
            Phase plain = rotation;
            plain.add(device.initial_phase_rad);
            plain.add(4.0 * random::normal({seed, who.gyro[lane]}, noise, i));
            if (i % 2 != 0) plain.add(2.0 * device.dither_amplitude_rad);
            ASSERT_NEAR(apart_rad(rows.plain[i][lane], plain), 0.0, 5e-13 * static_cast<double>(i + 10));
            rotation.add(turned_rad);
        }
    }
}

TEST(LaneDither, RotationKeepsItsDigitsInALongRun) {
    // A constant rate: after n cycles the rotation is n times a cycle's, which long double can say.
    const auto all = devices(4);
    dither::LaneDither dither(all, 0.0, identities());
    gyro::LaneDrive drive;
    const std::size_t piece = 1000;
    const std::size_t pieces = 2000;
    for (std::size_t i = 0; i < pieces; ++i) dither.next(piece, {}, {}, drive);
    const auto cycles = static_cast<long double>(pieces * piece - 2) / 2.0L;
    for (std::size_t lane = 0; lane < all.size(); ++lane) {
        const long double two_pi = 6.283185307179586476925286766559L;
        const long double rate = all[lane].input_rate_rad_s;
        // The two half cycles' angles as doubles say them, rounding of the product included in the bound.
        const long double cycle =
            rate * (static_cast<long double>(all[lane].positive_duration_s) + all[lane].negative_duration_s) / two_pi;
        const long double at =
            static_cast<long double>(drive.rotation_whole[piece - 2][lane]) + drive.rotation_fringes[piece - 2][lane];
        // Constants of some 200 fringes, rounded to 1.4e-14 of a fringe each a few times, add up in 1e6 cycles.
        EXPECT_NEAR(static_cast<double>(at - cycles * cycle), 0.0, 2e6 * 6e-14);
        EXPECT_LE(std::abs(drive.rotation_fringes[piece - 2][lane]), 0.5);
        EXPECT_EQ(drive.rotation_whole[piece - 2][lane], std::nearbyint(drive.rotation_whole[piece - 2][lane]));
    }
}

// Turns of an amplitude A (1 + w) lie at -A w and 2 A + A w, so that the half cycle between has the mean of both; noise
// comes on top of it.
TEST(LaneDither, AmplitudesDriftAndWanderAroundTheMiddleOfTheSwing) {
    const auto all = devices(11);
    constexpr std::size_t turns = 4000;
    constexpr double drift = 3e-5;
    constexpr double wander = 2e-4;
    for (const double rms_rad : {0.0, 4.0}) {
        const Rows still = go(all, rms_rad, turns, {turns});
        const Rows drifting = go(all, rms_rad, turns, {turns}, {}, {}, {.drift_relative_per_s = drift});
        const Rows wandering = go(all, rms_rad, turns, {turns}, {}, {}, {.relative_rt_s = wander});
        double sum = 0.0;
        for (std::size_t lane = 0; lane < all.size(); ++lane) {
            const double a = all[lane].dither_amplitude_rad;
            const auto farther = [&](const Rows& rows, std::size_t i) {
                const double off = units::two_pi * (rows.plain[i][lane] - still.plain[i][lane]);
                return i % 2 == 0 ? -off : off;
            };
            const auto time_s = [&](std::size_t i) {
                return static_cast<double>(i / 2) * all[lane].period_s() +
                       (i % 2 == 0 ? 0.0 : all[lane].positive_duration_s);
            };
            double last = 0.0;
            for (std::size_t i = 0; i + 1 < turns; ++i) {
                // Fringes of some thousand, whole ones taken off: 1e-9 rad is their rounding.
                EXPECT_NEAR(farther(drifting, i), a * drift * time_s(i), 1e-9);
                for (const Rows* rows : {&drifting, &wandering}) {
                    const double mean = 0.5 * (farther(*rows, i) + farther(*rows, i + 1));
                    EXPECT_NEAR(rows->amplitude[i][lane] - still.amplitude[i][lane], mean, 1e-8);
                }
                const double now = farther(wandering, i) / a;
                const double step_s = i == 0 ? 1.0 : time_s(i) - time_s(i - 1);
                sum += (now - last) * (now - last) / (wander * wander * step_s);
                last = now;
            }
            EXPECT_EQ(farther(wandering, 0), 0.0);
        }
        // A chi-square of that many squares over their number: five standard errors.
        const auto squares = static_cast<double>(all.size() * (turns - 2));
        EXPECT_NEAR(sum / squares, 1.0, 5.0 * std::sqrt(2.0 / squares));
    }
}

TEST(LaneDither, PiecesOfAnySizeGiveTheSameBits) {
    const auto all = devices(11);
    const std::size_t turns = 1500;
    const Varying extra = varying(turns);
    for (const bool vary : {false, true}) {
        const auto angle = vary ? extra.angle : std::vector<simd::Lanes>();
        const auto factor = vary ? extra.factor : std::vector<simd::Lanes>();
        const dither::Wander wander = vary ? dither::Wander{1e-4, 1e-5} : dither::Wander{};
        const Rows whole = go(all, 4.0, turns, {turns}, angle, factor, wander);
        for (const auto& pieces : std::vector<std::vector<std::size_t>>{{1}, {3, 50, 1, 201}, {0, 512}}) {
            const Rows rows = go(all, 4.0, turns, pieces, angle, factor, wander);
            EXPECT_EQ(differing(rows.plain, whole.plain, all.size()), 0U);
            EXPECT_EQ(differing(rows.amplitude, whole.amplitude, all.size()), 0U);
            EXPECT_EQ(differing(rows.rate, whole.rate, all.size()), 0U);
            EXPECT_EQ(differing(rows.b, whole.b, all.size()), 0U);
            EXPECT_EQ(differing(rows.rotation, whole.rotation, all.size()), 0U);
            EXPECT_EQ(differing(rows.whole, whole.whole, all.size()), 0U);
        }
    }
}

}  // namespace
}  // namespace lane_dither_test
}  // namespace ringlock::test
