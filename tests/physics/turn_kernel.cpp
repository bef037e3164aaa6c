// Blocks of gyros through the turns: step_turns against the direct integrator, against half cycles solved one by one,
// and against itself in other pieces, lanes and instruction sets.
#include "engine/propagate/turn_kernel.hpp"

#include <algorithm>
#include <bit>
#include <cstdio>
#include <numeric>
#include <vector>

#include "engine/dither/lane_dither.hpp"
#include "engine/propagate/rotation.hpp"
#include "engine/simd/target.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/drive.hpp"
#include "tests/support/long_drive.hpp"

namespace ringlock::test {
namespace turn_kernel_test {
namespace {

using propagate::Range;
using simd::lanes;

/// A device of the paper's kind: any coupling phase, up to 5 % of asymmetry and of second harmonic, thresholds up to
/// 30 % higher or lower at minima than on average. `plain`: neither harmonic nor difference between the turns.
gyro::Setup random_setup(Uniform& uniform, double rate_deg_h, bool plain) {
    gyro::Setup setup = paper_device();
    setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
    setup.input_rate_deg_h = uniform(-rate_deg_h, rate_deg_h);
    setup.coupling_phase_rad = uniform(-3.0, 3.0);
    setup.initial_phase_rad = uniform(-3.0, 3.0);
    if (!plain) {
        setup.dither_harmonic_ratio = uniform(0.0, 0.05);
        setup.dither_harmonic_phase_rad = uniform(-3.0, 3.0);
        setup.lockin_turn_asymmetry = uniform(-0.3, 0.3);
    }
    return setup;
}

/// Worst difference [rad] over half cycles of random devices, 16 at a time, every fourth without harmonic. Rate and b
/// vary within `rate_width_deg_h` and `b_width_ratio` either side of the device's.
double worst_half_cycle(int half_cycles, double rate_width_deg_h, double b_width_ratio, std::uint64_t seed) {
    Uniform uniform(seed);
    double worst = 0.0;
    double error_told = 0.0;
    std::size_t least_terms = propagate::TurnTables::most_nodes;
    std::size_t most_terms = 0;
    int done = 0;
    while (done < half_cycles) {
        const auto gyros = static_cast<std::size_t>(std::min(half_cycles - done, static_cast<int>(lanes)));
        propagate::TurnTables tables(1e-10);
        propagate::TurnState state;
        gyro::LaneDrive drive;
        drive.first_turn = done / static_cast<int>(lanes) % 2;
        drive.resize(2);
        std::vector<double> exact;
        for (std::size_t lane = 0; lane < gyros; ++lane) {
            const gyro::Device device(random_setup(uniform, 50000.0, lane % 4 == 0));
            const double a = device.dither_amplitude_rad;
            const double b = device.coupling.b_rad_s;
            const double rate = device.input_rate_rad_s;
            const double rate_width = device.phase_per_arcsec * rate_width_deg_h;
            const propagate::HalfCycleRanges ranges{{0.95 * a, 1.05 * a},
                                                    {rate - rate_width, rate + rate_width},
                                                    {(1.0 - b_width_ratio) * b, (1.0 + b_width_ratio) * b}};
            tables.make(lane, device, ranges);
            error_told = std::max(error_told, tables.measured_error_rad(lane));
            if (done == 0 && lane < 8) {
                propagate::TurnTables alone(1e-10);
                alone.make(0, device, ranges);
                least_terms = std::min(least_terms, alone.part(1.0, 0).terms[0]);
                most_terms = std::max(most_terms, alone.part(1.0, 0).terms[0]);
            }

            gyro::HalfCycle half = device.half_cycle(drive.direction(0), a * uniform(0.95, 1.05));
            half.rate_rad_s = uniform(ranges.rate_rad_s.lowest, ranges.rate_rad_s.highest);
            gyro::Coupling coupling = device.coupling;
            coupling.b_rad_s = uniform(ranges.b_rad_s.lowest, ranges.b_rad_s.highest);
            const double phase = uniform(-3.14, 3.14);
            DirectIntegrator direct(coupling, 1e-12);
            exact.push_back(direct.lockin_gain_rad(phase, half));

            state.coupling_phase_fringes[lane] = coupling.phase_rad / units::two_pi;
            Phase next(phase);
            next.add(half.plain_phase_total_rad());
            drive.plain_fringes[0][lane] = phase / units::two_pi;
            drive.plain_fringes[1][lane] = next.remainder_rad / units::two_pi;
            for (const std::size_t i : {1U, 2U}) {
                drive.amplitude_rad[i][lane] = half.amplitude_rad;
                drive.rate_rad_s[i][lane] = half.rate_rad_s;
                drive.b_rad_s[i][lane] = coupling.b_rad_s;
            }
        }
        gyro::LaneTurns turns;
        propagate::step_turns(tables, drive, gyros, state, &turns);
        for (std::size_t lane = 0; lane < gyros; ++lane) {
            const double gain = units::two_pi * (turns.lockin_whole[lane] + turns.lockin_fringes[1][lane]);
            worst = std::max(worst, std::abs(gain - exact[lane]));
        }
        done += static_cast<int>(gyros);
    }
    EXPECT_LT(least_terms, most_terms) << "no block mixes numbers of terms";
    EXPECT_LE(error_told, 1e-10);
    std::printf("worst of %d half cycles, rates within %.0f deg/h, b within %.0f %%: %.2g rad; tables say %.2g\n",
                half_cycles, rate_width_deg_h, 100.0 * b_width_ratio, worst, error_told);
    return worst;
}

// Tables of 1e-10 rad a turn, measured between the nodes but not everywhere; the direct integrator's 1e-12 rad
// (reference_integrators.cpp) is nothing beside.
TEST(TurnKernel, AgreesWithTheDirectIntegrator) { EXPECT_LT(worst_half_cycle(64, 0.0, 0.0, 401), 1e-9); }

TEST(LongTurnKernel, AgreesWithTheDirectIntegratorOverTenThousandHalfCycles) {
    EXPECT_LT(worst_half_cycle(10000, 0.0, 0.0, 402), 1e-9);
}

TEST(TurnKernel, AgreesWhereRatesAndCouplingVary) { EXPECT_LT(worst_half_cycle(48, 500.0, 0.2, 403), 1e-9); }

TEST(LongTurnKernel, AgreesWhereRatesAndCouplingVaryOverTwoThousandHalfCycles) {
    EXPECT_LT(worst_half_cycle(2000, 500.0, 0.2, 404), 1e-9);
}

/// A gyro and what it meets on its way.
struct Member {
    gyro::Setup setup;
    std::uint64_t number = 0;
    std::vector<double> angle_arcsec;      // of varying rates, by half cycle; or none
    std::vector<double> threshold_factor;  // likewise
    double b_width_ratio = 0.2;
};

constexpr double noise_rms_rad = 4.0;
constexpr double rate_width_deg_h = 500.0;

propagate::HalfCycleRanges ranges_of(const Member& member, const gyro::Device& device) {
    const double margin = Drive::amplitude_margin_rad(noise_rms_rad);
    propagate::HalfCycleRanges ranges = test::ranges(device, margin);
    if (!member.angle_arcsec.empty()) {
        const double width = device.phase_per_arcsec * rate_width_deg_h;
        ranges.rate_rad_s = {device.input_rate_rad_s - width, device.input_rate_rad_s + width};
    }
    if (!member.threshold_factor.empty()) {
        const double b = device.coupling.b_rad_s;
        ranges.b_rad_s = {(1.0 - member.b_width_ratio) * b, (1.0 + member.b_width_ratio) * b};
    }
    return ranges;
}

/// Where a gyro has come, turn by turn.
struct Path {
    std::vector<double> cosine, sine, lockin_rad;
    // State after the last turn.
    std::vector<double> state;
    // What the drive was.
    std::vector<double> plain_fringes, amplitude_rad, rate_rad_s, b_rad_s;
    bool strong = false;
};

/// Sends the gyros through the turns in pieces of these sizes, again and again.
std::vector<Path> go(const std::vector<Member>& members, std::size_t turns, const std::vector<std::size_t>& pieces) {
    std::vector<gyro::Device> devices;
    propagate::TurnTables tables(1e-10);
    propagate::TurnState state;
    random::LaneIdentities who;
    who.seed = 405;
    for (std::size_t lane = 0; lane < members.size(); ++lane) {
        devices.emplace_back(members[lane].setup);
        tables.make(lane, devices.back(), ranges_of(members[lane], devices.back()));
        state.coupling_phase_fringes[lane] = devices.back().coupling.phase_rad / units::two_pi;
        who.gyro[lane] = members[lane].number;
    }
    const bool vary = !members.front().angle_arcsec.empty();
    dither::LaneDither dither(devices, noise_rms_rad, who);
    gyro::LaneDrive drive;
    gyro::LaneTurns at;
    std::vector<Path> paths(members.size());
    std::size_t done = 0;
    for (std::size_t piece = 0; done < turns; ++piece) {
        const std::size_t count = std::min(pieces[piece % pieces.size()], turns - done);
        std::vector<simd::Lanes> angle(vary ? count : 0);
        std::vector<simd::Lanes> factor(vary ? count : 0);
        for (std::size_t lane = 0; lane < members.size(); ++lane) {
            for (std::size_t i = 0; i < angle.size(); ++i) {
                angle[i][lane] = members[lane].angle_arcsec[done + i];
                factor[i][lane] = members[lane].threshold_factor[done + i];
            }
        }
        dither.next(count, angle, factor, drive);
        propagate::step_turns(tables, drive, members.size(), state, &at);
        for (std::size_t lane = 0; lane < members.size(); ++lane) {
            Path& path = paths[lane];
            for (std::size_t i = 0; i < count; ++i) {
                path.cosine.push_back(at.cosine[i][lane]);
                path.sine.push_back(at.sine[i][lane]);
                path.lockin_rad.push_back(units::two_pi * (at.lockin_whole[lane] + at.lockin_fringes[i][lane]));
                path.plain_fringes.push_back(drive.plain_fringes[i][lane]);
                path.amplitude_rad.push_back(drive.amplitude_rad[i + 1][lane]);
                path.rate_rad_s.push_back(drive.rate_rad_s[i + 1][lane]);
                path.b_rad_s.push_back(drive.b_rad_s[i + 1][lane]);
            }
        }
        done += count;
    }
    for (std::size_t lane = 0; lane < members.size(); ++lane) {
        paths[lane].state = {state.lockin_fringes[lane], state.whole[lane], state.shift_fringes[lane], state.z_re[lane],
                             state.z_im[lane]};
        paths[lane].strong = tables.strong();
    }
    return paths;
}

/// A block of unlike gyros: input rates of both signs, some symmetric; thresholds between the bounds.
std::vector<Member> block(std::uint64_t seed, std::size_t turns, bool vary, double least_threshold_deg_h,
                          double most_threshold_deg_h, double b_width_ratio = 0.2) {
    Uniform uniform(seed);
    std::vector<Member> members(lanes);
    for (std::size_t i = 0; i < lanes; ++i) {
        Member& member = members[i];
        member.setup = random_setup(uniform, i % 2 == 0 ? 50.0 : 5000.0, i % 3 == 0);
        member.setup.lockin_threshold_deg_h = uniform(least_threshold_deg_h, most_threshold_deg_h);
        member.number = (i << 30) + i;
        member.b_width_ratio = b_width_ratio;
        for (std::size_t k = 0; vary && k < turns; ++k) {
            // Less than the ranges allow: rates of the shorter half cycles are larger.
            member.angle_arcsec.push_back(uniform(-0.9, 0.9) * rate_width_deg_h * 3.8e-3);
            member.threshold_factor.push_back(uniform(1.0 - b_width_ratio, 1.0 + b_width_ratio));
        }
    }
    return members;
}

std::size_t differing(const std::vector<double>& a, const std::vector<double>& b) {
    std::size_t count = a.size() == b.size() ? 0 : 1;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
        count += std::bit_cast<std::uint64_t>(a[i]) == std::bit_cast<std::uint64_t>(b[i]) ? 0 : 1;
    }
    return count;
}

void expect_same_bits(const Path& a, const Path& b) {
    EXPECT_EQ(differing(a.plain_fringes, b.plain_fringes), 0U);
    EXPECT_EQ(differing(a.amplitude_rad, b.amplitude_rad), 0U);
    EXPECT_EQ(differing(a.rate_rad_s, b.rate_rad_s), 0U);
    EXPECT_EQ(differing(a.b_rad_s, b.b_rad_s), 0U);
    EXPECT_EQ(differing(a.cosine, b.cosine), 0U);
    EXPECT_EQ(differing(a.sine, b.sine), 0U);
    EXPECT_EQ(differing(a.state, b.state), 0U);
    // Told as whole fringes at the beginning of a piece and what came since, rounded once.
    ASSERT_EQ(a.lockin_rad.size(), b.lockin_rad.size());
    for (std::size_t i = 0; i < a.lockin_rad.size(); ++i) {
        ASSERT_NEAR(a.lockin_rad[i], b.lockin_rad[i], 0x1p-50 * (1.0 + std::abs(a.lockin_rad[i]))) << "turn " << i;
    }
}

TEST(TurnKernel, PiecesOfAnySizeGiveTheSameBits) {
    const std::size_t turns = 3000;
    for (const bool vary : {false, true}) {
        const auto members = block(406, turns, vary, 200.0, 400.0);
        const auto whole = go(members, turns, {turns});
        for (const auto& pieces : std::vector<std::vector<std::size_t>>{{1}, {7, 64, 1, 300}, {1024}}) {
            const auto paths = go(members, turns, pieces);
            for (std::size_t i = 0; i < members.size(); ++i) expect_same_bits(paths[i], whole[i]);
        }
    }
}

TEST(LongTurnKernel, LanesMatesAndInstructionSetsDoNotMatter) {
    const std::size_t turns = 300;
    std::mt19937_64 random(407);
    for (const bool vary : {false, true}) {
        // Up to 5000 deg/h: kicks on both sides of the one at which the arctangent of the right half plane is left.
        for (const double threshold_deg_h : vary ? std::vector<double>{5000.0} : std::vector<double>{300.0, 5000.0}) {
            const auto members = block(408, turns, vary, 200.0, threshold_deg_h);
            const auto reference = go(members, turns, {turns});
            for (const std::string& target : simd::available_targets()) {
                simd::use_target(target);
                for (const std::size_t gyros :
                     vary ? std::vector<std::size_t>{3} : std::vector<std::size_t>{16, 9, 1, 1}) {
                    std::vector<std::size_t> order(members.size());
                    std::iota(order.begin(), order.end(), std::size_t{0});
                    std::shuffle(order.begin(), order.end(), random);
                    order.resize(gyros);
                    std::vector<Member> some;
                    for (const std::size_t i : order) some.push_back(members[i]);
                    const auto paths = go(some, turns, {turns});
                    for (std::size_t k = 0; k < order.size(); ++k) {
                        SCOPED_TRACE(target + ", " + std::to_string(gyros) + " gyros, gyro " +
                                     std::to_string(order[k]));
                        expect_same_bits(paths[k], reference[order[k]]);
                    }
                }
            }
            simd::use_best_target();
        }
    }
}

TEST(TurnKernel, StrongMatesDoNotChangeAGyroAtTheBorder) {
    // In the middle of its range of b this gyro's kicks are weak. At its end they bend the phase by more than the
    // arctangent of the right half plane can take: which one is used must not be up to the other gyro.
    const std::size_t turns = 2000;
    auto members = block(409, turns, true, 300.0, 300.0, 0.9);
    members.resize(2);
    for (double& factor : members[0].threshold_factor) factor = 1.9;
    std::size_t weak = 0;
    std::size_t strong = 0;
    for (const double threshold_deg_h : {1000.0, 1500.0, 2000.0, 2300.0, 2600.0}) {
        members[0].setup.lockin_threshold_deg_h = threshold_deg_h;
        members[1].setup.lockin_threshold_deg_h = 5000.0;
        const auto together = go(members, turns, {turns});
        const auto alone = go({members[0]}, turns, {turns});
        EXPECT_TRUE(together[0].strong);
        (alone[0].strong ? strong : weak) += 1;
        SCOPED_TRACE(threshold_deg_h);
        expect_same_bits(together[0], alone[0]);
    }
    EXPECT_GT(weak, 0U);
    EXPECT_GT(strong, 0U);
}

/// Largest difference [rad] on the way from half cycles solved one by one.
double worst_of_path(const Member& member, const Path& path) {
    const gyro::Device device(member.setup);
    Phase lockin;
    double worst = 0.0;
    for (std::size_t i = 0; i < path.lockin_rad.size(); ++i) {
        worst = std::max(worst, std::abs(path.lockin_rad[i] - lockin.value_rad()));
        gyro::HalfCycle half = device.half_cycle(i % 2 == 0 ? 1.0 : -1.0, path.amplitude_rad[i]);
        half.rate_rad_s = path.rate_rad_s[i];
        gyro::Coupling coupling = device.coupling;
        coupling.b_rad_s = path.b_rad_s[i];
        const Phase psi = lockin + units::two_pi * path.plain_fringes[i];
        EXPECT_NEAR(path.cosine[i], std::cos(psi.remainder_rad + coupling.phase_rad), worst + 1e-8);
        EXPECT_NEAR(path.sine[i], std::sin(psi.remainder_rad + coupling.phase_rad), worst + 1e-8);
        lockin.add(propagate::exact_half_cycle(half, coupling).gain_rad(psi.remainder_rad));
    }
    return worst;
}

double worst_of_block(const std::vector<Member>& members, const std::vector<Path>& paths) {
    double worst = 0.0;
    for (std::size_t i = 0; i < members.size(); ++i) worst = std::max(worst, worst_of_path(members[i], paths[i]));
    std::printf("worst on %zu turns of %zu gyros: %.2g rad\n", paths[0].cosine.size(), members.size(), worst);
    return worst;
}

TEST(TurnKernel, FollowsHalfCyclesSolvedOneByOne) {
    // 1e-10 rad a turn, if all of 1000 pointed the same way. The map stretches a difference as often as it shrinks it.
    const std::size_t turns = 1000;
    for (const bool vary : {false, true}) {
        const auto members = block(410, turns, vary, 200.0, 400.0);
        EXPECT_LT(worst_of_block(members, go(members, turns, {500})), 1e-7);
    }
}

TEST(LongTurnKernel, FollowsStrongCouplingToo) {
    // A turn stretches a difference by up to (1 + |z|)/(1 - |z|) squared, a hundred times at |z| = 0.8, before the
    // next ones shrink it: two such turns in a row are worth 1e4 times 1e-10 rad.
    const std::size_t turns = 500;
    for (const bool vary : {false, true}) {
        const auto members = block(411, turns, vary, 3000.0, 5000.0);
        const auto paths = go(members, turns, {500});
        double strongest = 0.0;
        for (const Path& path : paths) strongest = std::max(strongest, std::hypot(path.state[3], path.state[4]));
        EXPECT_TRUE(paths[0].strong);
        EXPECT_GT(strongest, 0.3);
        std::printf("strongest |z|: %.2f\n", strongest);
        EXPECT_LT(worst_of_block(members, paths), 1e-6);
    }
}

}  // namespace
}  // namespace turn_kernel_test
}  // namespace ringlock::test
