// What each parameter of a truth does to the record, against its formula.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "analysis/record/record.hpp"
#include "engine/core/error.hpp"
#include "tests/closure/generator/generator.hpp"
#include "tests/closure/generator/keys.hpp"
#include "tests/support/temporary_directory.hpp"

namespace generator_effects_test {
namespace {

using namespace ringlock;
using namespace ringlock::test::closure;

constexpr double pi = std::numbers::pi;

Truth usual() {
    Truth truth;
    truth.turns = 60;
    truth.initial_phase_rad = 0.9;
    truth.input_rate_deg_h = 15.0;
    return truth;
}
double phase_per_arcsec(const Truth& truth) { return 2.0 * pi / truth.scale_factor_arcsec; }
/// Amplitude of the dither in optical phase: C Omega_D/w.
double swing_rad(const Truth& truth) {
    return phase_per_arcsec(truth) * 3600.0 * truth.dither_peak_rate_deg_s / (2.0 * pi * truth.dither_frequency_hz);
}
Generated one(const Truth& truth) { return generate_with_trajectory({&truth, 1}).front(); }

TEST(ClosureRecord, RowsAreConsecutiveTurns) {
    const Generated made = one(usual());
    const record::Turns& turns = *made.record.turns;
    ASSERT_EQ(turns.size(), 60U);
    const double half_period = 0.5 / usual().dither_frequency_hz;
    for (std::size_t i = 0; i < turns.size(); ++i) {
        EXPECT_EQ(turns.direction[i], i % 2 == 0 ? 1 : -1);
        EXPECT_NEAR(made.trajectory.dither_turn_s[i], static_cast<double>(i + 1) * half_period, 1e-12);
        // The lock-in moves the zero-rate point by at most b/psi'', about a microsecond, the input rate by less
        EXPECT_NEAR(turns.time_s[i], made.trajectory.dither_turn_s[i], 1.2e-6);
        EXPECT_NEAR(std::hypot(turns.sine[i], turns.cosine[i]), 1.0, 1e-12);
        EXPECT_NEAR(std::remainder(std::atan2(turns.sine[i], turns.cosine[i]) - made.trajectory.zero_rate_phase_rad[i],
                                   2.0 * pi),
                    0.0, 1e-12);
        // The quadrant of the phase is the count's
        const double quarter = made.trajectory.zero_rate_phase_rad[i] / (0.5 * pi);
        EXPECT_EQ((turns.quarter_count[i] % 4 + 4) % 4, static_cast<std::int64_t>(quarter));
    }
    // Up and down again: some 8021 quarter fringes
    for (std::size_t i = 1; i < turns.size(); ++i) {
        const auto swing = static_cast<double>(turns.quarter_count[i] - turns.quarter_count[i - 1]);
        EXPECT_NEAR(swing, (i % 2 == 1 ? 2.0 : -2.0) * swing_rad(usual()) / (0.5 * pi), 3.0);
    }
}

TEST(ClosureRecord, CountsFromItsStart) {
    // Time 0 is a maximum; the first row is one swing down from it.
    Truth truth = usual();
    truth.lockin_threshold_deg_h = 0.0;
    truth.input_rate_deg_h = 0.0;
    const Generated made = one(truth);
    EXPECT_EQ(made.record.turns->quarter_count[0],
              static_cast<std::int64_t>(std::floor((0.9 - 2.0 * swing_rad(truth)) / (0.5 * pi))));
}

TEST(ClosureRecord, PassesTheChecksOfARecord) {
    Truth truth = usual();
    truth.turns = 400;
    truth.injected_noise_rad = 3.0;
    truth.readout_noise = 0.005;
    truth.clock_hz = 1e8;
    truth.wander.walk_per_turn = 1e-5;
    truth.temperature.ramp_k_per_h = 10.0;
    truth.input_profile_deg_h = {{0.0, 1.0, 3.0}, {0.0, 100.0, -50.0}};
    const Generated made = one(truth);
    for (const record::Finding& finding : record::check(made.record))
        ADD_FAILURE() << finding.where << ": " << finding.what;
}

TEST(ClosureRecord, IsWrittenAndReadBack) {
    Truth truth = usual();
    truth.input_profile_deg_h = {{0.0, 1.0}, {15.0, 20.0}};
    truth.temperature.ramp_k_per_h = 10.0;
    const record::Record made = one(truth).record;
    const test::TemporaryDirectory folder;
    const std::string path = folder / "turns.h5";
    record::write_record(path, made);
    const record::Record back = record::read_record(path);
    EXPECT_EQ(back.turns->time_s, made.turns->time_s);
    EXPECT_EQ(back.turns->direction, made.turns->direction);
    EXPECT_EQ(back.turns->quarter_count, made.turns->quarter_count);
    EXPECT_EQ(back.turns->sine, made.turns->sine);
    EXPECT_EQ(back.turns->cosine, made.turns->cosine);
    EXPECT_EQ(back.turns->accel_before_rad_s2, made.turns->accel_before_rad_s2);
    EXPECT_EQ(back.turns->accel_after_rad_s2, made.turns->accel_after_rad_s2);
    EXPECT_EQ(back.declared.lockin_threshold_deg_h, 300.0);
    EXPECT_EQ(back.input_rate_deg_h.value, made.input_rate_deg_h.value);
    EXPECT_EQ(back.temperature_c.value, made.temperature_c.value);
}

TEST(LongClosureRecord, DoesNotDependOnWhatIsMadeBesideIt) {
    std::vector<Truth> truths(11, usual());
    for (std::size_t i = 0; i < truths.size(); ++i) {
        truths[i].seed = i;
        truths[i].injected_noise_rad = 3.0;
        truths[i].turns = 20 + 7 * (i % 5);
        truths[i].lockin_threshold_deg_h = 100.0 * static_cast<double>(i);
        truths[i].dither_asymmetry = 0.01 * static_cast<double>(i % 3);
        if (i % 4 == 1) truths[i].lockin_second_harmonic.ratio = 0.03 * static_cast<double>(i);
    }
    const std::vector<Generated> together = generate_with_trajectory(truths);
    for (std::size_t i = 0; i < truths.size(); ++i) {
        const Generated alone = one(truths[i]);
        EXPECT_EQ(alone.record.turns->time_s, together[i].record.turns->time_s) << i;
        EXPECT_EQ(alone.record.turns->sine, together[i].record.turns->sine) << i;
        EXPECT_EQ(alone.record.turns->accel_after_rad_s2, together[i].record.turns->accel_after_rad_s2) << i;
        EXPECT_EQ(alone.trajectory.lockin_rad, together[i].trajectory.lockin_rad) << i;
    }
}

TEST(ClosureRecord, AccelerationsAreThoseOfTheDriveWithoutLockIn) {
    Truth truth = usual();
    truth.lockin_threshold_deg_h = 0.0;
    const Generated made = one(truth);
    const double w = 2.0 * pi * truth.dither_frequency_hz;
    for (std::size_t i = 0; i < truth.turns; ++i) {
        // The cosine departs from its parabola by (w t)^2/12 of t, (pi/2)/(6 A) of the phase at two quarter fringes
        EXPECT_NEAR(made.record.turns->accel_before_rad_s2[i] / (swing_rad(truth) * w * w), 1.0, 2e-4);
        EXPECT_NEAR(made.record.turns->accel_after_rad_s2[i] / (swing_rad(truth) * w * w), 1.0, 2e-4);
    }
}

TEST(ClosureRecord, ClockPutsTimesOnTicksBeforeThem) {
    Truth truth = usual();
    const Generated exact = one(truth);
    truth.clock_hz = 1e7;
    const Generated ticked = one(truth);
    for (std::size_t i = 0; i < truth.turns; ++i) {
        const double ticks = ticked.record.turns->time_s[i] * truth.clock_hz;
        EXPECT_NEAR(ticks, std::round(ticks), 1e-6);
        const double late = exact.record.turns->time_s[i] - ticked.record.turns->time_s[i];
        EXPECT_GT(late, -1e-15);
        EXPECT_LT(late, 1e-7);
        // Two pulses that some 10 us lie between, each off by up to a tick: the acceleration by twice that, 4 %
        for (const auto column : {&record::Turns::accel_before_rad_s2, &record::Turns::accel_after_rad_s2}) {
            EXPECT_NEAR((*ticked.record.turns.*column)[i] / (*exact.record.turns.*column)[i], 1.0, 0.045);
        }
    }
}

TEST(ClosureRecord, ReadoutNoiseIsOnBothDetectors) {
    Truth truth = usual();
    truth.turns = 1000;
    truth.lockin_threshold_deg_h = 0.0;
    truth.readout_noise = 0.02;
    const Generated made = one(truth);
    double sine = 0.0, cosine = 0.0, both = 0.0;
    for (std::size_t i = 0; i < truth.turns; ++i) {
        const double s = made.record.turns->sine[i] - std::sin(made.trajectory.zero_rate_phase_rad[i]);
        const double c = made.record.turns->cosine[i] - std::cos(made.trajectory.zero_rate_phase_rad[i]);
        sine += s * s;
        cosine += c * c;
        both += s * c;
    }
    // Four standard errors of 1000 normal numbers
    EXPECT_NEAR(std::sqrt(sine / 1000.0) / 0.02, 1.0, 4.0 / std::sqrt(2000.0));
    EXPECT_NEAR(std::sqrt(cosine / 1000.0) / 0.02, 1.0, 4.0 / std::sqrt(2000.0));
    EXPECT_NEAR(both / 1000.0 / 4e-4, 0.0, 4.0 / std::sqrt(1000.0));
}

TEST(ClosureRecord, InjectedNoiseIsOnTheAngleAtTheTurns) {
    Truth truth = usual();
    truth.turns = 2001;
    truth.lockin_threshold_deg_h = 0.0;
    truth.input_rate_deg_h = 0.0;
    truth.injected_noise_rad = 3.0;
    const Generated made = one(truth);
    double mean = 0.0, squares = 0.0, neighbours = 0.0;
    std::vector<double> angle;
    for (std::size_t i = 0; i < truth.turns; i += 2) angle.push_back(made.trajectory.plain_rad[i]);
    for (const double a : angle) mean += a / static_cast<double>(angle.size());
    for (std::size_t i = 0; i < angle.size(); ++i) {
        squares += (angle[i] - mean) * (angle[i] - mean);
        if (i > 0) neighbours += (angle[i] - mean) * (angle[i - 1] - mean);
    }
    // Bounded and white, no walk: four standard errors of 1001 normal numbers
    EXPECT_NEAR(std::sqrt(squares / 1000.0) / 3.0, 1.0, 4.0 / std::sqrt(2000.0));
    EXPECT_NEAR(neighbours / squares, 0.0, 4.0 / std::sqrt(1000.0));
}

TEST(ClosureRecord, AmplitudeWandersAsItSays) {
    Truth truth = usual();
    truth.turns = 4000;
    truth.lockin_threshold_deg_h = 0.0;
    const double dt = 0.5 / truth.dither_frequency_hz;
    const auto relative = [&](const Truth& t) {
        std::vector<double> a = one(t).trajectory.amplitude_rad;
        for (double& x : a) x = x / swing_rad(t) - 1.0;
        return a;
    };
    // Amplitudes of half cycles are means of the turns' on either side.
    Truth drift = truth;
    drift.turns = 50;
    drift.wander.drift_per_s = 1e-3;
    const std::vector<double> drifting = relative(drift);
    for (std::size_t i = 0; i < drifting.size(); ++i) {
        EXPECT_NEAR(drifting[i], 1e-3 * dt * (static_cast<double>(i) + 0.5), 1e-12);
    }
    Truth swing = truth;
    swing.turns = 50;
    swing.wander.swing = 2e-3;
    swing.wander.swing_period_s = 0.1;
    const std::vector<double> swinging = relative(swing);
    for (std::size_t i = 0; i < swinging.size(); ++i) {
        const double mid = 2.0 * pi * dt * (static_cast<double>(i) + 0.5) / 0.1;
        EXPECT_NEAR(swinging[i], 2e-3 * std::sin(mid) * std::cos(pi * dt / 0.1), 1e-12);
    }
    Truth walk = truth;
    walk.wander.walk_per_turn = 1e-5;
    const std::vector<double> walked = relative(walk);
    double steps = 0.0;
    // Means of two steps: variance of a change is half of a step's
    for (std::size_t i = 1; i < walked.size(); ++i) steps += std::pow(walked[i] - walked[i - 1], 2);
    EXPECT_NEAR(steps / (4000.0 * 0.5e-10), 1.0, 4.0 * std::sqrt(3.0 / 4000.0));  // neighbours correlated by a half
    Truth markov = truth;
    markov.wander.rms = 1e-4;
    markov.wander.correlation_s = 5.0 * dt;
    const std::vector<double> remembered = relative(markov);
    const double decay = std::exp(-0.2);
    double squares = 0.0;
    for (const double a : remembered) squares += a * a;
    // Mean of two neighbours: (1 + decay)/2 of the variance; correlated over some (1 + decay^2)/(1 - decay^2) turns
    const double effective = 4000.0 * (1.0 - decay * decay) / (1.0 + decay * decay);
    EXPECT_NEAR(squares / 4000.0 / (1e-8 * 0.5 * (1.0 + decay)), 1.0, 4.0 * std::sqrt(2.0 / effective));
}

TEST(ClosureEffect, DetectorPhaseOffsetTurnsThePhaseThatTheCouplingSees) {
    Truth truth = usual();
    truth.input_rate_deg_h = 40.0;
    const Generated without = one(truth);
    truth.detector_phase_offset_rad = 0.7;
    truth.initial_phase_rad -= 0.7;
    const Generated with = one(truth);
    for (std::size_t i = 0; i < truth.turns; ++i) {
        // The same motion, rounding apart, in another phase
        EXPECT_NEAR(with.trajectory.lockin_rad[i], without.trajectory.lockin_rad[i], 1e-8);
        EXPECT_NEAR(
            std::remainder(with.trajectory.zero_rate_phase_rad[i] + 0.7 - without.trajectory.zero_rate_phase_rad[i],
                           2.0 * pi),
            0.0, 1e-8);
    }
}

TEST(ClosureEffect, ReadoutEllipseIsOnTheDetectorsAlone) {
    Truth truth = usual();
    const Generated without = one(truth);
    truth.readout_ellipse = {0.04, 0.03, -0.02, 0.05};
    const Generated with = one(truth);
    for (std::size_t i = 0; i < truth.turns; ++i) {
        const double psi = without.trajectory.zero_rate_phase_rad[i];
        EXPECT_NEAR(with.record.turns->sine[i], 1.04 * std::sin(psi) + 0.03, 1e-14);
        EXPECT_NEAR(with.record.turns->cosine[i], std::cos(psi + 0.05) - 0.02, 1e-14);
    }
    EXPECT_EQ(with.trajectory.lockin_rad, without.trajectory.lockin_rad);
    EXPECT_EQ(with.record.turns->time_s, without.record.turns->time_s);
    EXPECT_EQ(with.record.turns->quarter_count, without.record.turns->quarter_count);
}

TEST(LongClosureEffect, MissedCountsAreLostOnTheWay) {
    Truth truth = usual();
    truth.turns = 400;
    const Generated without = one(truth);
    truth.missed_counts_per_turn = 0.1;
    const Generated with = one(truth);
    std::int64_t before = 0;
    int events = 0;
    for (std::size_t i = 0; i < truth.turns; ++i) {
        const std::int64_t off = with.record.turns->quarter_count[i] - without.record.turns->quarter_count[i];
        if (off != before) {
            // Down to a minimum a lost pulse leaves the count too high.
            EXPECT_EQ(off - before, with.record.turns->direction[i] > 0 ? 1 : -1);
            ++events;
        }
        before = off;
    }
    EXPECT_NEAR(events, 40, 4.0 * std::sqrt(36.0));
    EXPECT_EQ(with.trajectory.lockin_rad, without.trajectory.lockin_rad);
}

TEST(ClosureEffect, LockinTemperatureMovesTheThreshold) {
    Truth truth = usual();
    truth.lockin_temperature_per_k = 0.02;
    truth.temperature.ramp_k_per_h = 7200.0;
    truth.temperature.swing_k = 0.5;
    truth.temperature.period_s = 0.2;
    const Generated made = one(truth);
    for (std::size_t i = 0; i < truth.turns; ++i) {
        const double from = i == 0 ? 0.0 : made.trajectory.dither_turn_s[i - 1];
        const double to = made.trajectory.dither_turn_s[i];
        const double mean =
            2.0 * 0.5 * (from + to) +
            0.5 * 0.2 / (2.0 * pi) * (std::cos(2.0 * pi * from / 0.2) - std::cos(2.0 * pi * to / 0.2)) / (to - from);
        EXPECT_NEAR(made.trajectory.b_rad_s[i], phase_per_arcsec(truth) * 300.0 * (1.0 + 0.02 * mean), 1e-7);
    }
    // The environment's record begins at the start and ends behind the last turn.
    const record::Track& track = made.record.temperature_c;
    EXPECT_EQ(track.value.front(), truth.temperature.start_c);
    EXPECT_GE(track.time_s.back(), made.record.turns->time_s.back());
}

TEST(ClosureEffect, DitherAsymmetryMakesPositiveHalfCyclesStrongerAndShorter) {
    Truth truth = usual();
    truth.lockin_threshold_deg_h = 0.0;
    truth.input_rate_deg_h = 0.0;
    const double r = 0.03;
    truth.dither_asymmetry = r;
    const Generated made = one(truth);
    const record::Turns& turns = *made.record.turns;
    const double half = 0.5 / truth.dither_frequency_hz;
    const double w = 2.0 * pi * truth.dither_frequency_hz;
    for (std::size_t i = 1; i < turns.size(); ++i) {
        const bool up = turns.direction[i] < 0;
        EXPECT_NEAR(turns.time_s[i] - turns.time_s[i - 1], half * (up ? 1.0 - r : 1.0 + r), 1e-12);
        EXPECT_NEAR(made.trajectory.plain_rad[i] - made.trajectory.plain_rad[i - 1],
                    (up ? 2.0 : -2.0) * swing_rad(truth) * (1.0 - r * r), 1e-8);
        // Peak rate Omega_D (1 +- r), acceleration at the turn that times w/(1 -+ r)
        const double up_a = swing_rad(truth) * w * w * (1.0 + r) / (1.0 - r);
        const double down_a = swing_rad(truth) * w * w * (1.0 - r) / (1.0 + r);
        EXPECT_NEAR(turns.accel_before_rad_s2[i] / (up ? up_a : down_a), 1.0, 2e-4);
        EXPECT_NEAR(turns.accel_after_rad_s2[i] / (up ? down_a : up_a), 1.0, 2e-4);
    }
}

TEST(ClosureEffect, DitherSecondHarmonicMakesAccelerationsAtMinimaAndMaximaUnequal) {
    Truth truth = usual();
    truth.lockin_threshold_deg_h = 0.0;
    truth.input_rate_deg_h = 0.0;
    const double ratio = 0.01;
    const double f = 0.6;
    truth.dither_second_harmonic = {ratio, f};
    const Generated made = one(truth);
    const double w = 2.0 * pi * truth.dither_frequency_hz;
    for (std::size_t i = 0; i < truth.turns; ++i) {
        const double s = made.record.turns->direction[i];
        // psi'' = C w (Omega_D +- 2 Omega_2 cos f); the zero-rate point lies ratio sin f/w beside the dither's turn,
        // terms of second order in it apart.
        const double expected = swing_rad(truth) * w * w * (1.0 + 2.0 * s * ratio * std::cos(f));
        EXPECT_NEAR(made.record.turns->accel_before_rad_s2[i] / expected, 1.0, 4.0 * ratio * ratio + 5e-4);
        EXPECT_NEAR(made.record.turns->accel_after_rad_s2[i] / expected, 1.0, 4.0 * ratio * ratio + 5e-4);
        EXPECT_NEAR(made.record.turns->time_s[i] - made.trajectory.dither_turn_s[i], -s * ratio * std::sin(f) / w,
                    3.0 * ratio * ratio / w);
    }
}

// Of a swing that stays: (1 + 3 k)/(1 + k/3).
TEST(ClosureEffect, DitherThirdHarmonicMakesAccelerationsGreaterThanSwings) {
    Truth truth = usual();
    truth.lockin_threshold_deg_h = 0.0;
    truth.input_rate_deg_h = 0.0;
    const double ratio = 0.02;
    truth.dither_third_harmonic = ratio;
    const Generated made = one(truth);
    const record::Turns& turns = *made.record.turns;
    const double w = 2.0 * pi * truth.dither_frequency_hz;
    for (std::size_t i = 0; i < truth.turns; ++i) {
        const double expected = swing_rad(truth) * w * w * (1.0 + 3.0 * ratio) / (1.0 + ratio / 3.0);
        EXPECT_NEAR(turns.accel_before_rad_s2[i] / expected, 1.0, 1e-3);
        EXPECT_NEAR(turns.accel_after_rad_s2[i] / expected, 1.0, 1e-3);
        EXPECT_NEAR(turns.time_s[i], made.trajectory.dither_turn_s[i], 1e-12);
        if (i == 0) continue;
        const double quarters = std::abs(static_cast<double>(turns.quarter_count[i] - turns.quarter_count[i - 1]));
        EXPECT_NEAR(quarters * 0.5 * pi, 2.0 * swing_rad(truth), 2.0);
    }
}

TEST(ClosureEffect, RatesAddUpToTheirFormulas) {
    std::vector<Truth> truths;
    std::vector<double (*)(double, double)> rates;  // deg/h over [from, to]
    const auto add = [&](auto change, double (*rate)(double, double)) {
        Truth truth = usual();
        truth.input_rate_deg_h = 0.0;
        truth.lockin_threshold_deg_h = 0.0;
        change(truth);
        truths.push_back(truth);
        rates.push_back(rate);
    };
    add([](Truth& t) { t.bias_deg_h = -3.0; }, [](double, double) { return -3.0; });
    add(
        [](Truth& t) {
            t.input_rate_deg_h = 1000.0;
            t.scale_factor_error = 1e-3;
            t.bias_deg_h = 1.0;
        },
        [](double, double) { return 1002.0; });
    add(
        [](Truth& t) {
            t.input_rate_deg_h = 50.0;
            t.bias_per_rate_squared_h_deg = 1e-3;
        },
        [](double, double) { return 52.5; });
    add(
        [](Truth& t) {
            t.bias_temperature_deg_h_per_k = 0.5;
            t.temperature.ramp_k_per_h = 3600.0;
        },
        [](double from, double to) { return 0.25 * (from + to); });
    add(
        [](Truth& t) {
            t.rates.bias_step = {2.0, 0.1234};
        },
        [](double from, double to) { return 2.0 * std::clamp((to - 0.1234) / (to - from), 0.0, 1.0); });
    add([](Truth& t) { t.rates.bias_ramp_deg_h_per_h = 7200.0; }, [](double from, double to) { return from + to; });
    add(
        [](Truth& t) {
            t.rates.base_vibration = {37.0, 5.0, 0.4};
        },
        [](double from, double to) {
            const double w = 2.0 * pi * 37.0;
            return 5.0 * (std::cos(w * from + 0.4) - std::cos(w * to + 0.4)) / (w * (to - from));
        });
    add(
        [](Truth& t) {
            t.rates.chirped_line = {20.0, 30.0, 5.0, 0.0};
        },
        [](double from, double to) {
            double sum = 0.0;  // midpoints of 1000 parts
            for (int i = 0; i < 1000; ++i) {
                const double t = from + (to - from) * (i + 0.5) / 1000.0;
                sum += 5.0 * std::sin(2.0 * pi * (20.0 * t + 15.0 * t * t)) / 1000.0;
            }
            return sum;
        });
    // From 0 to 0.05 s up to 100 deg/h, then down to 20 at 0.1 s, and there
    add(
        [](Truth& t) {
            t.input_profile_deg_h = {{0.0, 0.05, 0.1}, {0.0, 100.0, 20.0}};
        },
        [](double from, double to) {
            const auto angle = [](double t) {
                if (t < 0.05) return 1000.0 * t * t;
                if (t < 0.1) return 2.5 + 100.0 * (t - 0.05) - 800.0 * (t - 0.05) * (t - 0.05);
                return 5.5 + 20.0 * (t - 0.1);
            };
            return (angle(to) - angle(from)) / (to - from);
        });
    const std::vector<Generated> made = generate_with_trajectory(truths);
    for (std::size_t k = 0; k < truths.size(); ++k) {
        double angle = 0.0;
        for (std::size_t i = 0; i < truths[k].turns; ++i) {
            const Trajectory& path = made[k].trajectory;
            const double from = i == 0 ? 0.0 : path.dither_turn_s[i - 1];
            const double expected = rates[k](from, path.dither_turn_s[i]);
            EXPECT_NEAR(path.rate_rad_s[i] / phase_per_arcsec(truths[k]), expected, 2e-6) << k << " row " << i;
            angle += expected * (path.dither_turn_s[i] - from);
            // And it is what the phase has turned by, beside the dither
            const double dither = path.amplitude_rad[i] * (i % 2 == 0 ? -2.0 : 0.0);
            EXPECT_NEAR(path.plain_rad[i] - dither, angle * phase_per_arcsec(truths[k]), 1e-7) << k << " row " << i;
        }
    }
    // The profile is the reference.
    EXPECT_EQ(made.back().record.input_rate_deg_h.value, (std::vector<double>{0.0, 100.0, 20.0}));
}

TEST(ClosureEffect, BiasFollowsTheAmplitude) {
    Truth truth = usual();
    truth.input_rate_deg_h = 0.0;
    truth.bias_per_relative_amplitude_deg_h = 1000.0;
    truth.wander.drift_per_s = 0.01;
    const Generated made = one(truth);
    for (std::size_t i = 0; i < truth.turns; ++i) {
        EXPECT_NEAR(made.trajectory.rate_rad_s[i] / phase_per_arcsec(truth),
                    1000.0 * (made.trajectory.amplitude_rad[i] / swing_rad(truth) - 1.0), 1e-9);
    }
}

/// Allan variance over m intervals each, of rates at equal intervals.
double allan_variance(const std::vector<double>& rates, std::size_t m) {
    std::vector<double> means;
    for (std::size_t i = 0; i + m <= rates.size(); i += m) {
        double sum = 0.0;
        for (std::size_t k = i; k < i + m; ++k) sum += rates[k] / static_cast<double>(m);
        means.push_back(sum);
    }
    double squares = 0.0;
    for (std::size_t i = 1; i < means.size(); ++i) squares += 0.5 * std::pow(means[i] - means[i - 1], 2);
    return squares / static_cast<double>(means.size() - 1);
}

TEST(ClosureEffect, RandomRatesHaveTheirAllanVariances) {
    // IEEE Std 952-1997: N^2/tau, (2 ln 2/pi) B^2, K^2 tau/3, each of many records of 2^14 intervals of 10 ms.
    constexpr std::size_t records = 24;
    constexpr double dt = 0.01;
    std::vector<double> edges(16385);
    for (std::size_t i = 0; i < edges.size(); ++i) edges[i] = dt * static_cast<double>(i);
    RateTruth white, flicker, walk;
    white.quantum_noise_deg_rt_h = 2e-3;
    flicker.bias_instability_deg_h = 0.3;
    walk.rate_random_walk_deg_h_rt_h = 4.0;
    for (const std::size_t m : {1U, 64U, 512U}) {
        const double tau = dt * static_cast<double>(m);
        double of_white = 0.0, of_flicker = 0.0, of_walk = 0.0;
        for (std::size_t i = 0; i < records; ++i) {
            of_white += allan_variance(mean_rates(white, i, edges), m) / records;
            of_flicker += allan_variance(mean_rates(flicker, i, edges), m) / records;
            of_walk += allan_variance(mean_rates(walk, i, edges), m) / records;
        }
        // Some 16384/m differences in each record: relative standard error sqrt(3/(n records)) at most; four of them.
        const double error = 4.0 * std::sqrt(3.0 * static_cast<double>(m) / (16384.0 * records));
        const double n = 60.0 * white.quantum_noise_deg_rt_h;  // arcsec/sqrt(s)
        EXPECT_NEAR(of_white / (n * n / tau), 1.0, error) << m;
        const double k = walk.rate_random_walk_deg_h_rt_h / 60.0;  // arcsec/s/sqrt(s)
        EXPECT_NEAR(of_walk / (k * k * tau / 3.0), 1.0, error) << m;
        // A sum of Markov rates half a decade apart, from 0.03 s on: at 0.64 s and 5 s flat to 5 %
        if (m > 1) {
            EXPECT_NEAR(of_flicker / (2.0 * std::numbers::ln2 / pi * 0.09), 1.0, error + 0.05) << m;
        }
    }
}

TEST(ClosureEffect, TelegraphDwellsForItsTime) {
    // Two states of equal mean dwell time D: the upper one half of the time, changes every D on average.
    RateTruth truth;
    truth.telegraph_bias = {2.0, 0.5};
    std::vector<double> edges(20001);
    for (std::size_t i = 0; i < edges.size(); ++i) edges[i] = 0.05 * static_cast<double>(i);
    const std::vector<double> rates = mean_rates(truth, 7, edges);
    double mean = 0.0;
    std::size_t pure = 0;
    for (const double rate : rates) {
        EXPECT_GE(rate, 0.0);
        EXPECT_LE(rate, 2.0 + 1e-12);
        mean += rate / static_cast<double>(rates.size());
        if (rate < 1e-12 || rate > 2.0 - 1e-12) ++pure;
    }
    // 1000 s at a correlation time of D/2 (power 2 integral of exp(-2 t/D)): variance of the mean D/1000
    EXPECT_NEAR(mean, 1.0, 4.0 * std::sqrt(0.5 / 1000.0));
    // An interval is without change with probability exp(-0.05/0.5)
    const double share = std::exp(-0.1);
    EXPECT_NEAR(static_cast<double>(pure) / 20000.0, share, 4.0 * std::sqrt(share * (1.0 - share) / 20000.0));
}

TEST(ClosureKeys, SetWhatTheyName) {
    for (const std::string& key : turn_keys()) {
        Truth truth;
        EXPECT_NO_THROW(set(truth, key, key == "input_profile_deg_h" ? "0:1,2:3" : "1")) << key;
    }
    for (const std::string& key : sample_keys()) {
        SampleTruth truth;
        const char* value = key == "kind"                  ? "angle_arcsec"
                            : key == "resampling.of"       ? "rate"
                            : key == "input_profile_deg_h" ? "0:1,2:3"
                                                           : "1";
        EXPECT_NO_THROW(set(truth, key, value)) << key;
    }
    Truth truth;
    set(truth, "lockin_second_harmonic.ratio", "0.03");
    set(truth, "input_profile_deg_h", "0:15,10:30");
    set(truth, "declared.bias_deg_h", "0.5");
    EXPECT_EQ(truth.lockin_second_harmonic.ratio, 0.03);
    EXPECT_EQ(truth.input_profile_deg_h.time_s, (std::vector<double>{0.0, 10.0}));
    EXPECT_EQ(truth.input_profile_deg_h.value, (std::vector<double>{15.0, 30.0}));
    EXPECT_EQ(truth.declared->bias_deg_h, 0.5);
    EXPECT_THROW(set(truth, "bias_deg_h", "1x"), InputError);
    EXPECT_THROW(set(truth, "bias", "1"), InputError);
}

}  // namespace
}  // namespace generator_effects_test
