// Effects that change the equation of motion within a half cycle: second harmonics of dither and coupling, and a
// threshold that differs between the turns.
#include <algorithm>
#include <cmath>
#include <complex>

#include "engine/core/error.hpp"
#include "engine/effects/effect.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace harmonics_test {
namespace {

gyro::Setup with(std::string_view effect, const effects::Values& values, gyro::Setup setup = paper_device()) {
    effects::find(effect)->configure(values, setup);
    return setup;
}

/// Worst difference [rad] between turn map and direct integrator over random half cycles.
double worst_difference(std::string_view effect, double most, bool has_phase, std::uint64_t seed,
                        int half_cycles = 40) {
    Uniform uniform(seed);
    double worst = 0.0;
    for (int i = 0; i < half_cycles; ++i) {
        effects::Values values{{"ratio", uniform(-most, most)}};
        if (has_phase) values["phase_rad"] = uniform(-3.0, 3.0);
        gyro::Setup setup = with(effect, values);
        setup.input_rate_deg_h = uniform(-20000.0, 20000.0);
        setup.coupling_phase_rad = uniform(-3.0, 3.0);
        const gyro::Device device(setup);
        const auto direct = make_propagator(Method::direct, device, 0.0, 1e-12);
        const auto map = make_propagator(Method::turn_map, device, 0.05 * device.dither_amplitude_rad, 1e-10);
        const auto half = device.half_cycle(i % 2 == 0 ? 1.0 : -1.0, device.dither_amplitude_rad * uniform(0.95, 1.05));
        const double phase = uniform(-3.14, 3.14);
        worst = std::max(worst, std::abs(direct->lockin_gain_rad(phase, half) - map->lockin_gain_rad(phase, half)));
    }
    return worst;
}

TEST(DitherSecondHarmonic, StaysAMoebiusMap) {
    EXPECT_LT(worst_difference("dither_second_harmonic", 0.05, true, 41), 1e-9);
}

TEST(LockinTurnAsymmetry, StaysAMoebiusMap) {
    EXPECT_LT(worst_difference("lockin_turn_asymmetry", 0.3, false, 42), 1e-9);
}

/// Fourier coefficient of exp(i k psi) of the phase that a half cycle adds.
std::complex<double> gain_harmonic(const gyro::Setup& setup, double amplitude_rad, int k) {
    const gyro::Device device(setup);
    const auto direct = make_propagator(Method::direct, device, 0.0, 1e-11);
    std::complex<double> sum;
    constexpr int n = 16;
    for (int i = 0; i < n; ++i) {
        const double psi = units::two_pi * i / n;
        sum += direct->lockin_gain_rad(psi, device.half_cycle(1.0, amplitude_rad)) * std::polar(1.0, -k * psi) /
               static_cast<double>(n);
    }
    return sum;
}

TEST(LockinSecondHarmonic, ItsKickIsTheFirstsOverTheRootOfTwo) {
    // Near a turn at psi_0 the phase runs twice as fast in 2 psi, so that the stationary time is shorter by sqrt(2). A
    // half cycle holds two halves of kicks; those of its second turn are taken away by amplitudes that move it by half
    // a period of the harmonic. What is linear in the ratio is half the difference of two signs; what is left out is
    // of the order of the kick, 0.15 of it in the phase at the turn, which averages out but for its square.
    constexpr double ratio = 0.01;
    const double a = gyro::Device(paper_device()).dither_amplitude_rad;
    const auto first =
        0.5 * (gain_harmonic(paper_device(), a, 1) + gain_harmonic(paper_device(), a + units::pi / 2, 1));
    const auto second = [&](double amplitude_rad) {
        const auto plus = with("lockin_second_harmonic", {{"ratio", ratio}, {"phase_rad", 0.0}});
        const auto minus = with("lockin_second_harmonic", {{"ratio", -ratio}, {"phase_rad", 0.0}});
        return 0.5 * (gain_harmonic(plus, amplitude_rad, 2) - gain_harmonic(minus, amplitude_rad, 2));
    };
    const auto kick = 0.5 * (second(a) + second(a + units::pi / 4));
    EXPECT_NEAR(std::abs(kick) / (ratio * std::abs(first)), std::sqrt(0.5), 0.01);
    // Both are half a kick, sin(psi_0 + pi/4) and sin(2 psi_0 + pi/4).
    EXPECT_NEAR(std::arg(kick / first), 0.0, 0.05);
}

TEST(LockinSecondHarmonic, TheTurnMapTakesIt) {
    EXPECT_LT(worst_difference("lockin_second_harmonic", 0.2, true, 43, 10), 1e-9);
}

TEST(LockinSecondHarmonic, OutsideItsTableTheTurnMapIntegratesAndCounts) {
    const gyro::Device device(with("lockin_second_harmonic", {{"ratio", 0.1}, {"phase_rad", 0.2}}));
    TurnMap map(device, ranges(device, 5.0), 1e-10);
    DirectIntegrator direct(device.coupling, 1e-12);
    const auto half = device.half_cycle(1.0, 1.2 * device.dither_amplitude_rad);
    EXPECT_NEAR(map.lockin_gain_rad(1.0, half), direct.lockin_gain_rad(1.0, half), 1e-9);
    EXPECT_EQ(map.outside(), 1);
}

TEST(LockinSecondHarmonic, ItsPhaseIsThatOfTwicePsiWhateverTheCouplingPhase) {
    // psi as the detectors see it: moving psi by e must move the second harmonic's phase by 2 e.
    gyro::Setup setup = with("lockin_second_harmonic", {{"ratio", 0.1}, {"phase_rad", 0.3}});
    gyro::Setup moved = with("lockin_second_harmonic", {{"ratio", 0.1}, {"phase_rad", 0.3 + 2.0 * 0.4}});
    moved.coupling_phase_rad = 0.4;
    const gyro::Device device(setup);
    const auto half = device.half_cycle(1.0, device.dither_amplitude_rad);
    const double gain = make_propagator(Method::direct, device)->lockin_gain_rad(1.0, half);
    EXPECT_NEAR(make_propagator(Method::direct, gyro::Device(moved))->lockin_gain_rad(0.6, half), gain, 1e-10);
}

}  // namespace
}  // namespace harmonics_test
}  // namespace ringlock::test
