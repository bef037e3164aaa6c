#include <gtest/gtest.h>

#include <functional>
#include <memory>

#include "tests/property/random_scenario.hpp"
#include "tests/support/direct.hpp"
#include "tests/support/turn_map.hpp"

// Symmetries of psi' = g(t) + b sin(psi + e) over one half cycle, whose g is the same seen from both ends. They follow
// from the equation alone, so that each propagator can be held against itself.
namespace ringlock::test {
namespace symmetry_test {
namespace {

struct Case {
    gyro::Coupling coupling;
    gyro::HalfCycle half;
    double phase_rad;
};

using Make = std::function<std::unique_ptr<Propagator>(const gyro::Coupling&, const gyro::HalfCycle&)>;

std::unique_ptr<Propagator> direct(const gyro::Coupling& coupling, const gyro::HalfCycle&) {
    return std::make_unique<DirectIntegrator>(coupling, 1e-11);
}

std::unique_ptr<Propagator> turn_map(const gyro::Coupling& coupling, const gyro::HalfCycle& half) {
    gyro::Setup setup;
    setup.dither_frequency_hz = 100.0;
    gyro::Device device(setup);
    device.coupling = coupling;
    device.positive_duration_s = half.duration_s;
    device.negative_duration_s = half.duration_s;
    const double b = coupling.b_rad_s;
    return std::make_unique<TurnMap>(
        device,
        propagate::HalfCycleRanges{
            {half.amplitude_rad - 20.0, half.amplitude_rad + 20.0}, {half.rate_rad_s, half.rate_rad_s}, {b, b}},
        1e-11);
}

double gain(const Make& make, const Case& c) { return make(c.coupling, c.half)->lockin_gain_rad(c.phase_rad, c.half); }

Case random_case(test::RandomScenarios& random) {
    const gyro::HalfCycle half{random.coin() ? 1.0 : -1.0, random.uniform(1000.0, 4000.0), random.uniform(1e-3, 5e-3),
                               random.uniform(-2000.0, 2000.0)};
    return {{random.uniform(200.0, 4000.0), random.uniform(-1.0, 1.0)}, half, random.uniform(-units::pi, units::pi)};
}

class Symmetry : public testing::TestWithParam<const char*> {
   protected:
    Make make() const { return std::string(GetParam()) == "direct" ? Make(direct) : Make(turn_map); }
    static constexpr int cases_ = 25;
    static constexpr double tolerance_ = 1e-9;
};

// psi -> -psi, g -> -g, e -> -e.
TEST_P(Symmetry, MirroredRatesGiveTheMirroredPhase) {
    test::RandomScenarios random(11);
    for (int i = 0; i < cases_; ++i) {
        const Case c = random_case(random);
        Case mirror = c;
        mirror.coupling.phase_rad = -c.coupling.phase_rad;
        mirror.half.sign = -c.half.sign;
        mirror.half.rate_rad_s = -c.half.rate_rad_s;
        mirror.phase_rad = -c.phase_rad;
        EXPECT_NEAR(gain(make(), mirror), -gain(make(), c), tolerance_) << i;
    }
}

// psi(t) -> pi - 2 e - psi(T - t) solves the same equation, so that a half cycle run from where it ended comes back.
TEST_P(Symmetry, TimeReversedItGainsTheSame) {
    test::RandomScenarios random(12);
    for (int i = 0; i < cases_; ++i) {
        const Case c = random_case(random);
        const double forward = gain(make(), c);
        Case back = c;
        const double end = c.phase_rad + c.half.plain_phase_total_rad() + forward;
        back.phase_rad = std::remainder(units::pi - 2.0 * c.coupling.phase_rad - end, units::two_pi);
        EXPECT_NEAR(gain(make(), back), forward, tolerance_) << i;
    }
}

TEST_P(Symmetry, AWholeFringeChangesNothing) {
    test::RandomScenarios random(13);
    for (int i = 0; i < cases_; ++i) {
        const Case c = random_case(random);
        Case further = c;
        further.phase_rad += random.coin() ? units::two_pi : -units::two_pi;
        EXPECT_NEAR(gain(make(), further), gain(make(), c), tolerance_) << i;
    }
}

// Solutions of an equation of first order never cross: the map of the phase over a half cycle is increasing.
TEST_P(Symmetry, PhasesKeepTheirOrder) {
    test::RandomScenarios random(14);
    for (int i = 0; i < cases_ / 5; ++i) {
        Case c = random_case(random);
        const auto propagator = make()(c.coupling, c.half);
        double before = -1e300;
        double first = 0.0;
        constexpr int points = 12;
        for (int k = 0; k <= points; ++k) {
            c.phase_rad = units::two_pi * k / points - units::pi;
            const double after = c.phase_rad + propagator->lockin_gain_rad(c.phase_rad, c.half);
            EXPECT_GT(after, before) << i << " " << k;
            if (k == 0) first = after;
            before = after;
        }
        EXPECT_NEAR(before - first, units::two_pi, tolerance_) << "a fringe in is a fringe out";
    }
}

INSTANTIATE_TEST_SUITE_P(Propagators, Symmetry, testing::Values("direct", "turn_map"),
                         [](const auto& name) { return std::string(name.param); });

}  // namespace
}  // namespace symmetry_test
}  // namespace ringlock::test
