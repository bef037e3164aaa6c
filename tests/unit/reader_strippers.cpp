// Strippers against the closed forms of their delay, response and residue.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "engine/core/units.hpp"
#include "engine/reader/fir.hpp"
#include "engine/reader/notch.hpp"
#include "engine/reader/reader.hpp"
#include "engine/reader/reference.hpp"
#include "engine/reader/stripper.hpp"
#include "engine/reader/whole_cycle.hpp"

namespace ringlock::reader {
namespace reader_strippers_test {
namespace {

constexpr double dither_hz = 397.3;
constexpr double latch_hz = 5000.0;
constexpr double amplitude_arcsec = 150.0;

/// What a reader has of a steady rotation and a steady dither.
Latched latched_at(double time_s, double rate_arcsec_s, const Settings& settings = {}) {
    const double x = units::two_pi * dither_hz * time_s;
    const double late = units::two_pi * dither_hz * settings.reference_delay_s;
    const double gain = amplitude_arcsec * (1.0 + settings.reference_gain_error_relative);
    return {time_s, rate_arcsec_s * time_s + amplitude_arcsec * std::sin(x), gain * std::sin(x - late),
            gain * std::cos(x - late)};
}

struct Measured {
    double delay_s;
    double rate_error_arcsec_s;
    double residue_relative;
};

/// Line and dither are fitted to the output of whole cycles after the warm-up.
Measured measure(Stripper& stripper, double rate_arcsec_s, const Settings& settings = {}) {
    const double warm_s = 3.0 * stripper.warm_up_s() + 0.2;
    const auto first = static_cast<std::int64_t>(warm_s * latch_hz);
    constexpr std::int64_t used = 50000;
    double s1 = 0.0, st = 0.0, stt = 0.0, sy = 0.0, sty = 0.0;
    std::vector<double> output;
    double next_crossing_s = 0.0;
    for (std::int64_t k = 0; k < first + used; ++k) {
        const double t = static_cast<double>(k) / latch_hz;
        while (stripper.wants_crossings() && next_crossing_s <= t) {
            stripper.take_crossing(next_crossing_s, rate_arcsec_s * next_crossing_s);
            next_crossing_s += 1.0 / dither_hz;
        }
        stripper.take(latched_at(t, rate_arcsec_s, settings));
        if (k < first) continue;
        const double y = stripper.angle_arcsec() - rate_arcsec_s * t;
        output.push_back(y);
        const double u = t - static_cast<double>(first) / latch_hz;
        s1 += 1.0;
        st += u;
        stt += u * u;
        sy += y;
        sty += u * y;
    }
    const double slope = (s1 * sty - st * sy) / (s1 * stt - st * st);
    const double level = (sy - slope * st) / s1;
    double c = 0.0, s = 0.0;
    for (std::size_t i = 0; i < output.size(); ++i) {
        const double u = static_cast<double>(i) / latch_hz;
        const double left = output[i] - level - slope * u;
        c += left * std::cos(units::two_pi * dither_hz * u);
        s += left * std::sin(units::two_pi * dither_hz * u);
    }
    return {-level / rate_arcsec_s, slope, 2.0 * std::hypot(c, s) / s1 / amplitude_arcsec};
}

Settings settings_of(Stripping stripping) {
    Settings settings;
    settings.stripping = stripping;
    return settings;
}

TEST(Strippers, NothingIsTakenOutByNone) {
    const auto none = make_stripper(settings_of(Stripping::none), latch_hz, dither_hz);
    const Measured m = measure(*none, 40.0);
    EXPECT_NEAR(m.residue_relative, 1.0, 1e-2);
    EXPECT_DOUBLE_EQ(none->residue_relative(), 1.0);
}

TEST(Strippers, FixedOnesHaveTheDelayAndTheResidueOfTheirClosedForms) {
    Settings off = settings_of(Stripping::reference);
    off.reference_gain_error_relative = 0.01;
    off.reference_delay_s = 5e-6;
    Settings both = off;
    both.stripping = Stripping::reference_fir;
    both.fir_order = 22;
    for (const Settings& settings : {settings_of(Stripping::whole_cycle), settings_of(Stripping::fir), off, both}) {
        const auto stripper = make_stripper(settings, latch_hz, dither_hz);
        const Measured m = measure(*stripper, 4000.0, settings);
        std::printf("%-13s delay %.6f ms (%.6f), residue %.3e (%.3e)\n",
                    stripping_names.at(static_cast<std::size_t>(settings.stripping)), 1e3 * m.delay_s,
                    1e3 * stripper->delay_s(), m.residue_relative, stripper->residue_relative());
        EXPECT_NEAR(m.delay_s, stripper->delay_s(), 0.01 * stripper->delay_s() + 2e-6);
        EXPECT_NEAR(m.residue_relative, stripper->residue_relative(), 0.01 * stripper->residue_relative() + 1e-5);
        EXPECT_LT(std::abs(m.rate_error_arcsec_s), 1e-2);
    }
}

// Literature: a filter of order 50 delays by 4.9 ms, one of order 22 by 2.1 ms: ticks of 5.1 to 5.2 kHz.
TEST(Strippers, AFilterDelaysByHalfItsOrder) {
    EXPECT_DOUBLE_EQ(Fir(50, 100.0, 5100.0, dither_hz).delay_s(), 25.0 / 5100.0);
    EXPECT_DOUBLE_EQ(Fir(22, 100.0, 5100.0, dither_hz).delay_s(), 11.0 / 5100.0);
}

TEST(Strippers, ANotchLetsARotationThroughAndDelaysItByItsClosedForm) {
    for (const double bandwidth_hz : {1.0, 10.0, 50.0}) {
        Notch notch(bandwidth_hz, latch_hz, dither_hz);
        const Measured m = measure(notch, 4000.0);
        std::printf("notch of %g Hz: delay %.4g ms (%.4g), residue %.2g\n", bandwidth_hz, 1e3 * m.delay_s,
                    1e3 * notch.delay_s(), m.residue_relative);
        EXPECT_LT(m.residue_relative, 1e-4);
        EXPECT_LT(std::abs(m.rate_error_arcsec_s) / 4000.0, 1e-6);
    }
}

// Half of the power passes at half a bandwidth from the dither.
TEST(Strippers, ANotchHasItsBandwidth) {
    constexpr double bandwidth_hz = 4.0;
    for (const double sign : {-1.0, 1.0}) {
        Notch notch(bandwidth_hz, latch_hz, dither_hz);
        const double hz = dither_hz + sign * 0.5 * bandwidth_hz;
        double power = 0.0;
        constexpr int settled = 20000;
        constexpr int used = 50000;
        for (int k = 0; k < settled + used; ++k) {
            const double t = static_cast<double>(k) / latch_hz;
            notch.take({t, std::sin(units::two_pi * hz * t), 0.0, 0.0});
            if (k >= settled) power += notch.angle_arcsec() * notch.angle_arcsec() / used;
        }
        EXPECT_NEAR(power, 0.25, 0.25 * 0.02);
    }
}

// Small steps: white noise of variance s^2 leaves a dither of rms s sqrt(step/2).
TEST(Strippers, ALearntReferenceLeavesWhatSmallStepsLeave) {
    Settings settings = settings_of(Stripping::reference);
    settings.reference_gain_error_relative = 0.02;
    settings.reference_delay_s = 1e-5;
    settings.reference_learning_s = 0.1;
    constexpr double noise_arcsec = 0.3;
    std::mt19937_64 engine(77);
    std::normal_distribution<double> normal;
    Reference reference(settings, latch_hz, dither_hz);
    const auto settled = static_cast<std::int64_t>(reference.warm_up_s() * latch_hz);
    constexpr std::int64_t used = 2'000'000;
    double square = 0.0;
    for (std::int64_t k = 0; k < settled + used; ++k) {
        const double t = static_cast<double>(k) / latch_hz;
        Latched latched = latched_at(t, 40.0, settings);
        const double noise = noise_arcsec * normal(engine);
        latched.angle_arcsec += noise;
        reference.take(latched);
        if (k < settled) continue;
        const double left = reference.angle_arcsec() - 40.0 * t - noise;
        square += left * left / used;
    }
    const double step = 2.0 / (settings.reference_learning_s * latch_hz);
    const double formula = noise_arcsec * std::sqrt(0.5 * step);
    std::printf("learnt reference: rms %.5f arcsec (%.5f)\n", std::sqrt(square), formula);
    EXPECT_NEAR(std::sqrt(square), formula, 0.1 * formula);
}

TEST(Strippers, AReferenceIsLearntWithItsTimeConstant) {
    Settings settings = settings_of(Stripping::reference);
    settings.reference_gain_error_relative = 0.1;
    settings.reference_learning_s = 0.5;
    Reference reference(settings, latch_hz, dither_hz);
    double largest = 0.0;
    const auto wanted = static_cast<int>(3.0 * settings.reference_learning_s * latch_hz);
    const int cycle = static_cast<int>(latch_hz / dither_hz) + 1;
    for (int k = 0; k < wanted + cycle; ++k) {
        const double t = static_cast<double>(k) / latch_hz;
        reference.take(latched_at(t, 0.0, settings));
        if (k >= wanted) largest = std::max(largest, std::abs(reference.angle_arcsec()));
    }
    const double formula = 0.1 * amplitude_arcsec * std::exp(-3.0);
    EXPECT_NEAR(largest, formula, 0.1 * formula);
}

// Noise of the measured dither moves the zero crossing, and the counter has whole quarter fringes there as elsewhere.
TEST(Strippers, CountsAtMovedCrossingsAreWhole) {
    Settings settings = settings_of(Stripping::whole_cycle);
    settings.fraction = Fraction::none;
    settings.reference_noise_arcsec = 1.3;
    constexpr double k_arcsec = 2.0;
    Source source;
    source.scale_factor_arcsec = k_arcsec;
    source.dither_hz = 100.0;
    Reader reader(settings, 100.0, source);
    std::vector<Instant> instants;
    for (int i = 0; i < 400; ++i) {
        // Each tick is a cycle after a crossing, whose angle it then has.
        Instant crossing{.crossing = true, .tick = i, .time_s = 0.01 * i, .whole_fringes = 0.0, .fringes = 0.37 * i};
        Instant tick = crossing;
        tick.crossing = false;
        instants.push_back(crossing);
        instants.push_back(tick);
    }
    reader.read(instants, {}, {});
    int moved = 0;
    double squares = 0.0;
    for (std::size_t i = 3; i < reader.angles_arcsec().size(); ++i) {
        const double counts = reader.angles_arcsec()[i] / (0.25 * k_arcsec);
        EXPECT_NEAR(counts, std::nearbyint(counts), 1e-9);
        const double off_arcsec = reader.angles_arcsec()[i] - 0.37 * k_arcsec * static_cast<double>(i - 1);
        squares += off_arcsec * off_arcsec;
        moved += std::abs(off_arcsec) > 0.25 * k_arcsec ? 1 : 0;
    }
    EXPECT_GT(moved, 100);
    EXPECT_NEAR(std::sqrt(squares / static_cast<double>(reader.angles_arcsec().size() - 3)), 1.3, 0.2);
}

}  // namespace
}  // namespace reader_strippers_test
}  // namespace ringlock::reader
